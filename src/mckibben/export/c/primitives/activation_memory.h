/* Activation pressure by contraction and force, with nonlocal memory. Inputs: contraction, force.
 *
 * Coefficients: smoothing and gain of the rate, centre and scale of contraction and of force, degree
 * by contraction and by force, number m of relaxations, surface row by row, n thresholds, n weights a
 * and b, two of the rate, m weights g and h, m decays. State: n operators, previous contraction,
 * filtered rate, m relaxations. */
#ifndef MCK_ACTIVATION_MEMORY_H
#define MCK_ACTIVATION_MEMORY_H

#include "mck.h"

void mck_activation_memory_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_activation_memory_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real
                                *out);

#endif
