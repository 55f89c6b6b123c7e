#include "tondu_lopez.h"

void mck_tondu_lopez_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out)
{
    const mck_real *c = part->coefficients;
    const mck_real e = MCK_R(1.0) - in[0] / c[0];
    const mck_real p = in[1];
    const mck_real mu = c[4] * mck_exp(MCK_R(-40.0) * e) + c[5];
    const mck_real rest = MCK_R(1.0) - (c[6] * mck_exp(-p) + c[7]) * e;
    (void)state;
    out[0] = mu * c[1] * p * (c[2] * rest * rest - c[3]) + c[8];
}
