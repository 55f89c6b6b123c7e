#include "activation_memory.h"

#include "operators.h"

static int relaxations(const mck_part *part) { return (int)part->coefficients[8]; }

static int operators(const mck_part *part) { return part->n_states - 2 - relaxations(part); }

static const mck_real *thresholds_of(const mck_part *part)
{
    const mck_real *c = part->coefficients;
    return c + 9 + ((int)c[6] + 1) * ((int)c[7] + 1);
}

void mck_activation_memory_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    const mck_real *c = part->coefficients;
    const int n = operators(part);
    for (int k = 0; k < n; k++) {
        state[k] = part->start == MCK_VIRGIN ? in[0] : in[0] - thresholds_of(part)[k];
    }
    state[n] = in[0];
    state[n + 1] = MCK_R(0.0);
    for (int k = 0; k < relaxations(part); k++) {
        state[n + 2 + k] = (in[0] - c[2]) / c[3];
    }
}

void mck_activation_memory_step(const mck_part *part, mck_real *state, const mck_real *in,
                                mck_real *out)
{
    const mck_real *c = part->coefficients;
    const int m = relaxations(part);
    const int n = operators(part);
    const int degree = (int)c[6];
    const int by_force = (int)c[7];
    const mck_real *surface = c + 9;
    const mck_real *r = thresholds_of(part);
    const mck_real *friction = r + n;
    const mck_real *viscosity = friction + 2 * n;
    const mck_real *relaxing = viscosity + 2;
    const mck_real *decays = relaxing + 2 * m;
    const mck_real e = in[0];
    const mck_real x = (e - c[2]) / c[3];
    const mck_real f = (in[1] - c[4]) / c[5];
    const mck_real rate = c[0] * state[n + 1] + c[1] * (e - state[n]);
    mck_real p = MCK_R(0.0);
    for (int i = degree; i >= 0; i--) {
        mck_real row = MCK_R(0.0);
        for (int j = by_force; j >= 0; j--) {
            row = row * f + surface[i * (by_force + 1) + j];
        }
        p = p * x + row;
    }
    for (int k = 0; k < n; k++) {
        state[k] = mck_play(state[k], e, r[k]);
        p += (friction[k] + f * friction[n + k]) * (e - state[k]);
    }
    p += (viscosity[0] + f * viscosity[1]) * rate;
    for (int k = 0; k < m; k++) {
        mck_real *follower = state + n + 2 + k;
        *follower = decays[k] * *follower + (MCK_R(1.0) - decays[k]) * x;
        p += (relaxing[k] + f * relaxing[m + k]) * (*follower - x);
    }
    state[n] = e;
    state[n + 1] = rate;
    out[0] = p;
}
