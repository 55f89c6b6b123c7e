#include "band.h"

#define HEAD 6
#define FARTHEST MCK_R(3.0) /* deviations beyond which what is seen counts as just there */
#define WIDENS MCK_R(0.05)  /* share of a range beyond its end at which a band is twice as wide */

/* What the coefficients hold. */
typedef struct {
    int n_driving;
    int n_given;
    int n_x;
    int n_widths;
    int n_keeps;
    int n_bells;
    int n_seen;
    int n_terms;
    const mck_real *ends;
    const mck_real *widths;
    const mck_real *keeps;
    const mck_real *mean;
    const mck_real *spread;
    const mck_real *bells;
    const mck_real *shift;
    const mck_real *log_scale;
    const mck_real *limits;
    const mck_real *quantile;
} fields;

static fields fields_of(const mck_real *c)
{
    fields f;
    f.n_driving = (int)c[0];
    f.n_given = (int)c[1];
    f.n_widths = (int)c[2];
    f.n_keeps = (int)c[3];
    f.n_bells = (int)c[4];
    f.n_x = f.n_driving + f.n_given;
    f.n_seen = f.n_x + f.n_driving * (f.n_widths + f.n_keeps);
    f.n_terms = 1 + f.n_seen + f.n_bells;
    f.ends = c + HEAD;
    f.widths = f.ends + 2 * f.n_x;
    f.keeps = f.widths + f.n_widths;
    f.mean = f.keeps + f.n_keeps;
    f.spread = f.mean + f.n_seen;
    f.bells = f.spread + f.n_seen;
    f.shift = f.bells + f.n_bells * f.n_seen;
    f.log_scale = f.shift + f.n_given * f.n_terms;
    f.limits = f.log_scale + f.n_given * f.n_terms;
    f.quantile = f.limits + 4 * f.n_given;
    return f;
}

static mck_real share_of(const fields *f, int j, mck_real x)
{
    return (x - f->ends[j]) / (f->ends[f->n_x + j] - f->ends[j]);
}

/* Take one sample, fill what is seen, and return how far it is beyond what calibration saw. */
static mck_real look(const fields *f, mck_real *state, const mck_real *in, mck_real *seen)
{
    mck_real beyond = MCK_R(0.0);
    int place = 0;
    int slot = 0;
    for (int j = 0; j < f->n_x; j++) {
        mck_real share = share_of(f, j, in[j]);
        beyond = mck_max(beyond, mck_max(share - MCK_R(1.0), -share));
        share = mck_clip(share, MCK_R(0.0), MCK_R(1.0));
        seen[place++] = share;
        if (j >= f->n_driving) {
            continue;
        }
        for (int i = 0; i < f->n_widths; i++) {
            state[slot] = mck_play(state[slot], share, f->widths[i]);
            seen[place++] = (share - state[slot++]) / f->widths[i];
        }
        for (int i = 0; i < f->n_keeps; i++) {
            state[slot] = share + f->keeps[i] * (state[slot] - share);
            seen[place++] = share - state[slot++];
        }
    }
    return beyond;
}

static void fill(const fields *f, mck_real sharpness, const mck_real *seen, mck_real *terms)
{
    terms[0] = MCK_R(1.0);
    for (int i = 0; i < f->n_seen; i++) {
        terms[1 + i] = mck_clip((seen[i] - f->mean[i]) / f->spread[i], -FARTHEST, FARTHEST);
    }
    for (int k = 0; k < f->n_bells; k++) {
        mck_real distance = MCK_R(0.0);
        for (int i = 0; i < f->n_seen; i++) {
            const mck_real off = terms[1 + i] - f->bells[k * f->n_seen + i];
            distance += off * off;
        }
        terms[1 + f->n_seen + k] = mck_exp(-sharpness * distance);
    }
}

void mck_band_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    const fields f = fields_of(part->coefficients);
    const int each = f.n_widths + f.n_keeps;
    for (int j = 0; j < f.n_driving; j++) {
        for (int i = 0; i < each; i++) {
            state[j * each + i] = mck_clip(share_of(&f, j, in[j]), MCK_R(0.0), MCK_R(1.0));
        }
    }
}

void mck_band_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out)
{
    const fields f = fields_of(part->coefficients);
    mck_real *seen = state + part->n_states;
    mck_real *terms = seen + f.n_seen;
    const mck_real wider = MCK_R(1.0) + look(&f, state, in, seen) / WIDENS;
    fill(&f, part->coefficients[5], seen, terms);
    for (int g = 0; g < f.n_given; g++) {
        const mck_real *limits = f.limits + 4 * g;
        mck_real m = MCK_R(0.0);
        mck_real s = MCK_R(0.0);
        for (int i = 0; i < f.n_terms; i++) {
            m += f.shift[g * f.n_terms + i] * terms[i];
            s += f.log_scale[g * f.n_terms + i] * terms[i];
        }
        m = mck_clip(m, limits[0], limits[1]);
        const mck_real half =
            f.quantile[g] * mck_exp(mck_clip(s, limits[2], limits[3])) * wider;
        const mck_real y = in[f.n_driving + g];
        out[3 * g] = y;
        out[3 * g + 1] = mck_min(y, y + m - half);
        out[3 * g + 2] = mck_max(y, y + m + half);
    }
}
