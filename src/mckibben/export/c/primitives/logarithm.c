#include "logarithm.h"

#define BEND MCK_R(0.05)

void mck_logarithm_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out)
{
    const mck_real x = in[0] + part->coefficients[0];
    (void)state;
    out[0] = x > BEND ? mck_log(x) : mck_log(BEND) + (x - BEND) / BEND;
}
