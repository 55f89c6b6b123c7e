/* Activation pressure by contraction and force, a cubic with hysteresis in the rate. Inputs:
 * contraction, force.
 *
 * Coefficients: smoothing and gain of the rate, gamma, four of phi, sixteen of the contractions and
 * sixteen of the pressures of four points. State: previous contraction, filtered rate. */
#ifndef MCK_ACTIVATION_PRESSURE_H
#define MCK_ACTIVATION_PRESSURE_H

#include "mck.h"

void mck_activation_pressure_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_activation_pressure_step(const mck_part *part, mck_real *state, const mck_real *in,
                                  mck_real *out);

#endif
