/* Every output a weighted sum of all inputs.
 *
 * Coefficients: the matrix, row after row, one row an output. No state. */
#ifndef MCK_COUPLING_H
#define MCK_COUPLING_H

#include "mck.h"

void mck_coupling_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out);

#endif
