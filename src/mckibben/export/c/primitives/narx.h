/* What NARX models share: past outputs and inputs, play operators, and where they rest. */
#ifndef MCK_NARX_H
#define MCK_NARX_H

#include "mck.h"

/* The scaled output that the regressors in the state give. */
typedef mck_real (*mck_regression)(const mck_part *part, const mck_real *state);

/* Coefficients before those of the regression: a head of seven, and the thresholds. */
int mck_narx_head(const mck_part *part);

/* Start at rest at the first input: where the regression gives back the output it is given. */
void mck_narx_start(mck_regression regression, const mck_part *part, mck_real *state, mck_real u);

/* Take an input, evaluate, and give the output in its own unit. */
mck_real mck_narx_step(mck_regression regression, const mck_part *part, mck_real *state, mck_real u);

#endif
