#include "chou_hannaford.h"

void mck_chou_hannaford_step(const mck_part *part, mck_real *state, const mck_real *in,
                             mck_real *out)
{
    const mck_real *c = part->coefficients;
    (void)state;
    out[0] = in[1] * c[0] * (in[0] * in[0] - c[1]) + c[2];
}
