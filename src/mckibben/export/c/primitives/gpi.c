#include "gpi.h"

#include "interpolation.h"
#include "operators.h"

#define TANH 0
#define EXPONENTIAL 1

typedef struct {
    int kind;
    int size;
    const mck_real *numbers;
} envelope;

typedef struct {
    int n;
    const mck_real *thresholds;
    const mck_real *weights;
    envelope rising;
    envelope falling;
} model;

static model read_model(const mck_real *c, int n)
{
    model m;
    m.n = n;
    m.rising.kind = (int)c[0];
    m.rising.size = (int)c[1];
    m.falling.kind = (int)c[2];
    m.falling.size = (int)c[3];
    m.thresholds = c + 4;
    m.weights = m.thresholds + n;
    m.rising.numbers = m.weights + n;
    m.falling.numbers = m.rising.numbers + m.rising.size;
    return m;
}

static mck_real value(const envelope *e, mck_real u)
{
    const mck_real *c = e->numbers;
    if (e->kind == TANH) {
        return mck_tanh(c[0] * u + c[1]) + c[2];
    }
    if (e->kind == EXPONENTIAL) {
        const mck_real sign = mck_copysign(MCK_R(1.0), c[0]);
        return c[2] + sign * (MCK_R(1.0) - mck_exp(c[1] - c[0] * u));
    }
    return mck_interpolate(u, e->size / 2, c, c + e->size / 2);
}

/* The input at which an envelope has a value; NaN beyond its range. */
static mck_real solve(const envelope *e, mck_real v)
{
    const mck_real *c = e->numbers;
    if (e->kind == TANH) {
        return (mck_atanh(v - c[2]) - c[1]) / c[0];
    }
    if (e->kind == EXPONENTIAL) {
        const mck_real sign = mck_copysign(MCK_R(1.0), c[0]);
        return (c[1] - mck_log(MCK_R(1.0) - sign * (v - c[2]))) / c[0];
    }
    return mck_interpolate(v, e->size / 2, c + e->size / 2, c);
}

void mck_gpi_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    const model m = read_model(part->coefficients, part->n_states - 1);
    mck_operators_start(part->start, m.n, m.thresholds, value(&m.rising, in[0]),
                        value(&m.falling, in[0]), state);
    state[m.n] = in[0];
}

void mck_gpi_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out)
{
    const model m = read_model(part->coefficients, part->n_states - 1);
    const mck_real u = in[0];
    if (u > state[m.n]) {
        const mck_real rising = value(&m.rising, u);
        for (int i = 0; i < m.n; i++) {
            state[i] = mck_max(state[i], rising - m.thresholds[i]);
        }
    } else if (u < state[m.n]) {
        const mck_real falling = value(&m.falling, u);
        for (int i = 0; i < m.n; i++) {
            state[i] = mck_min(state[i], falling + m.thresholds[i]);
        }
    }
    mck_real y = MCK_R(0.0);
    for (int i = 0; i < m.n; i++) {
        y += m.weights[i] * state[i];
    }
    state[m.n] = u;
    out[0] = y;
}

void mck_gpi_inverse_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    const mck_real low = part->coefficients[0];
    const mck_real high = part->coefficients[1];
    const model m = read_model(part->coefficients + 2, part->n_states - 3);
    mck_real u;
    if (part->start == MCK_VIRGIN) {
        mck_solve_from_rest(m.n, in[0], value(&m.falling, low), value(&m.rising, high),
                            m.thresholds, m.weights, state);
        u = solve(in[0] < MCK_R(0.0) ? &m.falling : &m.rising, state[0]);
    } else {
        mck_real risen = in[0];
        mck_real slope = MCK_R(0.0);
        for (int i = 0; i < m.n; i++) {
            risen += m.weights[i] * m.thresholds[i];
            slope += m.weights[i];
        }
        const mck_real z =
            mck_clip(risen / slope, value(&m.rising, low), value(&m.rising, high));
        for (int i = 0; i < m.n; i++) {
            state[i] = z - m.thresholds[i];
        }
        u = solve(&m.rising, z);
    }
    state[m.n] = mck_clip(u, low, high);
    state[m.n + 1] = in[0];
    state[m.n + 2] = MCK_R(0.0);
}

mck_real mck_gpi_branch(const mck_real *coefficients, int n, int direction, mck_real z, mck_real u)
{
    const model m = read_model(coefficients + 2, n);
    if (direction > 0) {
        return mck_clip(solve(&m.rising, z), coefficients[0], coefficients[1]);
    }
    if (direction < 0) {
        return mck_clip(solve(&m.falling, z), coefficients[0], coefficients[1]);
    }
    return u;
}

void mck_gpi_inverse_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out)
{
    const mck_real low = part->coefficients[0];
    const mck_real high = part->coefficients[1];
    const model m = read_model(part->coefficients + 2, part->n_states - 3);
    int clipped = 0;
    const int direction =
        mck_follow(m.n, in[0], state[m.n + 1], value(&m.falling, low), value(&m.rising, high),
                   m.thresholds, m.weights, state, &clipped);
    if (clipped) {
        state[m.n + 2] += MCK_R(1.0);
    }
    state[m.n] = mck_gpi_branch(part->coefficients, m.n, direction, state[0], state[m.n]);
    state[m.n + 1] = in[0];
    out[0] = state[m.n];
}
