#include "narx_polynomial.h"

#include "narx.h"

static mck_real sum_of_terms(const mck_part *part, const mck_real *state)
{
    const int head = mck_narx_head(part);
    const int width = (int)part->coefficients[head] + 1;
    const mck_real *terms = part->coefficients + head + 1;
    const int n = (part->n_coefficients - head - 1) / width;
    mck_real y = MCK_R(0.0);
    for (int j = 0; j < n; j++) {
        const mck_real *term = terms + j * width;
        mck_real product = term[0];
        for (int i = 1; i < width && term[i] >= MCK_R(0.0); i++) {
            product *= state[(int)term[i]];
        }
        y += product;
    }
    return y;
}

void mck_narx_polynomial_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    mck_narx_start(sum_of_terms, part, state, in[0]);
}

void mck_narx_polynomial_step(const mck_part *part, mck_real *state, const mck_real *in,
                              mck_real *out)
{
    out[0] = mck_narx_step(sum_of_terms, part, state, in[0]);
}
