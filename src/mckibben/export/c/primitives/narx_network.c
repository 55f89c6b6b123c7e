#include "narx_network.h"

#include "narx.h"

static mck_real network(const mck_part *part, const mck_real *state)
{
    const mck_real *c = part->coefficients + mck_narx_head(part);
    const int n = (int)c[0];
    const int units = (int)c[1];
    const int wavelets = c[2] > MCK_R(0.0);
    const mck_real *places = c + 3;
    const mck_real *linear = places + n;
    const mck_real *hidden = linear + 1 + n;
    mck_real y = linear[0];
    for (int i = 0; i < n; i++) {
        y += linear[1 + i] * state[(int)places[i]];
    }
    for (int h = 0; h < units; h++) {
        const mck_real *unit = hidden + h * (n + 2);
        mck_real s = unit[n];
        for (int i = 0; i < n; i++) {
            s += unit[i] * state[(int)places[i]];
        }
        const mck_real a = wavelets ? (MCK_R(1.0) - s * s) * mck_exp(MCK_R(-0.5) * s * s)
                                    : mck_tanh(s);
        y += unit[n + 1] * a;
    }
    return y;
}

void mck_narx_network_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    mck_narx_start(network, part, state, in[0]);
}

void mck_narx_network_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out)
{
    out[0] = mck_narx_step(network, part, state, in[0]);
}
