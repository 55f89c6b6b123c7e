/* The play (backlash) operator, w = min(max(w, u - r), u + r).
 *
 * Coefficients: r. State: w. */
#ifndef MCK_PLAY_H
#define MCK_PLAY_H

#include "mck.h"

void mck_play_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_play_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out);

#endif
