#include "contact.h"

#define LOST MCK_R(0.95) /* share of the smallest pressures that does not act */
#define MOST_STEPS 60
#define SETTLED MCK_EITHER(1e-16, 1e-7)

void mck_contact_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out)
{
    const mck_real c = part->coefficients[0];
    const mck_real lost = LOST * c * (MCK_R(1.0) - mck_exp(-mck_abs(in[0]) / c));
    (void)state;
    out[0] = in[0] >= MCK_R(0.0) ? in[0] - lost : in[0] + lost;
}

void mck_contact_inverse_step(const mck_part *part, mck_real *state, const mck_real *in,
                              mck_real *out)
{
    const mck_real c = part->coefficients[0];
    const mck_real goal = mck_abs(in[0]);
    mck_real u = goal + LOST * c;
    int settled = 0;
    (void)state;
    for (int k = 0; k < MOST_STEPS && !settled; k++) {
        const mck_real faded = LOST * mck_exp(-u / c);
        const mck_real step = (u - c * (LOST - faded) - goal) / (MCK_R(1.0) - faded);
        u -= step;
        settled = step <= SETTLED * u;
    }
    u = mck_max(u, MCK_R(0.0));
    out[0] = in[0] >= MCK_R(0.0) ? u : -u;
}
