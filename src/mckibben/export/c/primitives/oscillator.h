/* What oscillators with hysteresis in their loop share: a mass, a damper and a spring beside an element
 * whose force moves with the displacement, by classic Runge-Kutta substeps.
 *
 * Coefficients: substep, how many, 1 where the input is held between samples and 0 where it goes in a
 * straight line, inertia, damping, stiffness, offset; then the numbers of the element. State:
 * displacement, velocity, force of the element, last input. */
#ifndef MCK_OSCILLATOR_H
#define MCK_OSCILLATOR_H

#include "mck.h"

/* The element's slope by the displacement, at a force, for a direction of motion; `size` numbers. */
typedef mck_real mck_slope(const mck_real *numbers, int size, mck_real z, mck_real velocity);

void mck_oscillator_start(mck_slope *slope, const mck_part *part, mck_real *state, mck_real u);
void mck_oscillator_step(mck_slope *slope, const mck_part *part, mck_real *state, mck_real u,
                         mck_real *out);

#endif
