#include "fuzzy_network.h"

#include "linear_system.h"

#define MOST_STEPS 40
#define DIFFERENCE MCK_EITHER(1e-6, 1e-2) /* of a range, for slopes */
#define REACHED MCK_EITHER(1e-9, 1e-4)    /* residuals below are not clipped samples */

/* Log memberships of one input, then normalised; in the log domain nothing underflows. */
static void memberships_of(mck_real x, int sets, const mck_real *centres, const mck_real *widths,
                           mck_real *memberships)
{
    mck_real largest = -MCK_INFINITY;
    for (int s = 0; s < sets; s++) {
        const mck_real z = (x - centres[s]) / widths[s];
        memberships[s] = MCK_R(-0.5) * z * z;
        largest = mck_max(largest, memberships[s]);
    }
    mck_real total = MCK_R(0.0);
    for (int s = 0; s < sets; s++) {
        memberships[s] = mck_exp(memberships[s] - largest);
        total += memberships[s];
    }
    for (int s = 0; s < sets; s++) {
        memberships[s] /= total;
    }
}

/* The outputs at one input sample; `scratch` has room for inputs times most sets. */
static void answer(const mck_real *c, const mck_real *x, mck_real *scratch, mck_real *y)
{
    const int n = (int)c[0];
    const int n_out = (int)c[1];
    const int constant = c[3] > MCK_R(0.0);
    const int most = (int)c[4];
    const mck_real *sets = c + 5;
    const mck_real *centres = sets + n;
    int n_rules = 1;
    int n_sets = 0;
    for (int i = 0; i < n; i++) {
        n_rules *= (int)sets[i];
        n_sets += (int)sets[i];
    }
    const mck_real *widths = centres + n_sets;
    const mck_real *consequents = widths + n_sets;
    int at = 0;
    for (int i = 0; i < n; i++) {
        memberships_of(x[i], (int)sets[i], centres + at, widths + at, scratch + i * most);
        at += (int)sets[i];
    }
    for (int j = 0; j < n_out; j++) {
        y[j] = MCK_R(0.0);
    }
    for (int rule = 0; rule < n_rules; rule++) {
        mck_real firing = MCK_R(1.0);
        int rest = rule;
        for (int i = n - 1; i >= 0; i--) {
            const int own = (int)sets[i];
            firing *= scratch[i * most + rest % own];
            rest /= own;
        }
        if (firing > MCK_NOTHING) {
            for (int j = 0; j < n_out; j++) {
                mck_real total = constant ? consequents[n] : MCK_R(0.0);
                for (int i = 0; i < n; i++) {
                    total += consequents[i] * x[i];
                }
                y[j] += firing * total;
                consequents += n + constant;
            }
        } else {
            consequents += n_out * (n + constant);
        }
    }
}

void mck_fuzzy_network_step(const mck_part *part, mck_real *state, const mck_real *in,
                            mck_real *out)
{
    answer(part->coefficients, in, state, out);
}

/* What the inverse computes in, behind its state. */
typedef struct {
    int m; /* driven inputs */
    int n; /* all inputs */
    const mck_real *low;
    const mck_real *high;
    const mck_real *network;
    mck_real *memberships;
    mck_real *x;
    mck_real *y;
    mck_real *shifted;
    mck_real *best;
    mck_real *residual;
    mck_real *kept;
    mck_real *matrix;
} workspace;

static workspace work_in(const mck_part *part, mck_real *state)
{
    workspace w;
    w.m = part->n_states - 1;
    w.low = part->coefficients;
    w.high = w.low + w.m;
    w.network = w.high + w.m;
    w.n = (int)w.network[0];
    w.memberships = state + part->n_states;
    w.x = w.memberships + w.n * (int)w.network[4];
    w.y = w.x + w.n;
    w.shifted = w.y + w.m;
    w.best = w.shifted + w.m;
    w.residual = w.best + w.m;
    w.kept = w.residual + w.m;
    w.matrix = w.kept + w.m;
    return w;
}

/* Outputs at x, and what they miss; returns the largest miss. */
static mck_real miss(const workspace *w, const mck_real *wanted)
{
    mck_real worst = MCK_R(0.0);
    answer(w->network, w->x, w->memberships, w->y);
    for (int j = 0; j < w->m; j++) {
        w->residual[j] = w->y[j] - wanted[j];
        worst = mck_max(worst, mck_abs(w->residual[j]));
    }
    return worst;
}

/* Newton's direction, into the residual; slopes by differences. */
static void newton(const workspace *w)
{
    const int m = w->m;
    for (int i = 0; i < m; i++) {
        const mck_real kept = w->x[i];
        const mck_real span = DIFFERENCE * (w->high[i] - w->low[i]);
        const mck_real h = kept + span <= w->high[i] ? span : -span;
        w->x[i] = kept + h;
        answer(w->network, w->x, w->memberships, w->shifted);
        w->x[i] = kept;
        for (int j = 0; j < m; j++) {
            w->matrix[j * m + i] = (w->shifted[j] - w->y[j]) / h;
        }
    }
    mck_eliminate(m, w->matrix, w->residual);
}

static mck_real size_of(const mck_real *wanted, int m)
{
    mck_real size = MCK_R(1.0);
    for (int j = 0; j < m; j++) {
        size = mck_max(size, mck_abs(wanted[j]));
    }
    return size;
}

/* Solve from the last solution; the state becomes the best found. Returns what it misses. */
static mck_real search(const workspace *w, mck_real *state, const mck_real *in)
{
    const int m = w->m;
    const mck_real solved = MCK_SOLVED * size_of(in, m);
    mck_real least = MCK_INFINITY;
    mck_real share = MCK_R(1.0);
    for (int i = 0; i < w->n; i++) {
        w->x[i] = i < m ? state[i] : in[i];
    }
    for (int step = 0; step < MOST_STEPS; step++) {
        const mck_real worst = miss(w, in);
        if (worst < least) {
            /* once at rounding, a step that gains nothing ends the search */
            const int stuck = worst > MCK_R(0.5) * least && worst < solved;
            least = worst;
            for (int i = 0; i < m; i++) {
                w->best[i] = w->x[i];
            }
            if (stuck || !(worst > MCK_R(0.0))) {
                break;
            }
            share = MCK_R(1.0);
        } else if (least < solved) {
            break;
        } else {
            share *= MCK_R(0.5);
            for (int i = 0; i < m; i++) {
                w->x[i] = w->best[i];
            }
            if (share < MCK_R(1e-3)) {
                break;
            }
            (void)miss(w, in);
        }
        newton(w);
        for (int i = 0; i < m; i++) {
            w->x[i] = mck_clip(w->x[i] - share * w->residual[i], w->low[i], w->high[i]);
        }
    }
    for (int i = 0; i < m; i++) {
        state[i] = w->best[i];
    }
    return least;
}

void mck_fuzzy_network_inverse_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    static const mck_real shares[5] = {MCK_R(0.02), MCK_R(0.25), MCK_R(0.5), MCK_R(0.75),
                                       MCK_R(0.98)};
    const workspace w = work_in(part, state);
    mck_real least = MCK_INFINITY;
    for (int i = 0; i < w.m; i++) {
        w.kept[i] = MCK_R(0.5) * (w.low[i] + w.high[i]);
    }
    for (int k = 0; k < 5; k++) {
        for (int i = 0; i < w.m; i++) {
            state[i] = w.low[i] + shares[k] * (w.high[i] - w.low[i]);
        }
        const mck_real missed = search(&w, state, in);
        if (missed < least) {
            least = missed;
            for (int i = 0; i < w.m; i++) {
                w.kept[i] = state[i];
            }
        }
    }
    for (int i = 0; i < w.m; i++) {
        state[i] = w.kept[i];
    }
    state[w.m] = MCK_R(0.0);
}

void mck_fuzzy_network_inverse_step(const mck_part *part, mck_real *state, const mck_real *in,
                                    mck_real *out)
{
    const workspace w = work_in(part, state);
    const mck_real missed = search(&w, state, in);
    for (int i = 0; i < w.m; i++) {
        out[i] = state[i];
    }
    if (missed > REACHED * size_of(in, w.m)) {
        state[w.m] += MCK_R(1.0);
    }
}
