#include "negative.h"

void mck_negative_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out)
{
    (void)part;
    (void)state;
    out[0] = -in[0];
}
