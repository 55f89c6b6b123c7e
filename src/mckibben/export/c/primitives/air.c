#include "air.h"

static mck_real goal(const mck_real *c, mck_real u, mck_real offset)
{
    return mck_clip(c[0] * (u - offset), c[5], c[6]);
}

static mck_real moved(const mck_real *c, mck_real x, mck_real u)
{
    const mck_real filling = goal(c, u, c[1]);
    const mck_real venting = goal(c, u, c[2]);
    mck_real next = x;
    if (filling > x) {
        next = x + c[3] * (filling - x);
    } else if (venting < x) {
        next = x + c[4] * (venting - x);
    }
    return next;
}

static mck_real middle(const mck_real *c) { return MCK_R(0.5) * (c[1] + c[2]); }

/* At the ambient pressure, or 0 where that is no limit. */
static mck_real empty(const mck_real *c)
{
    return c[5] > -MCK_INFINITY ? c[5] : MCK_R(0.0);
}

void mck_air_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    const mck_real *c = part->coefficients;
    const mck_real x = part->start == MCK_VIRGIN ? empty(c) : goal(c, in[0], middle(c));
    for (int k = 0; k < part->n_states; k++) {
        state[k] = x;
    }
}

void mck_air_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out)
{
    const int late = (int)part->coefficients[7];
    state[0] = moved(part->coefficients, state[0], in[0]);
    out[0] = state[late];
    for (int k = late; k > 0; k--) {
        state[k] = state[k - 1];
    }
}

void mck_air_inverse_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    const mck_real *c = part->coefficients;
    const mck_real u = mck_clip(in[0] / c[0] + middle(c), c[8], c[9]);
    state[0] = part->start == MCK_VIRGIN ? empty(c) : goal(c, u, middle(c));
    state[1] = MCK_R(0.0);
}

void mck_air_inverse_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out)
{
    const mck_real *c = part->coefficients;
    const mck_real x = state[0];
    const mck_real held = MCK_ROUNDING * (mck_abs(in[0]) + c[0] * mck_abs(middle(c)));
    mck_real wanted = in[0];
    mck_real u = x / c[0] + middle(c);
    if (wanted > x + held) {
        u = mck_min(x + (wanted - x) / c[3], c[6]) / c[0] + c[1];
    } else if (wanted < x - held) {
        u = mck_max(x + (wanted - x) / c[4], c[5]) / c[0] + c[2];
    } else {
        wanted = x;
    }
    u = mck_clip(u, c[8], c[9]);
    const mck_real reached = moved(c, x, u);
    if (mck_abs(reached - wanted) > MCK_SLACK * (mck_abs(wanted) + c[0] * mck_abs(u))) {
        state[1] += MCK_R(1.0);
        state[0] = reached;
    } else {
        state[0] = wanted;
    }
    out[0] = u;
}
