/* A balance of forces that learns while it gives pressures: of every muscle a constant force, and factors
 * on springs and elasticity, area, friction and what relaxes.
 *
 * Inputs: displacements, what schedules, loads, then what is measured of the displacements. Numbers: the
 * learner's (learning.h), which parameters are learnt (muscle times 5, plus kind), for every muscle the
 * most friction by area and the most area by stiffness, then the balance's as fitted. State: the
 * balance's; displacements, pressures and what scheduled of the last sample; what is learnt. */
#ifndef MCK_BALANCE_ADAPTIVE_H
#define MCK_BALANCE_ADAPTIVE_H

#include "mck.h"

void mck_balance_adaptive_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_balance_adaptive_step(const mck_part *part, mck_real *state, const mck_real *in,
                               mck_real *out);

#endif
