#include "eupi.h"

#include "operators.h"
#include "root.h"

/* An operator with edges of different slopes. */
static mck_real moved(const mck_real *c, mck_real s, mck_real x, mck_real r)
{
    return mck_max(mck_min(s, c[1] * x + c[2] * r), x - r);
}

static mck_real cubic(const mck_real *c, mck_real x)
{
    return ((c[6] * x + c[5]) * x + c[4]) * x;
}

static void start(int rule, const mck_real *c, int n, mck_real *state, mck_real u)
{
    const mck_real x = u - c[0];
    mck_operators_start(rule, n, c + 7, x, x, state);
}

static mck_real output(const mck_real *c, int n, const mck_real *state, mck_real u)
{
    const mck_real x = u - c[0];
    mck_real y = c[3] + cubic(c, x);
    for (int i = 0; i < n; i++) {
        y += c[7 + n + i] * moved(c, state[i], x, c[7 + i]);
    }
    return y;
}

static void advance(const mck_real *c, int n, mck_real *state, mck_real u)
{
    for (int i = 0; i < n; i++) {
        state[i] = moved(c, state[i], u - c[0], c[7 + i]);
    }
}

void mck_eupi_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    start(part->start, part->coefficients, part->n_states, state, in[0]);
}

void mck_eupi_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out)
{
    advance(part->coefficients, part->n_states, state, in[0]);
    out[0] = output(part->coefficients, part->n_states, state, in[0]);
}

static mck_real trial(const mck_part *part, const mck_real *state, mck_real u)
{
    return output(part->coefficients, part->n_states - 2, state, u);
}

static void forward_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    start(part->start, part->coefficients, part->n_states - 2, state, in[0]);
}

static void forward_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out)
{
    advance(part->coefficients, part->n_states - 2, state, in[0]);
    out[0] = trial(part, state, in[0]);
}

void mck_eupi_inverse_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    mck_solved_start(forward_start, forward_step, part, state, in[0]);
}

void mck_eupi_inverse_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out)
{
    out[0] = mck_solved_input(trial, part, state, in[0]);
    advance(part->coefficients, part->n_states - 2, state, out[0]);
}
