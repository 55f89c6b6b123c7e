#include "load_estimate.h"

#include "balance_law.h"

/* What schedules, then the given loads, behind the balance's scratch. */
static const mck_real *scheduled(const mck_balance *f, const mck_real *in, const mck_real *loads)
{
    mck_real *x = f->scratch + f->n * (f->n + 6);
    for (int i = 0; i < f->n_x; i++) {
        x[i] = in[2 * f->n + i];
    }
    for (int i = 0; i < f->n_loads; i++) {
        x[f->n_x + i] = loads[i];
    }
    return x;
}

void mck_load_estimate_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    const mck_balance f = mck_balance_of(part, state);
    const mck_real *at_rest = part->coefficients + part->n_coefficients - f.n_loads;
    mck_real *y = f.scratch;
    mck_balance_begin(part, &f, scheduled(&f, in, at_rest));
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
    const mck_real *solving = part->coefficients + part->n_coefficients - f.n_loads * (f.n + 1);
    const mck_real *p = in + f.n;
    const int way = mck_balance_way(&f);
    mck_real *y = f.scratch;
    mck_real *residual = y + f.n;
    for (int k = 0; k < f.n; k++) {
        y[k] = in[k] + f.tare[k];
    }
    for (int i = 0; i < f.n_loads; i++) {
        out[i] = MCK_R(0.0);
    }
    (void)mck_balance_lack(&f, way, y, scheduled(&f, in, out), p, residual, residual + f.n);
    mck_balance_keep(&f, way, y, p);
    for (int i = 0; i < f.n_loads; i++) {
        for (int k = 0; k < f.n; k++) {
            out[i] -= solving[i * f.n + k] * residual[k];
        }
    }
}
