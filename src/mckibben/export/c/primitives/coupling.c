#include "coupling.h"

void mck_coupling_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out)
{
    const int n = part->n_inputs;
    (void)state;
    for (int j = 0; j < part->n_outputs; j++) {
        mck_real total = MCK_R(0.0);
        for (int i = 0; i < n; i++) {
            total += part->coefficients[j * n + i] * in[i];
        }
        out[j] = total;
    }
}
