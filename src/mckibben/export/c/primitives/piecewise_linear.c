#include "piecewise_linear.h"

#include "interpolation.h"

void mck_piecewise_linear_step(const mck_part *part, mck_real *state, const mck_real *in,
                               mck_real *out)
{
    const int n = part->n_coefficients / 2;
    (void)state;
    out[0] = mck_interpolate(in[0], n, part->coefficients, part->coefficients + n);
}
