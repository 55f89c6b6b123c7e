#include "polynomial.h"

#include "horner.h"

#define MOST_STEPS 200

void mck_polynomial_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out)
{
    const mck_real *c = part->coefficients;
    (void)state;
    out[0] = mck_horner((in[0] - c[0]) / c[1], part->n_coefficients - 2, c + 2);
}

void mck_polynomial_inverse_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    (void)part;
    (void)in;
    state[0] = MCK_R(0.0);
}

void mck_polynomial_inverse_step(const mck_part *part, mck_real *state, const mck_real *in,
                                 mck_real *out)
{
    const mck_real centre = part->coefficients[0];
    const mck_real scale = part->coefficients[1];
    const mck_real *c = part->coefficients + 4;
    const int n = part->n_coefficients - 4;
    mck_real low = part->coefficients[2];
    mck_real high = part->coefficients[3];
    const mck_real bottom = mck_horner(low, n, c);
    const mck_real top = mck_horner(high, n, c);
    const mck_real slack = MCK_SLACK * (top - bottom);
    const mck_real y = in[0];
    if (!(bottom < y && y < top)) {
        if (y < bottom - slack || y > top + slack) {
            state[0] += MCK_R(1.0);
        }
        out[0] = centre + scale * (y <= bottom ? low : high);
        return;
    }
    mck_real x = MCK_R(0.5) * (low + high);
    for (int step = 0; step < MOST_STEPS; step++) {
        const mck_real error = mck_horner(x, n, c) - y;
        if (error > MCK_R(0.0)) {
            high = x;
        } else if (error < MCK_R(0.0)) {
            low = x;
        } else {
            break;
        }
        mck_real slope = MCK_R(0.0);
        for (int k = n - 1; k > 0; k--) {
            slope = slope * x + (mck_real)k * c[k];
        }
        mck_real candidate = slope > MCK_R(0.0) ? x - error / slope : low;
        if (!(low < candidate && candidate < high)) {
            candidate = MCK_R(0.5) * (low + high);
        }
        if (!(candidate < x || candidate > x) || candidate <= low || candidate >= high) {
            break;
        }
        x = candidate;
    }
    out[0] = centre + scale * x;
}
