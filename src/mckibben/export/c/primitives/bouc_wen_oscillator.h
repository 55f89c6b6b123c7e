/* A mass, a damper and a spring with a Bouc-Wen element in the loop; see oscillator.h.
 *
 * Numbers of the element: slope, gamma, delta. */
#ifndef MCK_BOUC_WEN_OSCILLATOR_H
#define MCK_BOUC_WEN_OSCILLATOR_H

#include "mck.h"

void mck_bouc_wen_oscillator_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_bouc_wen_oscillator_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real
                              *out);

#endif
