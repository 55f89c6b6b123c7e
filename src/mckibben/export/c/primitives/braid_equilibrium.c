#include "braid_equilibrium.h"

#define MOST_STEPS 200
#define STILL MCK_EITHER(1e-16, 1e-8)

static mck_real pull_at(const mck_real *c, mck_real e)
{
    const mck_real left = MCK_R(1.0) - e;
    return c[3] * (c[4] * (left * left) - c[5]);
}

/* The pressure at which the muscle rests at a contraction. */
static mck_real balance(const mck_real *c, mck_real e)
{
    return (c[0] + e * (c[1] + c[2] * e * e)) / pull_at(c, e);
}

static mck_real contraction_at(const mck_real *c, mck_real p)
{
    mck_real low = c[6];
    mck_real high = c[7];
    mck_real e = mck_clip(MCK_R(0.0), low, high);
    if (p <= balance(c, low)) {
        return low;
    }
    if (p >= balance(c, high)) {
        return high;
    }
    for (int step = 0; step < MOST_STEPS; step++) {
        const mck_real error = balance(c, e) - p;
        if (error > MCK_R(0.0)) {
            high = e;
        } else if (error < MCK_R(0.0)) {
            low = e;
        } else {
            break;
        }
        const mck_real slope = (c[1] + MCK_R(3.0) * c[2] * e * e +
                                (error + p) * MCK_R(2.0) * c[3] * c[4] * (MCK_R(1.0) - e)) /
                               pull_at(c, e);
        mck_real candidate = slope > MCK_R(0.0) ? e - error / slope : low;
        if (!(low < candidate && candidate < high)) {
            candidate = MCK_R(0.5) * (low + high);
        }
        if (mck_abs(candidate - e) <= STILL || candidate <= low || candidate >= high) {
            break;
        }
        e = candidate;
    }
    return e;
}

void mck_braid_equilibrium_step(const mck_part *part, mck_real *state, const mck_real *in,
                                mck_real *out)
{
    const mck_real *c = part->coefficients;
    (void)state;
    out[0] = c[8] * contraction_at(c, in[0]) + c[9];
}

void mck_braid_equilibrium_inverse_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    (void)part;
    (void)in;
    state[0] = MCK_R(0.0);
}

void mck_braid_equilibrium_inverse_step(const mck_part *part, mck_real *state, const mck_real *in,
                                        mck_real *out)
{
    const mck_real *c = part->coefficients;
    const mck_real e = (in[0] - c[9]) / c[8];
    const mck_real inside = mck_clip(e, c[6], c[7]);
    if (mck_abs(e - inside) > MCK_SLACK) {
        state[0] += MCK_R(1.0);
    }
    out[0] = balance(c, inside);
}
