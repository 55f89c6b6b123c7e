/* The Preisach model on a grid in Everett form, and its inverse in closed form.
 *
 * Coefficients: number of levels n, n levels, Everett table n by n, offset. State: depth, direction,
 * 64 turning points, outputs at them, last input, last output.
 * Inverse: the same; state: as forward, count of samples clipped. */
#ifndef MCK_PREISACH_H
#define MCK_PREISACH_H

#include "mck.h"

void mck_preisach_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_preisach_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out);

void mck_preisach_inverse_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_preisach_inverse_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real
                               *out);

#endif
