#include "duhem_oscillator.h"

#include "oscillator.h"

static mck_real slope(const mck_real *numbers, int size, mck_real z, mck_real velocity)
{
    const int n = size / 3;
    int j = 0;
    while (j < n - 2 && z >= numbers[j + 1]) {
        j++;
    }
    const mck_real way = (z - numbers[j]) / (numbers[j + 1] - numbers[j]);
    const mck_real inside = mck_clip(way, MCK_R(0.0), MCK_R(1.0));
    const mck_real *at = numbers + j + (velocity > MCK_R(0.0) ? n : 2 * n);
    return at[0] + inside * (at[1] - at[0]);
}

void mck_duhem_oscillator_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    mck_oscillator_start(slope, part, state, in[0]);
}

void mck_duhem_oscillator_step(const mck_part *part, mck_real *state, const mck_real *in,
                              mck_real *out)
{
    mck_oscillator_step(slope, part, state, in[0], out);
}
