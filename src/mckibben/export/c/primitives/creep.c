#include "creep.h"

static void fill(mck_real *state, int n, mck_real value)
{
    for (int k = 0; k < n; k++) {
        state[k] = value;
    }
}

static void follow(const mck_part *part, mck_real *state, mck_real u)
{
    for (int k = 0; k < part->n_states; k++) {
        const mck_real decay = part->coefficients[k];
        state[k] = decay * state[k] + (MCK_R(1.0) - decay) * u;
    }
}

void mck_creep_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    fill(state, part->n_states, part->start == MCK_VIRGIN ? MCK_R(0.0) : in[0]);
}

void mck_creep_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out)
{
    const mck_real *compliances = part->coefficients + part->n_states;
    mck_real y = in[0];
    follow(part, state, in[0]);
    for (int k = 0; k < part->n_states; k++) {
        y += compliances[k] * state[k];
    }
    out[0] = y;
}

void mck_creep_inverse_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    const mck_real *compliances = part->coefficients + part->n_states;
    mck_real gain = MCK_R(1.0);
    for (int k = 0; k < part->n_states; k++) {
        gain += compliances[k];
    }
    fill(state, part->n_states, part->start == MCK_VIRGIN ? MCK_R(0.0) : in[0] / gain);
}

void mck_creep_inverse_step(const mck_part *part, mck_real *state, const mck_real *in,
                            mck_real *out)
{
    const mck_real *decays = part->coefficients;
    const mck_real *compliances = decays + part->n_states;
    mck_real gain = MCK_R(1.0);
    mck_real rest = in[0];
    for (int k = 0; k < part->n_states; k++) {
        gain += compliances[k] * (MCK_R(1.0) - decays[k]);
        rest -= compliances[k] * decays[k] * state[k];
    }
    out[0] = rest / gain;
    follow(part, state, out[0]);
}
