#include "multistate_friction.h"

/* The deflection after a time at a constant rate v >= 0: sticking, or slipping in closed form. */
static mck_real deflected(mck_real x, mck_real v, mck_real time, mck_real k, mck_real sigma,
                          mck_real limit)
{
    const int resting = !(v > MCK_R(0.0));
    if (k * x + sigma * v < -limit) {
        /* slipping backwards: the spring relaxes to where it sticks */
        const mck_real excess = -(k * x + limit);
        if (resting || sigma / k * mck_log(excess / (sigma * v)) >= time) {
            return -limit / k - excess / k * mck_exp(-k * time / sigma);
        }
        time -= sigma / k * mck_log(excess / (sigma * v));
        x = -(limit + sigma * v) / k;
    }
    if (k * x + sigma * v <= limit) {
        if (resting) {
            return x;
        }
        const mck_real needed = ((limit - sigma * v) / k - x) / v;
        if (needed >= time) {
            return x + v * time;
        }
        time -= needed;
        x += v * needed;
    }
    return limit / k + (x - limit / k) * mck_exp(-k * time / sigma);
}

/* Whether an element sticks through all of a step, v >= 0. */
static int sticks(mck_real x, mck_real v, mck_real time, mck_real k, mck_real sigma, mck_real limit)
{
    return k * x + sigma * v >= -limit && k * (x + v * time) + sigma * v <= limit;
}

void mck_multistate_friction_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    const int n = part->n_states - 1;
    for (int i = 0; i < n; i++) {
        const mck_real *lengthening = part->coefficients + 3 + 6 * i;
        state[i] = part->start == MCK_VIRGIN ? MCK_R(0.0) : lengthening[2] / lengthening[0];
    }
    state[n] = in[0];
    for (int i = 0; i < n; i++) {
        state[part->n_states + i] = MCK_R(0.0);
    }
}

void mck_multistate_friction_step(const mck_part *part, mck_real *state, const mck_real *in,
                                  mck_real *out)
{
    const int n = part->n_states - 1;
    const mck_real *c = part->coefficients;
    mck_real *lost = state + part->n_states;
    const mck_real step = c[0];
    const mck_real v = (in[0] - state[n]) / step;
    const int lengthens = v >= MCK_R(0.0);
    const mck_real sign = lengthens ? MCK_R(1.0) : MCK_R(-1.0);
    mck_real force = MCK_R(0.0);
    for (int i = 0; i < n; i++) {
        const mck_real *element = c + 3 + 6 * i;
        const mck_real *own = lengthens ? element : element + 3;
        const mck_real *other = lengthens ? element + 3 : element;
        const mck_real k = own[0];
        const mck_real sigma = own[1];
        const mck_real limit = own[2];
        if (limit > MCK_R(0.0)) {
            if (sticks(sign * state[i], sign * v, step, k, sigma, limit)) {
                mck_accumulate(&state[i], &lost[i], v * step);
            } else {
                state[i] = sign * deflected(sign * state[i], sign * v, step, k, sigma, limit);
                lost[i] = MCK_R(0.0);
            }
            force += mck_clip(k * state[i] + sigma * v, -limit, limit);
        } else {
            /* it does not act this way: the motion unloads what is left of it */
            const mck_real x = state[i] + v * step;
            state[i] = lengthens ? mck_min(x, MCK_R(0.0)) : mck_max(x, MCK_R(0.0));
            force += other[0] * state[i];
        }
    }
    state[n] = in[0];
    out[0] = force * (MCK_R(1.0) + c[1] * (in[1] - c[2]));
}
