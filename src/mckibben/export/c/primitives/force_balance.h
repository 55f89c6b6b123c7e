/* From displacements of n parallel muscles to their pressures, explicit; and its solution for the
 * displacements by Newton's method. Inputs: displacements (or pressures), what schedules.
 *
 * Coefficients: n, scheduling inputs, degree, thresholds m, scale, lowest and highest pressure, m
 * thresholds, then forces and area of every muscle. State: n displacements, n by m stops, count of
 * samples clipped or not solved; scratch: 2 n m + 2 n. Inverse: the same; scratch: n n + n + all inputs more. */
#ifndef MCK_FORCE_BALANCE_H
#define MCK_FORCE_BALANCE_H

#include "mck.h"

void mck_force_balance_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_force_balance_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real
                            *out);

void mck_force_balance_inverse_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_force_balance_inverse_step(const mck_part *part, mck_real *state, const mck_real *in,
                                    mck_real *out);

#endif
