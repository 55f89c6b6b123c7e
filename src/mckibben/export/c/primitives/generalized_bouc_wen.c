#include "generalized_bouc_wen.h"

#include "flow.h"
#include "horner.h"
#include "root.h"

/* How fast z decays, by the direction of the input, the sign of z and the side of the centre. */
static mck_real decay(const mck_real *c, mck_real going, mck_real z, mck_real side)
{
    return going * z + c[6] * side * going + c[7] * side * z + c[8] * going + c[9] * z +
           c[10] * side;
}

/* z after the input has moved by du on one side of the centre. */
static mck_real stretch(const mck_real *c, mck_real z, mck_real du, mck_real side)
{
    if (!(du < MCK_R(0.0)) && !(du > MCK_R(0.0))) {
        return z;
    }
    const mck_real up = du > MCK_R(0.0) ? MCK_R(1.0) : MCK_R(-1.0);
    return up * mck_flow(up * z, mck_abs(c[0] * du), decay(c, up, -up, side),
                         decay(c, up, up, side), (int)c[1]);
}

static mck_real moved(const mck_real *c, const mck_real *state, mck_real u)
{
    const mck_real centre = c[3];
    mck_real z = state[0];
    mck_real before = state[1];
    if ((before - centre) * (u - centre) < MCK_R(0.0)) {
        z = stretch(c, z, centre - before, before > centre ? MCK_R(1.0) : MCK_R(-1.0));
        before = centre;
    }
    return stretch(c, z, u - before,
                   before + u > MCK_R(2.0) * centre ? MCK_R(1.0) : MCK_R(-1.0));
}

static mck_real output(const mck_part *part, int behind, mck_real z, mck_real u)
{
    const mck_real *c = part->coefficients;
    const int size = part->n_coefficients - 11 - behind;
    return mck_horner((u - c[3]) / c[4], size, c + 11) + c[2] * z;
}

static void advance(const mck_real *c, mck_real *state, mck_real u)
{
    state[0] = moved(c, state, u);
    state[1] = u;
}

void mck_generalized_bouc_wen_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    state[0] = part->start == MCK_VIRGIN ? MCK_R(0.0) : MCK_R(1.0);
    state[1] = in[0];
}

void mck_generalized_bouc_wen_step(const mck_part *part, mck_real *state, const mck_real *in,
                                   mck_real *out)
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

void mck_generalized_bouc_wen_inverse_start(const mck_part *part, mck_real *state,
                                            const mck_real *in)
{
    mck_solved_start(mck_generalized_bouc_wen_start, forward_step, part, state, in[0]);
}

void mck_generalized_bouc_wen_inverse_step(const mck_part *part, mck_real *state,
                                           const mck_real *in, mck_real *out)
{
    out[0] = mck_solved_input(trial, part, state, in[0]);
    advance(part->coefficients, state, out[0]);
}
