/* The Krasnosel'skii-Pokrovskii model on a grid, and its inverse, solved for every sample.
 *
 * Coefficients: number of intervals n, offset, n + 1 levels, n (n + 1) / 2 weights. State: as many
 * operators, previous input.
 * Inverse: lowest and highest input behind; state: as forward, last input, count clipped. */
#ifndef MCK_KRASNOSELSKII_POKROVSKII_H
#define MCK_KRASNOSELSKII_POKROVSKII_H

#include "mck.h"

void mck_krasnoselskii_pokrovskii_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_krasnoselskii_pokrovskii_step(const mck_part *part, mck_real *state, const mck_real *in,
                                       mck_real *out);

void mck_krasnoselskii_pokrovskii_inverse_start(const mck_part *part, mck_real *state, const
                                                mck_real *in);
void mck_krasnoselskii_pokrovskii_inverse_step(const mck_part *part, mck_real *state, const mck_real
                                               *in, mck_real *out);

#endif
