#include "duhem.h"

#include "horner.h"
#include "root.h"

/* Size of each of the three curves; `behind` numbers follow them. */
static int size(const mck_part *part, int behind) { return (part->n_coefficients - 3 - behind) / 3; }

static void start(const mck_part *part, int behind, mck_real *state, mck_real u)
{
    const mck_real *c = part->coefficients;
    const int n = size(part, behind);
    const mck_real *curve = part->start == MCK_VIRGIN ? c + 3 + 2 * n : c + 3;
    state[0] = mck_horner((u - c[1]) / c[2], n, curve);
    state[1] = u;
}

/* The output after the input has gone on to u. */
static mck_real moved(const mck_part *part, int behind, const mck_real *state, mck_real u)
{
    const mck_real *c = part->coefficients;
    const int n = size(part, behind);
    const mck_real before = state[1];
    if (!(u < before) && !(u > before)) {
        return state[0];
    }
    const mck_real *curve = u > before ? c + 3 : c + 3 + n;
    const mck_real x = (u - c[1]) / c[2];
    const mck_real x0 = (before - c[1]) / c[2];
    const mck_real kept = mck_exp(-c[0] * mck_abs(x - x0));
    return mck_horner(x, n, curve) + (state[0] - mck_horner(x0, n, curve)) * kept;
}

static void advance(const mck_part *part, int behind, mck_real *state, mck_real u)
{
    state[0] = moved(part, behind, state, u);
    state[1] = u;
}

void mck_duhem_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    start(part, 0, state, in[0]);
}

void mck_duhem_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out)
{
    advance(part, 0, state, in[0]);
    out[0] = state[0];
}

static mck_real trial(const mck_part *part, const mck_real *state, mck_real u)
{
    return moved(part, 2, state, u);
}

static void forward_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    start(part, 2, state, in[0]);
}

static void forward_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out)
{
    advance(part, 2, state, in[0]);
    out[0] = state[0];
}

void mck_duhem_inverse_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    mck_solved_start(forward_start, forward_step, part, state, in[0]);
}

void mck_duhem_inverse_step(const mck_part *part, mck_real *state, const mck_real *in,
                            mck_real *out)
{
    out[0] = mck_solved_input(trial, part, state, in[0]);
    advance(part, 2, state, out[0]);
}
