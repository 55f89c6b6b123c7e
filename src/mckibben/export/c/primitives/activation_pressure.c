#include "activation_pressure.h"

/* A cubic, highest power first. */
static mck_real cubic(const mck_real *c, mck_real x)
{
    return ((c[0] * x + c[1]) * x + c[2]) * x + c[3];
}

void mck_activation_pressure_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    (void)part;
    state[0] = in[0];
    state[1] = MCK_R(0.0);
}

void mck_activation_pressure_step(const mck_part *part, mck_real *state, const mck_real *in,
                                  mck_real *out)
{
    const mck_real *c = part->coefficients;
    const mck_real *contractions = c + 7;
    const mck_real *pressures = c + 23;
    const mck_real e = in[0];
    const mck_real force = in[1];
    const mck_real rate = c[0] * state[1] + c[1] * (e - state[0]);
    mck_real y = MCK_R(0.0);
    for (int j = 0; j < 4; j++) {
        const mck_real own = cubic(contractions + 4 * j, force);
        mck_real share = MCK_R(1.0);
        for (int k = 0; k < 4; k++) {
            if (k != j) {
                const mck_real other = cubic(contractions + 4 * k, force);
                share *= (e - other) / (own - other);
            }
        }
        y += share * cubic(pressures + 4 * j, force);
    }
    out[0] = y + c[2] * cubic(c + 3, force) * rate;
    state[0] = e;
    state[1] = rate;
}
