#include "rate_dependent_pi.h"

#include "operators.h"
#include "root.h"

static mck_real rate_at(const mck_real *c, int n, const mck_real *state, mck_real u)
{
    return c[0] * state[n + 1] + c[1] * (u - state[n]);
}

static mck_real output(const mck_real *c, int n, const mck_real *state, mck_real u)
{
    const mck_real *r = c + 3;
    const mck_real *by_rate = r + n;
    const mck_real *at_rest = by_rate + n;
    const mck_real rate = rate_at(c, n, state, u);
    mck_real y = c[2];
    for (int i = 0; i < n; i++) {
        y += (at_rest[i] + rate * by_rate[i]) * mck_play(state[i], u, r[i]);
    }
    return y;
}

static void advance(const mck_real *c, int n, mck_real *state, mck_real u)
{
    const mck_real rate = rate_at(c, n, state, u);
    for (int i = 0; i < n; i++) {
        state[i] = mck_play(state[i], u, c[3 + i]);
    }
    state[n] = u;
    state[n + 1] = rate;
}

void mck_rate_dependent_pi_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    const int n = part->n_states - 2;
    mck_operators_start(part->start, n, part->coefficients + 3, in[0], in[0], state);
    state[n] = in[0];
    state[n + 1] = MCK_R(0.0);
}

void mck_rate_dependent_pi_step(const mck_part *part, mck_real *state, const mck_real *in,
                                mck_real *out)
{
    const int n = part->n_states - 2;
    out[0] = output(part->coefficients, n, state, in[0]);
    advance(part->coefficients, n, state, in[0]);
}

static mck_real trial(const mck_part *part, const mck_real *state, mck_real u)
{
    return output(part->coefficients, part->n_states - 3, state, u);
}

/* At rest, as after inputs that have only risen. */
void mck_rate_dependent_pi_inverse_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    const int n = part->n_states - 3;
    const mck_real *c = part->coefficients;
    const mck_real *r = c + 3;
    const mck_real *at_rest = r + 2 * n;
    mck_real risen = in[0] - c[2];
    mck_real slope = MCK_R(0.0);
    for (int i = 0; i < n; i++) {
        risen += at_rest[i] * r[i];
        slope += at_rest[i];
    }
    const mck_real lowest = c[part->n_coefficients - 2];
    const mck_real highest = c[part->n_coefficients - 1];
    const mck_real u = mck_clip(risen / slope, lowest, highest);
    for (int i = 0; i < n; i++) {
        state[i] = u - r[i];
    }
    state[n] = u;
    state[n + 1] = MCK_R(0.0);
    state[n + 2] = MCK_R(0.0);
}

void mck_rate_dependent_pi_inverse_step(const mck_part *part, mck_real *state, const mck_real *in,
                                        mck_real *out)
{
    const int n = part->n_states - 3;
    const mck_real *c = part->coefficients;
    int clipped = 0;
    const mck_real u = mck_solve_near(trial, part, state, in[0], state[n],
                                      c[part->n_coefficients - 2], c[part->n_coefficients - 1],
                                      &clipped);
    advance(c, n, state, u);
    if (clipped) {
        state[n + 2] += MCK_R(1.0);
    }
    out[0] = u;
}
