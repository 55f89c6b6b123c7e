#include "bouc_wen_oscillator.h"

#include "oscillator.h"

static mck_real slope(const mck_real *numbers, int size, mck_real z, mck_real velocity)
{
    const mck_real along = velocity > MCK_R(0.0) ? z : -z;
    (void)size;
    return numbers[0] - numbers[1] * along - numbers[2] * mck_abs(z);
}

void mck_bouc_wen_oscillator_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    mck_oscillator_start(slope, part, state, in[0]);
}

void mck_bouc_wen_oscillator_step(const mck_part *part, mck_real *state, const mck_real *in,
                              mck_real *out)
{
    mck_oscillator_step(slope, part, state, in[0], out);
}
