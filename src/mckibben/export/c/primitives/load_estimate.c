#include "load_estimate.h"

#include "balance_law.h"

/* What schedules, then no loads, behind the balance's scratch. */
static mck_real *scheduled(const mck_balance *f, const mck_real *in)
{
    mck_real *x = f->scratch + f->n * (f->n + 6);
    for (int i = 0; i < f->n_x; i++) {
        x[i] = in[2 * f->n + i];
    }
    for (int i = 0; i < f->n_loads; i++) {
        x[f->n_x + i] = MCK_R(0.0);
    }
    return x;
}

/* The loads that make up for what the muscles at y lack. */
static void solve(const mck_part *part, const mck_balance *f, int way, const mck_real *in,
                  const mck_real *y, mck_real *loads)
{
    const mck_real *solving = part->coefficients + part->n_coefficients - f->n_loads * f->n;
    mck_real *residual = f->scratch + f->n;
    (void)mck_balance_lack(f, way, y, scheduled(f, in), in + f->n, residual, residual + f->n);
    for (int i = 0; i < f->n_loads; i++) {
        loads[i] = MCK_R(0.0);
        for (int k = 0; k < f->n; k++) {
            loads[i] -= solving[i * f->n + k] * residual[k];
        }
    }
}

void mck_load_estimate_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    const mck_balance f = mck_balance_of(part, state);
    mck_real *y = f.scratch;
    mck_real *x = scheduled(&f, in);
    if (part->coefficients[13] == MCK_R(0.0)) {
        /* without a tare the first sample tells the loads, but for friction */
        for (int k = 0; k < part->n_states; k++) {
            state[k] = MCK_R(0.0);
        }
        solve(part, &f, MCK_AT_REST, in, in, y);
        for (int i = 0; i < f.n_loads; i++) {
            x[f.n_x + i] = y[i];
        }
    }
    mck_balance_begin(part, &f, x);
    if (part->start == MCK_VIRGIN) {
        for (int k = 0; k < f.n; k++) {
            y[k] = in[k] + f.tare[k];
        }
        mck_balance_keep(&f, MCK_AT_REST, y, in + f.n);
    }
}

void mck_load_estimate_step(const mck_part *part, mck_real *state, const mck_real *in,
                            mck_real *out)
{
    const mck_balance f = mck_balance_of(part, state);
    const int way = mck_balance_way(&f);
    mck_real *y = f.scratch;
    for (int k = 0; k < f.n; k++) {
        y[k] = in[k] + f.tare[k];
    }
    solve(part, &f, way, in, y, out);
    mck_balance_keep(&f, way, y, in + f.n);
}
