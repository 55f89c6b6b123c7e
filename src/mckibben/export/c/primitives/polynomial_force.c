#include "polynomial_force.h"

#include "horner.h"

void mck_polynomial_force_step(const mck_part *part, mck_real *state, const mck_real *in,
                               mck_real *out)
{
    const mck_real *c = part->coefficients;
    const int n = (int)c[2];
    const mck_real x = (in[0] - c[0]) / c[1];
    (void)state;
    out[0] = in[1] * mck_horner(x, n, c + 3) +
             mck_horner(x, part->n_coefficients - 3 - n, c + 3 + n);
}
