#include "oscillator.h"

#define HEAD 7
#define SETTLING 64

/* The share of the input that the element takes in slow motion. */
static mck_real share(mck_slope *slope, const mck_part *part, mck_real u, mck_real z)
{
    const mck_real *c = part->coefficients;
    const mck_real f = slope(c + HEAD, part->n_coefficients - HEAD, z, u);
    return f / (c[5] + f);
}

void mck_oscillator_start(mck_slope *slope, const mck_part *part, mck_real *state, mck_real u)
{
    mck_real z = MCK_R(0.0);
    state[0] = MCK_R(0.0);
    state[1] = MCK_R(0.0);
    state[2] = MCK_R(0.0);
    state[3] = MCK_R(0.0);
    if (part->start == MCK_VIRGIN) {
        return;
    }
    const mck_real step = u / MCK_R(64.0);
    for (int i = 0; i < SETTLING; i++) {
        const mck_real k1 = share(slope, part, u, z);
        const mck_real k2 = share(slope, part, u, z + MCK_R(0.5) * step * k1);
        const mck_real k3 = share(slope, part, u, z + MCK_R(0.5) * step * k2);
        const mck_real k4 = share(slope, part, u, z + step * k3);
        z += step / MCK_R(6.0) * (k1 + MCK_R(2.0) * k2 + MCK_R(2.0) * k3 + k4);
    }
    state[0] = (u - z) / part->coefficients[5];
    state[2] = z;
    state[3] = u;
}

void mck_oscillator_step(mck_slope *slope, const mck_part *part, mck_real *state, mck_real u,
                         mck_real *out)
{
    const mck_real *c = part->coefficients;
    const mck_real *own = c + HEAD;
    const int size = part->n_coefficients - HEAD;
    const mck_real h = c[0];
    const mck_real half = MCK_R(0.5) * h;
    const mck_real sixth = h / MCK_R(6.0);
    const int n = (int)c[1];
    const mck_real rise = c[2] > MCK_R(0.0) ? MCK_R(0.0) : (u - state[3]) / (mck_real)n;
    mck_real y = state[0];
    mck_real v = state[1];
    mck_real z = state[2];
    for (int s = 0; s < n; s++) {
        const mck_real at = state[3] + (mck_real)s * rise;
        const mck_real middle = at + MCK_R(0.5) * rise;
        const mck_real end = middle + MCK_R(0.5) * rise;
        const mck_real v1 = v;
        const mck_real a1 = (at - c[4] * v1 - c[5] * y - z) / c[3];
        const mck_real z1 = v1 * slope(own, size, z, v1);
        const mck_real v2 = v + half * a1;
        const mck_real x2 = z + half * z1;
        const mck_real a2 = (middle - c[4] * v2 - c[5] * (y + half * v1) - x2) / c[3];
        const mck_real z2 = v2 * slope(own, size, x2, v2);
        const mck_real v3 = v + half * a2;
        const mck_real x3 = z + half * z2;
        const mck_real a3 = (middle - c[4] * v3 - c[5] * (y + half * v2) - x3) / c[3];
        const mck_real z3 = v3 * slope(own, size, x3, v3);
        const mck_real v4 = v + h * a3;
        const mck_real x4 = z + h * z3;
        const mck_real a4 = (end - c[4] * v4 - c[5] * (y + h * v3) - x4) / c[3];
        const mck_real z4 = v4 * slope(own, size, x4, v4);
        y += sixth * (v1 + MCK_R(2.0) * v2 + MCK_R(2.0) * v3 + v4);
        v += sixth * (a1 + MCK_R(2.0) * a2 + MCK_R(2.0) * a3 + a4);
        z += sixth * (z1 + MCK_R(2.0) * z2 + MCK_R(2.0) * z3 + z4);
    }
    state[0] = y;
    state[1] = v;
    state[2] = z;
    state[3] = u;
    out[0] = y + c[6];
}
