/* A mass, a damper and a spring with an element of free slopes in the loop; see oscillator.h.
 *
 * Numbers of the element: knots, slopes while the displacement rises, slopes while it falls, as many
 * each. */
#ifndef MCK_DUHEM_OSCILLATOR_H
#define MCK_DUHEM_OSCILLATOR_H

#include "mck.h"

void mck_duhem_oscillator_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_duhem_oscillator_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real
                              *out);

#endif
