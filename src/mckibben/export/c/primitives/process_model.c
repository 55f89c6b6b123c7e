#include "process_model.h"

void mck_process_model_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    const int n = (int)part->coefficients[0];
    const mck_real u = part->start == MCK_VIRGIN ? MCK_R(0.0) : in[0] - part->coefficients[2];
    for (int k = 0; k < part->n_states; k++) {
        state[k] = MCK_R(0.0);
    }
    state[0] = u;
    for (int k = n; k < part->n_states - n; k++) {
        state[k] = u;
    }
}

void mck_process_model_step(const mck_part *part, mck_real *state, const mck_real *in,
                            mck_real *out)
{
    const int n = (int)part->coefficients[0];
    const int delay = (int)part->coefficients[1];
    const int kept = part->n_states - 2 * n;
    const mck_real *c = part->coefficients + 6;
    const mck_real *transition = c + 4 * n;
    mck_real *past = state + n;
    mck_real *next = past + kept;
    for (int k = kept - 1; k > 0; k--) {
        past[k] = past[k - 1];
    }
    past[0] = in[0] - part->coefficients[2];
    const mck_real first = past[delay];
    const mck_real second = past[delay + 1];
    const mck_real third = past[delay + 2];
    mck_real y = part->coefficients[4] * first + part->coefficients[5] * second;
    for (int i = 0; i < n; i++) {
        mck_real x = c[n + i] * first + c[2 * n + i] * second + c[3 * n + i] * third;
        for (int j = 0; j < n; j++) {
            x += transition[i * n + j] * state[j];
        }
        next[i] = x;
        y += c[i] * x;
    }
    for (int i = 0; i < n; i++) {
        state[i] = next[i];
    }
    out[0] = y + part->coefficients[3];
}
