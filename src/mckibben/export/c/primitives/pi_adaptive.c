#include "pi_adaptive.h"

#include "learnt_operators.h"
#include "pi.h"

void mck_pi_adaptive_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    const mck_learner m = mck_read_learner(part->coefficients);
    const int own = m.p + 2;
    const mck_learnt learnt = mck_split_learnt(&m, state, own, 1);
    const mck_part inverse = {mck_inverse_numbers(&m), 1 + 2 * m.p, own - 1, 1, 1, part->start};
    mck_pi_inverse_start(&inverse, state, in);
    state[own - 1] = MCK_R(0.0);
    mck_learnt_start(&m, &learnt, 1);
}

void mck_pi_adaptive_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out)
{
    const mck_learner m = mck_read_learner(part->coefficients);
    const mck_learnt learnt = mck_split_learnt(&m, state, m.p + 2, 1);
    const mck_real *r = mck_inverse_numbers(&m) + 3;
    (void)mck_follow_learning(&m, &learnt, r, state, state + m.p - 1, in);
    out[0] = state[0];
}
