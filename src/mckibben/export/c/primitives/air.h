/* A valve and the air behind it: gain, offsets, lags that differ in filling and venting, limits of the
 * pressure, dead time; and its exact inverse, which leaves the dead time.
 *
 * Coefficients: gain, offset while filling, while venting, share of the way that a sample fills, that it
 * vents, lowest, highest pressure, dead time in samples. State: pressure, past pressures.
 * Inverse: lowest, highest command behind; state: pressure, count of samples clipped. */
#ifndef MCK_AIR_H
#define MCK_AIR_H

#include "mck.h"

void mck_air_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_air_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out);

void mck_air_inverse_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_air_inverse_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out);

#endif
