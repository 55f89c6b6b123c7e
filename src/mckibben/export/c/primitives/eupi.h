/* The extended unparallel Prandtl-Ishlinskii model, and its inverse, solved for every sample.
 *
 * Coefficients: lowest input, slope and threshold ratio of the falling edge, offset, three of the
 * cubic, n thresholds, n weights. State: n operators.
 * Inverse: lowest and highest input behind; state: operators, previous input, count clipped. */
#ifndef MCK_EUPI_H
#define MCK_EUPI_H

#include "mck.h"

void mck_eupi_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_eupi_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out);

void mck_eupi_inverse_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_eupi_inverse_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real
                           *out);

#endif
