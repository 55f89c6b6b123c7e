#include "learning.h"

#define QUARTILE MCK_R(0.6745)
#define NEAR MCK_R(0.1) /* to it, where an error counts for less */
#define SURPRISED MCK_R(5.0)
#define ABSURD MCK_R(1e-6)
#define ALIKE MCK_R(0.98) /* errors that follow one another, until it is known */
#define MOST_ALIKE MCK_R(0.9995)
#define LARGEST MCK_R(1e9) /* usual error, by the noise */
#define NEVER MCK_R(1e30)
#define LATE MCK_R(3.0) /* errors that what is used goes by: those of a third of the time */
#define STILL MCK_R(1e-9)
#define UNMOVED MCK_R(1e-12)

static int triangle(int p) { return (p * (p + 1)) / 2; }

mck_learner mck_read_learner(const mck_real *c)
{
    mck_learner m;
    m.p = (int)c[0];
    m.share = c[1];
    m.noise = c[2];
    m.part = c[3];
    m.scales = c + 4;
    m.widest = m.scales + m.p;
    m.fitted = m.widest + m.p;
    m.fresh = m.fitted + m.p;
    m.family = m.fresh + triangle(m.p);
    return m;
}

mck_learnt mck_split_learnt(const mck_learner *m, mck_real *state, int own, int outputs)
{
    mck_learnt s;
    s.theta = state + own;
    s.used = s.theta + m->p;
    s.root = s.used + m->p;
    s.sense = s.root + triangle(m->p);
    s.work = s.sense + MCK_SENSES * outputs;
    return s;
}

void mck_learnt_start(const mck_learner *m, const mck_learnt *s, int outputs)
{
    for (int i = 0; i < m->p; i++) {
        s->theta[i] = m->fitted[i];
        s->used[i] = m->fitted[i];
    }
    for (int i = 0; i < triangle(m->p); i++) {
        s->root[i] = m->fresh[i];
    }
    for (int k = 0; k < outputs; k++) {
        mck_real *sense = s->sense + MCK_SENSES * k;
        for (int i = 0; i < MCK_SENSES; i++) {
            sense[i] = MCK_R(0.0);
        }
        sense[MCK_USUAL] = MCK_R(3.0) * m->noise;
        sense[MCK_SURPRISE] = MCK_R(1.0);
        sense[MCK_SQUARED] = MCK_R(1.0);
        sense[MCK_RELATED] = ALIKE;
        sense[MCK_STOOD] = MCK_R(3.0) * m->noise * (MCK_R(3.0) * m->noise) *
                           (MCK_R(1.0) + ALIKE) / (MCK_R(1.0) - ALIKE);
        sense[MCK_APART] = m->noise * m->noise;
    }
}

/* How many errors that follow one another tell as much as one independent one. */
static mck_real fewer(const mck_real *sense)
{
    const mck_real alike = mck_clip(sense[MCK_RELATED] / sense[MCK_SQUARED], MCK_R(0.0), MOST_ALIKE);
    return (MCK_R(1.0) + alike) / (MCK_R(1.0) - alike);
}

/* Remember an error, by its expected size. */
static void feel(mck_real share, mck_real noise, mck_real relative, mck_real *sense)
{
    const mck_real usual = sense[MCK_USUAL];
    const mck_real quick = mck_min(MCK_R(20.0) * share, MCK_R(0.5));
    const mck_real side =
        mck_clip((mck_abs(relative) - QUARTILE) / NEAR, MCK_R(-1.0), MCK_R(1.0));
    const mck_real next = usual * (MCK_R(1.0) + MCK_R(0.5) * quick * side);
    const mck_real square = relative * relative;
    sense[MCK_USUAL] = mck_min(mck_max(next, noise), LARGEST * noise);
    sense[MCK_SURPRISE] += quick * (square - sense[MCK_SURPRISE]);
    sense[MCK_RELATED] += share * (relative * sense[MCK_BEFORE] - sense[MCK_RELATED]);
    sense[MCK_SQUARED] += share * (square - sense[MCK_SQUARED]);
    sense[MCK_BEFORE] = relative;
}

/* Remember how what is learnt would have helped: what it leaves, what it makes up for. */
static void compare(const mck_learner *m, mck_real left, mck_real made_up, mck_real *sense)
{
    const mck_real late = mck_min(LATE * m->share, MCK_R(0.5));
    const mck_real apart = made_up * made_up + m->noise * m->noise;
    sense[MCK_HELPED] += late * (made_up * (left + made_up) - sense[MCK_HELPED]);
    sense[MCK_APART] += late * (apart - sense[MCK_APART]);
}

mck_real mck_trusted(const mck_learnt *s, int outputs)
{
    mck_real helped = MCK_R(0.0);
    mck_real apart = MCK_R(0.0);
    for (int k = 0; k < outputs; k++) {
        helped += s->sense[MCK_SENSES * k + MCK_HELPED];
        apart += s->sense[MCK_SENSES * k + MCK_APART];
    }
    return mck_clip(helped / apart, MCK_R(0.0), MCK_R(1.0));
}

/* Add `excited` times what a measurement tells to what is known (Bierman); g becomes P phi. */
static void spread(int p, mck_real *root, const mck_real *f, mck_real *g, mck_real excited)
{
    const int still = mck_abs(excited) < STILL;
    mck_real before = still ? MCK_R(0.0) : MCK_R(1.0) / excited;
    mck_real *column = root + p;
    for (int j = 0; j < p; j++) {
        const mck_real own = g[j];
        const mck_real after = before + f[j] * own;
        mck_real known = MCK_R(0.0);
        if (!still) {
            known = -f[j] / before;
            root[j] *= before / after;
        }
        for (int i = 0; i < j; i++) {
            const mck_real u = column[i];
            column[i] = u + g[i] * known;
            g[i] += u * own;
        }
        column += j;
        before = after;
    }
}

/* Keep the variance of parameter i from passing the widest. */
static void bound(int p, mck_real *root, mck_real widest, int i)
{
    mck_real variance = root[i];
    for (int j = i + 1; j < p; j++) {
        const mck_real u = root[p + (j * (j - 1)) / 2 + i];
        variance += u * u * root[j];
    }
    if (!(variance > widest)) {
        return;
    }
    const mck_real less = mck_sqrt(widest / variance);
    root[i] *= less * less;
    for (int k = 0; k < i; k++) {
        root[p + (i * (i - 1)) / 2 + k] /= less;
    }
    for (int j = i + 1; j < p; j++) {
        root[p + (j * (j - 1)) / 2 + i] *= less;
    }
}

/* Scale the covariance with the scatter: at once where that grows, so that slow drift is followed. */
static void stand_by(const mck_learner *m, mck_real square, mck_real *diagonal, mck_real *sense)
{
    const mck_real stood = sense[MCK_STOOD];
    const mck_real stands = square > stood ? square : stood + m->share * (square - stood);
    const mck_real grows = MCK_R(1.0) + m->part * (stands / stood - MCK_R(1.0));
    for (int i = 0; i < m->p; i++) {
        diagonal[i] *= grows;
    }
    sense[MCK_STOOD] = stands;
}

int mck_learn(const mck_learner *m, const mck_learnt *s, mck_real *sense, mck_real measured,
              mck_real predicted, mck_real asked, mck_real fitted)
{
    const int p = m->p;
    const mck_real *slopes = s->work;
    mck_real *f = s->work + p;
    mck_real *g = f + p;
    if (!isfinite(measured)) {
        sense[MCK_IGNORED] += MCK_R(1.0);
        return 0;
    }
    if (!(sense[MCK_READY] > MCK_R(0.0))) {
        sense[MCK_READY] = MCK_R(1.0);
        sense[MCK_LAST] = measured;
        sense[MCK_THEN] = asked;
        return 0;
    }
    const mck_real usual = sense[MCK_USUAL];
    if (measured < sense[MCK_LAST] || measured > sense[MCK_LAST]) {
        sense[MCK_LAST] = measured;
        sense[MCK_THEN] = asked;
    } else if (mck_abs(asked - sense[MCK_THEN]) > MCK_GATE * usual) {
        sense[MCK_THEN] = NEVER; /* it stands until it changes */
        sense[MCK_IGNORED] += MCK_R(1.0);
        return 0;
    }
    if (sense[MCK_SURPRISE] > SURPRISED) { /* the plant has stepped */
        for (int i = 0; i < triangle(p); i++) {
            s->root[i] = m->fresh[i];
        }
        sense[MCK_SURPRISE] = MCK_R(1.0);
    }
    const mck_real error = measured - predicted;
    mck_real r = MCK_R(0.0);
    const mck_real told = usual * mck_sqrt(fewer(sense));
    stand_by(m, told * told, s->root, sense);
    for (int j = 0; j < p; j++) {
        f[j] = slopes[j] * m->scales[j] / told;
    }
    for (int j = p - 1; j >= 0; j--) { /* U' phi in place */
        const mck_real *column = s->root + p + (j * (j - 1)) / 2;
        for (int i = 0; i < j; i++) {
            f[j] += column[i] * f[i];
        }
        g[j] = s->root[j] * f[j];
        r += f[j] * g[j];
    }
    const mck_real expected = mck_sqrt(usual * usual + r * told * told);
    mck_real weight = MCK_R(1.0);
    if (mck_abs(error) > MCK_GATE * expected) {
        weight = MCK_GATE * expected / mck_abs(error);
        sense[MCK_IGNORED] += MCK_R(1.0);
    }
    feel(m->share, m->noise, weight * error / expected, sense);
    compare(m, weight * error, predicted - fitted, sense);
    if (!(r > UNMOVED && r < MCK_INFINITY && weight > ABSURD)) {
        return 0;
    }
    /* as where errors have grown: what is excited is learnt within the time */
    const mck_real settled = m->share / (MCK_R(1.0) - m->share);
    const int lacks = r < settled;
    const mck_real tells = MCK_R(1.0) / settled - MCK_R(1.0) / r;
    r *= weight;
    spread(p, s->root, f, g,
           lacks ? tells : weight * (MCK_R(1.0) - m->share - m->share / r));
    const mck_real gain = weight * error / told / (MCK_R(1.0) + r);
    for (int i = 0; i < p; i++) {
        s->theta[i] += m->scales[i] * g[i] * gain;
    }
    const int turn = (int)sense[MCK_READY] % p;
    bound(p, s->root, m->widest[turn], turn);
    sense[MCK_READY] = (mck_real)(turn + 1);
    return 1;
}
