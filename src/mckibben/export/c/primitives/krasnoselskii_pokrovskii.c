#include "krasnoselskii_pokrovskii.h"

#include "root.h"

static int intervals(const mck_real *c) { return (int)c[0]; }

static int operators(const mck_real *c) { return intervals(c) * (intervals(c) + 1) / 2; }

/* The ridge that rises from 0 at level i to 1 at level i + 1. */
static mck_real ramp(const mck_real *levels, int i, mck_real u)
{
    return mck_clip((u - levels[i]) / (levels[i + 1] - levels[i]), MCK_R(0.0), MCK_R(1.0));
}

static mck_real output(const mck_real *c, const mck_real *state, mck_real u)
{
    const int n = intervals(c);
    const mck_real *levels = c + 2;
    const mck_real *weights = c + 3 + n;
    mck_real y = c[1];
    int place = 0;
    for (int i = 0; i < n; i++) {
        const mck_real least = ramp(levels, i, u);
        for (int j = 0; j <= i; j++) {
            y += weights[place] * mck_max(least, mck_min(ramp(levels, j, u), state[place]));
            place++;
        }
    }
    return y;
}

static void advance(const mck_real *c, mck_real *state, mck_real u)
{
    const int n = intervals(c);
    const mck_real *levels = c + 2;
    int place = 0;
    for (int i = 0; i < n; i++) {
        const mck_real least = ramp(levels, i, u);
        for (int j = 0; j <= i; j++) {
            state[place] = mck_max(least, mck_min(ramp(levels, j, u), state[place]));
            place++;
        }
    }
    state[place] = u;
}

void mck_krasnoselskii_pokrovskii_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    const mck_real *c = part->coefficients;
    const int n = intervals(c);
    const mck_real *levels = c + 2;
    int place = 0;
    for (int i = 0; i < n; i++) {
        const mck_real least = ramp(levels, i, in[0]);
        for (int j = 0; j <= i; j++) {
            const mck_real most = part->start == MCK_VIRGIN ? ramp(levels, j, in[0]) : least;
            state[place] = MCK_R(0.5) * (least + most);
            place++;
        }
    }
    state[place] = in[0];
}

void mck_krasnoselskii_pokrovskii_step(const mck_part *part, mck_real *state, const mck_real *in,
                                       mck_real *out)
{
    const mck_real *c = part->coefficients;
    const mck_real *weights = c + 3 + intervals(c);
    mck_real y = c[1];
    advance(c, state, in[0]);
    for (int k = 0; k < operators(c); k++) {
        y += weights[k] * state[k];
    }
    out[0] = y;
}

static mck_real trial(const mck_part *part, const mck_real *state, mck_real u)
{
    return output(part->coefficients, state, u);
}

void mck_krasnoselskii_pokrovskii_inverse_start(const mck_part *part, mck_real *state,
                                                const mck_real *in)
{
    mck_solved_start(mck_krasnoselskii_pokrovskii_start, mck_krasnoselskii_pokrovskii_step, part,
                     state, in[0]);
}

void mck_krasnoselskii_pokrovskii_inverse_step(const mck_part *part, mck_real *state,
                                               const mck_real *in, mck_real *out)
{
    out[0] = mck_solved_input(trial, part, state, in[0]);
    advance(part->coefficients, state, out[0]);
}
