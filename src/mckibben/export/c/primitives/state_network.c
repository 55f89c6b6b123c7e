#include "state_network.h"

#define HEAD 9
#define SETTLING 1000

static void rates(const mck_part *part, const mck_real *x, mck_real u, mck_real *found)
{
    const int n = (int)part->coefficients[3];
    const int units = (int)part->coefficients[4];
    const int width = n + 2;
    const mck_real *linear = part->coefficients + HEAD;
    const mck_real *hidden = linear + n * width;
    const mck_real *readout = hidden + units * width;
    for (int i = 0; i < n; i++) {
        const mck_real *row = linear + i * width;
        found[i] = row[n] * u + row[n + 1];
        for (int j = 0; j < n; j++) {
            found[i] += row[j] * x[j];
        }
    }
    for (int h = 0; h < units; h++) {
        const mck_real *row = hidden + h * width;
        mck_real s = row[n] * u + row[n + 1];
        for (int j = 0; j < n; j++) {
            s += row[j] * x[j];
        }
        const mck_real a = mck_tanh(s);
        for (int i = 0; i < n; i++) {
            found[i] += readout[i * units + h] * a;
        }
    }
}

static void advance(const mck_part *part, mck_real *x, mck_real start, mck_real rise, mck_real h)
{
    const int n = (int)part->coefficients[3];
    const mck_real middle = start + MCK_R(0.5) * rise;
    mck_real *at = x + n + 1;
    mck_real *k = at + n;
    mck_real *total = k + n;
    rates(part, x, start, k);
    for (int i = 0; i < n; i++) {
        total[i] = k[i];
        at[i] = x[i] + MCK_R(0.5) * h * k[i];
    }
    rates(part, at, middle, k);
    for (int i = 0; i < n; i++) {
        total[i] += MCK_R(2.0) * k[i];
        at[i] = x[i] + MCK_R(0.5) * h * k[i];
    }
    rates(part, at, middle, k);
    for (int i = 0; i < n; i++) {
        total[i] += MCK_R(2.0) * k[i];
        at[i] = x[i] + h * k[i];
    }
    rates(part, at, start + rise, k);
    for (int i = 0; i < n; i++) {
        x[i] += h / MCK_R(6.0) * (total[i] + k[i]);
    }
}

static mck_real scaled(const mck_part *part, mck_real u)
{
    return (u - part->coefficients[5]) / part->coefficients[6];
}

void mck_state_network_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    const int n = (int)part->coefficients[3];
    for (int k = 0; k < part->n_states; k++) {
        state[k] = MCK_R(0.0);
    }
    if (part->start == MCK_VIRGIN) {
        return;
    }
    for (int k = 0; k < SETTLING; k++) {
        advance(part, state, scaled(part, in[0]), MCK_R(0.0), MCK_R(0.1));
    }
    state[n] = in[0];
}

void mck_state_network_step(const mck_part *part, mck_real *state, const mck_real *in,
                            mck_real *out)
{
    const mck_real *c = part->coefficients;
    const int count = (int)c[1];
    const int n = (int)c[3];
    const mck_real last = scaled(part, state[n]);
    const mck_real now = scaled(part, in[0]);
    const mck_real rise = c[2] > MCK_R(0.0) ? MCK_R(0.0) : (now - last) / (mck_real)count;
    for (int s = 0; s < count; s++) {
        advance(part, state, last + (mck_real)s * rise, rise, c[0]);
    }
    state[n] = in[0];
    out[0] = c[7] + c[8] * state[0];
}
