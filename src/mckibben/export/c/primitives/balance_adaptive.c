#include "balance_adaptive.h"

#include "balance.h"
#include "balance_law.h"
#include "learning.h"
#include "linear_system.h"

#define OWN 8
#define BLADDER 6
#define LEAST_FACTOR MCK_R(0.5)
#define MOST_FACTOR MCK_R(2.0)
#define MOST_FORCE MCK_R(0.3)

/* What is learnt of a muscle. */
enum { OFFSET, STIFFNESS, AREA, FRICTION, RELAXATION, KINDS };

/* The balance as it is now, what it learns with, and the last sample. */
typedef struct {
    mck_learner learner;
    mck_learnt learnt;
    const mck_real *which;  /* parameters: muscle times KINDS, plus kind */
    const mck_real *bounds; /* most friction by area, most area by stiffness, of every muscle */
    mck_part fitted;
    const mck_real *before; /* numbers of the muscles, as fitted */
    mck_balance now;
    mck_real *y; /* of the last sample: where muscles were, pressures, and what scheduled */
    mck_real *p;
    mck_real *x;
    mck_real *terms;   /* n by parameters: what residuals change by */
    mck_real *matrix;  /* n by n: with displacements */
    mck_real *right;   /* n, and n by n, to compute in */
    mck_real *left;
    mck_real *muscles; /* numbers of the muscles as they are now */
} adapting;

/* Numbers of a muscle. */
static int width_of(const mck_balance *f)
{
    const int springs = (1 + f->n_x * f->degree) * (1 + f->n);
    return OWN + springs + f->n_e + f->n_a + f->m + f->n_l + f->n_loads;
}

static adapting read_adapting(const mck_part *part, mck_real *state)
{
    adapting a;
    a.learner = mck_read_learner(part->coefficients);
    const int n = (int)a.learner.family[0];
    const int p = a.learner.p;
    a.which = a.learner.family + 1;
    a.bounds = a.which + p;
    a.fitted = *part;
    a.fitted.coefficients = a.bounds + 2 * n;
    a.now = mck_balance_of(&a.fitted, state);
    a.before = a.now.muscles;
    a.fitted.n_states = n * (3 + a.now.m + a.now.n_l + (a.now.heavy ? 2 : 0)) + 2;
    a.y = state + a.fitted.n_states;
    a.p = a.y + n;
    a.x = a.p + n;
    const int own = a.fitted.n_states + 2 * n + a.now.n_x + a.now.n_loads;
    a.learnt = mck_split_learnt(&a.learner, state, own, n);
    a.terms = a.learnt.work + 3 * p;
    a.matrix = a.terms + n * p;
    a.right = a.matrix + n * n;
    a.left = a.right + n;
    a.muscles = a.left + n * n;
    a.now.scratch = a.muscles + n * width_of(&a.now);
    return a;
}

static void scale(mck_real *first, int count, mck_real factor)
{
    for (int i = 0; i < count; i++) {
        first[i] *= factor;
    }
}

/* Make the muscles what they are with the parameters. */
static void retune(adapting *a)
{
    const mck_balance *f = &a->now;
    const int n = f->n;
    const int width = width_of(f);
    const int powers = 1 + f->n_x * f->degree;
    for (int i = 0; i < n * width; i++) {
        a->muscles[i] = a->before[i];
    }
    for (int i = 0; i < a->learner.p; i++) {
        const int k = (int)a->which[i] / KINDS;
        const mck_real factor = a->learnt.used[i];
        mck_real *springs = a->muscles + k * width + OWN;
        mck_real *elasticity = springs + powers * (1 + n);
        mck_real *areas = elasticity + f->n_e;
        mck_real *friction = areas + f->n_a;
        switch ((int)a->which[i] % KINDS) {
        case OFFSET:
            springs[0] += factor;
            break;
        case STIFFNESS: {
            const mck_real shared = mck_sqrt(factor);
            springs[BLADDER - OWN] *= factor;
            for (int q = 0; q < powers; q++) {
                scale(springs + q * (1 + n) + 1, n, shared);
                for (int j = 0; j < n; j++) {
                    a->muscles[j * width + OWN + q * (1 + n) + 1 + k] *= shared;
                }
            }
            scale(elasticity, f->n_e, factor);
            break;
        }
        case AREA:
            scale(areas, f->n_a, factor);
            break;
        case FRICTION:
            scale(friction, f->m, factor);
            break;
        default:
            scale(friction + f->m, f->n_l, factor);
            break;
        }
    }
}

/* What the residuals change by with parameters, and with displacements where stops go along. */
static void fill_slopes(adapting *a)
{
    const int n = a->now.n;
    const int p = a->learner.p;
    for (int k = 0; k < n; k++) {
        mck_real *row = a->matrix + k * n;
        const mck_balance_forces own = mck_balance_share(&a->now, k, a->y, a->x, a->p[k], row);
        for (int i = 0; i < p; i++) {
            const int j = (int)a->which[i] / KINDS;
            const int kind = (int)a->which[i] % KINDS;
            mck_real force = MCK_R(0.0);
            if (kind == STIFFNESS) {
                force = MCK_R(0.5) * row[j] * a->y[j];
            }
            if (j == k) {
                const mck_real shares[KINDS] = {MCK_R(1.0), MCK_R(0.5) * own.pulled + own.held,
                                                -own.given, own.rubbed, own.relaxing};
                force += shares[kind];
            }
            a->terms[k * p + i] = kind == OFFSET ? force : force / a->learnt.used[i];
        }
        row[k] += own.stiff;
    }
}

/* Slopes of displacement k by the parameters. */
static void answer(adapting *a, int k)
{
    const int n = a->now.n;
    const int p = a->learner.p;
    for (int i = 0; i < n; i++) {
        a->right[i] = i == k ? MCK_R(-1.0) : MCK_R(0.0);
    }
    for (int i = 0; i < n * n; i++) {
        a->left[i] = a->matrix[i];
    }
    mck_eliminate(n, a->left, a->right);
    for (int i = 0; i < p; i++) {
        a->learnt.work[i] = MCK_R(0.0);
        for (int j = 0; j < n; j++) {
            a->learnt.work[i] += a->right[j] * a->terms[j * p + i];
        }
    }
}

/* Place of a parameter, or -1. */
static int place_of(const adapting *a, int k, int kind)
{
    for (int i = 0; i < a->learner.p; i++) {
        if ((int)a->which[i] == k * KINDS + kind) {
            return i;
        }
    }
    return -1;
}

/* Multiply by the covariance U D U'. */
static void covariant(int p, const mck_real *root, const mck_real *vector, mck_real *product)
{
    for (int j = 0; j < p; j++) {
        const mck_real *column = root + p + (j * (j - 1)) / 2;
        mck_real total = vector[j];
        for (int i = 0; i < j; i++) {
            total += column[i] * vector[i];
        }
        product[j] = root[j] * total;
    }
    for (int j = 0; j < p; j++) {
        const mck_real *column = root + p + (j * (j - 1)) / 2;
        for (int i = 0; i < j; i++) {
            product[i] += column[i] * product[j];
        }
    }
}

/* Bring what measurements do not tell back to what was fitted, in the time to learn in. */
static void pull_back(adapting *a)
{
    const int p = a->learner.p;
    mck_real *along = a->learnt.work;
    mck_real *pull = along + p;
    for (int i = 0; i < p; i++) {
        const mck_real back = a->learner.fitted[i] - a->learnt.theta[i];
        pull[i] = a->learner.share * back / (a->learner.scales[i] * a->learner.widest[i]);
    }
    covariant(p, a->learnt.root, pull, along);
    for (int i = 0; i < p; i++) {
        a->learnt.theta[i] += a->learner.scales[i] * along[i];
    }
}

/* How far parameter i is short of what a balance can have. */
static mck_real short_of(const adapting *a, int i)
{
    const mck_real *theta = a->learnt.theta;
    const int k = (int)a->which[i] / KINDS;
    const int kind = (int)a->which[i] % KINDS;
    mck_real low = LEAST_FACTOR;
    mck_real high = MOST_FACTOR;
    if (kind == OFFSET) {
        high = MOST_FORCE * a->learner.scales[i];
        low = -high;
    } else if (kind != AREA) {
        const int pulling = place_of(a, k, AREA);
        const mck_real area = pulling < 0 ? MCK_R(1.0) : theta[pulling];
        if (kind == STIFFNESS) {
            low = mck_max(low, area / a->bounds[2 * k + 1]);
        } else if (kind == FRICTION) {
            high = mck_min(high, area * a->bounds[2 * k]);
        }
    }
    return mck_clip(theta[i], low, high) - theta[i];
}

/* Bring parameters into what a balance can have; the others go along as they are known to go together,
 * which may not be possible twice. */
static void keep_balanced(adapting *a)
{
    const int p = a->learner.p;
    const mck_real *scales = a->learner.scales;
    mck_real *along = a->learnt.work;
    mck_real *one = along + p;
    for (int turn = 0; turn < 2; turn++) {
        for (int i = 0; i < p; i++) {
            const mck_real lacks = short_of(a, i);
            if (!(mck_abs(lacks) > MCK_R(0.0))) {
                continue;
            }
            if (turn > 0) {
                a->learnt.theta[i] += lacks;
                continue;
            }
            for (int j = 0; j < p; j++) {
                one[j] = j == i ? MCK_R(1.0) : MCK_R(0.0);
            }
            covariant(p, a->learnt.root, one, along);
            for (int j = 0; j < p; j++) {
                a->learnt.theta[j] += lacks * scales[j] / scales[i] * along[j] / along[i];
            }
        }
    }
}

void mck_balance_adaptive_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    adapting a = read_adapting(part, state);
    mck_balance_start(&a.fitted, state, in);
    mck_real *last = a.y;
    while (last < a.learnt.theta) {
        *last = MCK_R(0.0);
        last++;
    }
    mck_learnt_start(&a.learner, &a.learnt, a.now.n);
}

void mck_balance_adaptive_step(const mck_part *part, mck_real *state, const mck_real *in,
                               mck_real *out)
{
    adapting a = read_adapting(part, state);
    const int n = a.now.n;
    const int n_x = a.now.n_x + a.now.n_loads;
    const mck_real *measured = in + n + n_x;
    int taught = 0;
    retune(&a);
    a.now.muscles = a.muscles;
    fill_slopes(&a);
    for (int k = 0; k < n; k++) {
        const mck_real asked = a.y[k] - a.now.tare[k];
        mck_real believed = asked;
        mck_real expected = asked;
        answer(&a, k);
        for (int i = 0; i < a.learner.p; i++) {
            believed += a.learnt.work[i] * (a.learnt.theta[i] - a.learnt.used[i]);
            expected += a.learnt.work[i] * (a.learner.fitted[i] - a.learnt.used[i]);
        }
        taught |= mck_learn(&a.learner, &a.learnt, a.learnt.sense + MCK_SENSES * k, measured[k],
                            believed, asked, expected);
    }
    if (taught) {
        pull_back(&a);
        keep_balanced(&a);
        const mck_real share = mck_trusted(&a.learnt, n);
        for (int i = 0; i < a.learner.p; i++) {
            const mck_real fitted = a.learner.fitted[i];
            a.learnt.used[i] = fitted + share * (a.learnt.theta[i] - fitted);
        }
        retune(&a);
    }
    mck_balance_press(&a.now, in, out);
    for (int k = 0; k < n; k++) {
        a.y[k] = a.now.scratch[k];
        a.p[k] = out[k];
    }
    for (int i = 0; i < n_x; i++) {
        a.x[i] = in[n + i];
    }
}
