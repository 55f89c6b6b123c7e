#include "pi.h"

#include "operators.h"

void mck_pi_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    const mck_real *thresholds = part->coefficients + 1;
    mck_operators_start(part->start, part->n_states, thresholds, in[0], in[0], state);
}

void mck_pi_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out)
{
    const int n = part->n_states;
    const mck_real offset = part->coefficients[0];
    const mck_real *r = part->coefficients + 1;
    const mck_real *w = r + n;
    mck_real y = MCK_R(0.0);
    for (int i = 0; i < n; i++) {
        state[i] = mck_play(state[i], in[0], r[i]);
        y += w[i] * state[i];
    }
    out[0] = offset + y;
}

void mck_pi_inverse_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    const int n = part->n_states - 2;
    const mck_real lowest = part->coefficients[0];
    const mck_real highest = part->coefficients[1];
    const mck_real offset = part->coefficients[2];
    const mck_real *r = part->coefficients + 3;
    const mck_real *w = r + n;
    if (part->start == MCK_VIRGIN) {
        mck_solve_from_rest(n, in[0] - offset, lowest, highest, r, w, state);
    } else {
        mck_real risen = MCK_R(0.0);
        mck_real slope = MCK_R(0.0);
        for (int i = 0; i < n; i++) {
            risen += w[i] * r[i];
            slope += w[i];
        }
        const mck_real u = mck_clip((in[0] - offset + risen) / slope, lowest, highest);
        for (int i = 0; i < n; i++) {
            state[i] = u - r[i];
        }
    }
    state[n] = in[0];
    state[n + 1] = MCK_R(0.0);
}

void mck_pi_inverse_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out)
{
    const int n = part->n_states - 2;
    const mck_real lowest = part->coefficients[0];
    const mck_real highest = part->coefficients[1];
    const mck_real offset = part->coefficients[2];
    const mck_real *r = part->coefficients + 3;
    const mck_real *w = r + n;
    int clipped = 0;
    (void)mck_follow(n, in[0] - offset, state[n] - offset, lowest, highest, r, w, state, &clipped);
    if (clipped) {
        state[n + 1] += MCK_R(1.0);
    }
    state[n] = in[0];
    out[0] = state[0];
}
