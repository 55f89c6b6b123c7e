#include "balance.h"

#include "balance_law.h"

void mck_balance_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    const mck_balance f = mck_balance_of(part, state);
    mck_real *y = f.scratch;
    mck_real *p = y + f.n;
    mck_balance_begin(part, &f, in + f.n);
    if (part->start == MCK_VIRGIN) {
        for (int j = 0; j < f.n; j++) {
            y[j] = in[j] + f.tare[j];
        }
        for (int k = 0; k < f.n; k++) {
            int reached;
            const mck_real found =
                mck_balance_pressed(&f, k, MCK_AT_REST, y, in + f.n, p + f.n, &reached);
            p[k] = mck_clip(found, f.lowest, f.highest);
        }
        mck_balance_keep(&f, MCK_AT_REST, y, p);
    }
}

void mck_balance_press(const mck_balance *f, const mck_real *in, mck_real *out)
{
    const int way = mck_balance_way(f);
    const mck_real *x = in + f->n;
    mck_real *y = f->scratch;
    int beyond = 0;
    for (int j = 0; j < f->n; j++) {
        y[j] = in[j] + f->tare[j];
    }
    for (int k = 0; k < f->n; k++) {
        int reached;
        const mck_real found = mck_balance_pressed(f, k, way, y, x, y + f->n, &reached);
        out[k] = mck_clip(found, f->lowest, f->highest);
        beyond |= !reached || mck_abs(out[k] - found) > MCK_SLACK * (MCK_R(1.0) + mck_abs(found));
    }
    if (beyond) {
        /* where the muscles go instead is what friction will remember */
        (void)mck_balance_settle(f, way, y, x, out, y + f->n + f->n);
        *f->amiss += MCK_R(1.0);
    }
    mck_balance_keep(f, way, y, out);
}

void mck_balance_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out)
{
    const mck_balance f = mck_balance_of(part, state);
    mck_balance_press(&f, in, out);
}

void mck_balance_inverse_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    const mck_balance f = mck_balance_of(part, state);
    mck_real *y = f.scratch;
    mck_balance_begin(part, &f, in + f.n);
    if (part->start == MCK_VIRGIN) {
        (void)mck_balance_settle(&f, MCK_AT_REST, y, in + f.n, in, y + f.n);
        mck_balance_keep(&f, MCK_AT_REST, y, in);
    }
}

void mck_balance_inverse_step(const mck_part *part, mck_real *state, const mck_real *in,
                              mck_real *out)
{
    const mck_balance f = mck_balance_of(part, state);
    const int way = mck_balance_way(&f);
    mck_real *y = f.scratch;
    for (int k = 0; k < f.n; k++) {
        y[k] = f.u[k];
    }
    const mck_real left = mck_balance_settle(&f, way, y, in + f.n, in, y + f.n);
    mck_balance_keep(&f, way, y, in);
    for (int k = 0; k < f.n; k++) {
        out[k] = y[k] - f.tare[k];
    }
    if (!(left < MCK_NEARLY)) {
        *f.amiss += MCK_R(1.0);
    }
}
