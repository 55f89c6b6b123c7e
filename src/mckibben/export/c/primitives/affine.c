#include "affine.h"

void mck_affine_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out)
{
    (void)state;
    out[0] = part->coefficients[0] * in[0] + part->coefficients[1];
}
