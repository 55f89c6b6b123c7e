#include "gpi_adaptive.h"

#include "gpi.h"
#include "learnt_operators.h"

void mck_gpi_adaptive_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    const mck_learner m = mck_read_learner(part->coefficients);
    const int own = m.p + 3;
    const mck_learnt learnt = mck_split_learnt(&m, state, own, 1);
    const mck_part inverse = {mck_inverse_numbers(&m), 0, own - 1, 1, 1, part->start};
    mck_gpi_inverse_start(&inverse, state, in);
    state[own - 1] = MCK_R(0.0);
    mck_learnt_start(&m, &learnt, 1);
}

void mck_gpi_adaptive_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out)
{
    const mck_learner m = mck_read_learner(part->coefficients);
    const int n = m.p - 1;
    const mck_learnt learnt = mck_split_learnt(&m, state, n + 4, 1);
    const mck_real *numbers = mck_inverse_numbers(&m);
    const int way = mck_follow_learning(&m, &learnt, numbers + 6, state, state + n + 1, in);
    state[n] = mck_gpi_branch(numbers, n, way, state[0], state[n]);
    out[0] = state[n];
}
