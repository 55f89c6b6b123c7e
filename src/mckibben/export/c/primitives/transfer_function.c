#include "transfer_function.h"

void mck_transfer_function_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    const int n = part->n_states;
    const mck_real *at_rest = part->coefficients + 4 + 2 * n;
    const mck_real u = in[0] - part->coefficients[0];
    for (int i = 0; i < n; i++) {
        state[i] = part->start == MCK_VIRGIN ? MCK_R(0.0) : at_rest[i] * u;
    }
}

void mck_transfer_function_step(const mck_part *part, mck_real *state, const mck_real *in,
                                mck_real *out)
{
    const int n = part->n_states;
    const mck_real *b = part->coefficients + 2;
    const mck_real *f = b + n + 1;
    const mck_real u = in[0] - part->coefficients[0];
    mck_real y = b[0] * u;
    if (n > 0) {
        y += state[0];
    }
    for (int i = 0; i + 1 < n; i++) {
        state[i] = state[i + 1] + b[i + 1] * u - f[i + 1] * y;
    }
    if (n > 0) {
        state[n - 1] = b[n] * u - f[n] * y;
    }
    out[0] = y + part->coefficients[1];
}
