#include "exponential.h"

#define BEND MCK_R(0.05)

void mck_exponential_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out)
{
    const mck_real bend = mck_log(BEND);
    (void)state;
    out[0] = (in[0] > bend ? mck_exp(in[0]) : BEND + (in[0] - bend) * BEND) - part->coefficients[0];
}
