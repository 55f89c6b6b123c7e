#include "bouc_wen.h"

#include "flow.h"
#include "horner.h"
#include "root.h"

/* z after the input has gone on to u. */
static mck_real moved(const mck_real *c, const mck_real *state, mck_real u)
{
    const mck_real du = u - state[1];
    if (!(du < MCK_R(0.0)) && !(du > MCK_R(0.0))) {
        return state[0];
    }
    const mck_real up = du > MCK_R(0.0) ? MCK_R(1.0) : MCK_R(-1.0);
    return up * mck_flow(up * state[0], mck_abs(c[0] * du), MCK_R(1.0) - MCK_R(2.0) * c[1],
                         MCK_R(1.0), (int)c[2]);
}

static mck_real output(const mck_part *part, int behind, mck_real z, mck_real u)
{
    const mck_real *c = part->coefficients;
    const int size = part->n_coefficients - 6 - behind;
    return mck_horner((u - c[4]) / c[5], size, c + 6) + c[3] * z;
}

static void advance(const mck_real *c, mck_real *state, mck_real u)
{
    state[0] = moved(c, state, u);
    state[1] = u;
}

void mck_bouc_wen_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    state[0] = part->start == MCK_VIRGIN ? MCK_R(0.0) : MCK_R(1.0);
    state[1] = in[0];
}

void mck_bouc_wen_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out)
{
    advance(part->coefficients, state, in[0]);
    out[0] = output(part, 0, state[0], in[0]);
}

static mck_real trial(const mck_part *part, const mck_real *state, mck_real u)
{
    return output(part, 2, moved(part->coefficients, state, u), u);
}

static void forward_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out)
{
    out[0] = trial(part, state, in[0]);
    advance(part->coefficients, state, in[0]);
}

void mck_bouc_wen_inverse_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    mck_solved_start(mck_bouc_wen_start, forward_step, part, state, in[0]);
}

void mck_bouc_wen_inverse_step(const mck_part *part, mck_real *state, const mck_real *in,
                               mck_real *out)
{
    out[0] = mck_solved_input(trial, part, state, in[0]);
    advance(part->coefficients, state, out[0]);
}
