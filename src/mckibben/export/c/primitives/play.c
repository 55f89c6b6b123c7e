#include "play.h"

#include "operators.h"

void mck_play_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    mck_operators_start(part->start, 1, part->coefficients, in[0], in[0], state);
}

void mck_play_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out)
{
    state[0] = mck_play(state[0], in[0], part->coefficients[0]);
    out[0] = state[0];
}
