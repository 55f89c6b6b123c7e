#include "coupled_memory.h"

void mck_coupled_memory_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    const mck_real *c = part->coefficients;
    const int n = part->n_inputs;
    const int lags = (int)c[0];
    const int m = (int)c[1];
    const mck_real *r = c + 3 + lags;
    for (int lag = 0; lag < lags; lag++) {
        for (int i = 0; i < n; i++) {
            const int place = lag * n + i;
            const mck_real x = part->start == MCK_VIRGIN ? MCK_R(0.0) : in[i];
            state[place] = x;
            for (int k = 0; k < m; k++) {
                state[lags * n + place * m + k] = mck_play(MCK_R(0.0), x, r[i * m + k]);
            }
        }
    }
}

void mck_coupled_memory_step(const mck_part *part, mck_real *state, const mck_real *in,
                             mck_real *out)
{
    const mck_real *c = part->coefficients;
    const int n = part->n_inputs;
    const int lags = (int)c[0];
    const int m = (int)c[1];
    const int degree = (int)c[2];
    const mck_real *decays = c + 3;
    const mck_real *r = decays + lags;
    const mck_real *readout = r + n * m;
    for (int lag = 0; lag < lags; lag++) {
        for (int i = 0; i < n; i++) {
            const int place = lag * n + i;
            mck_real *plays = state + lags * n + place * m;
            state[place] += (MCK_R(1.0) - decays[lag]) * (in[i] - state[place]);
            for (int k = 0; k < m; k++) {
                plays[k] = mck_play(plays[k], state[place], r[i * m + k]);
            }
        }
    }
    for (int j = 0; j < part->n_outputs; j++) {
        mck_real total = *readout++;
        for (int place = 0; place < part->n_states; place++) {
            total += *readout++ * state[place];
        }
        for (int i = 0; degree >= 2 && i < n; i++) {
            for (int k = i; k < n; k++) {
                total += *readout++ * state[i] * state[k];
            }
        }
        for (int i = 0; degree >= 3 && i < n; i++) {
            for (int k = i; k < n; k++) {
                for (int q = k; q < n; q++) {
                    total += *readout++ * state[i] * state[k] * state[q];
                }
            }
        }
        out[j] = total;
    }
}
