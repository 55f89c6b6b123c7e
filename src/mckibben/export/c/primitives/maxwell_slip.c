#include "maxwell_slip.h"

#include "horner.h"
#include "root.h"

static int size(const mck_real *c) { return (int)c[0]; }

/* The deflection of a spring after the input has moved by du. */
static mck_real slip(const mck_real *c, mck_real s, mck_real du, mck_real limit)
{
    if (du >= MCK_R(0.0)) {
        return mck_min(s + du, limit);
    }
    return mck_max(s + c[1] * du, -c[2] * limit);
}

static mck_real output(const mck_real *c, int n, const mck_real *state, mck_real u)
{
    const mck_real *limits = c + 5 + size(c);
    const mck_real *weights = limits + n;
    mck_real y = mck_horner((u - c[3]) / c[4], size(c), c + 5);
    for (int i = 0; i < n; i++) {
        y += weights[i] * slip(c, state[i], u - state[n], limits[i]);
    }
    return y;
}

static void advance(const mck_real *c, int n, mck_real *state, mck_real *lost, mck_real u)
{
    const mck_real *limits = c + 5 + size(c);
    const mck_real du = u - state[n];
    const mck_real step = du >= MCK_R(0.0) ? du : c[1] * du;
    for (int i = 0; i < n; i++) {
        const mck_real moved = slip(c, state[i], du, limits[i]);
        if (moved < limits[i] && moved > -c[2] * limits[i]) {
            mck_accumulate(&state[i], &lost[i], step);
        } else {
            state[i] = moved;
            lost[i] = MCK_R(0.0);
        }
    }
    state[n] = u;
}

static void start(int rule, const mck_real *c, int n, mck_real *state, mck_real *lost, mck_real u)
{
    const mck_real *limits = c + 5 + size(c);
    for (int i = 0; i < n; i++) {
        state[i] = rule == MCK_VIRGIN ? MCK_R(0.0) : limits[i];
        lost[i] = MCK_R(0.0);
    }
    state[n] = u;
}

void mck_maxwell_slip_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    start(part->start, part->coefficients, part->n_states - 1, state, state + part->n_states, in[0]);
}

void mck_maxwell_slip_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out)
{
    const int n = part->n_states - 1;
    out[0] = output(part->coefficients, n, state, in[0]);
    advance(part->coefficients, n, state, state + part->n_states, in[0]);
}

static mck_real trial(const mck_part *part, const mck_real *state, mck_real u)
{
    return output(part->coefficients, part->n_states - 3, state, u);
}

static void forward_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    start(part->start, part->coefficients, part->n_states - 3, state, state + part->n_states, in[0]);
}

static void forward_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out)
{
    out[0] = trial(part, state, in[0]);
    advance(part->coefficients, part->n_states - 3, state, state + part->n_states, in[0]);
}

void mck_maxwell_slip_inverse_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    mck_solved_start(forward_start, forward_step, part, state, in[0]);
}

void mck_maxwell_slip_inverse_step(const mck_part *part, mck_real *state, const mck_real *in,
                                   mck_real *out)
{
    out[0] = mck_solved_input(trial, part, state, in[0]);
    advance(part->coefficients, part->n_states - 3, state, state + part->n_states, out[0]);
}
