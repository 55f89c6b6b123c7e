#include "pid.h"

void mck_pid_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    const int n = part->n_outputs;
    for (int k = 0; k < n; k++) {
        state[k] = MCK_R(0.0);
        state[n + k] = MCK_R(0.0);
        state[2 * n + k] = in[n + k];
        state[3 * n + k] = in[n + k];
        state[4 * n + k] = MCK_R(0.0);
    }
}

void mck_pid_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out)
{
    const int n = part->n_outputs;
    const mck_real *c = part->coefficients;
    const mck_real step = c[0];
    const mck_real share = c[1];
    const mck_real lowest = c[2];
    const mck_real highest = c[3];
    const int based = c[4] > MCK_R(0.0);
    const int late = c[5] > MCK_R(0.0);
    const mck_real *kp = c + 6;
    const mck_real *ki = kp + n;
    const mck_real *kd = ki + n;
    mck_real *integral = state;
    mck_real *rate = integral + n;
    mck_real *last = rate + n;
    mck_real *due = last + n;
    mck_real *lost = due + n;
    for (int k = 0; k < n; k++) {
        const mck_real reference = in[k];
        const mck_real measured = in[n + k];
        const mck_real base = based ? in[2 * n + k] : MCK_R(0.0);
        const mck_real error = (late ? due[k] : reference) - measured;
        rate[k] += share * ((measured - last[k]) / step - rate[k]);
        last[k] = measured;
        due[k] = reference;
        const mck_real wanted = base + kp[k] * error + integral[k] - kd[k] * rate[k];
        /* the integral stops where the output is at a limit and would be driven further */
        const mck_real way = ki[k] * error;
        const int further = (wanted > highest && way > MCK_R(0.0)) ||
                            (wanted < lowest && way < MCK_R(0.0));
        if (!further) {
            mck_accumulate(&integral[k], &lost[k], ki[k] * step * error);
        }
        out[k] = mck_clip(wanted, lowest, highest);
    }
}
