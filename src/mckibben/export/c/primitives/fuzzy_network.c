#include "fuzzy_network.h"

#include "linear_system.h"

#define MOST_STEPS 40
#define REACHED MCK_EITHER(1e-9, 1e-4) /* residuals below are not clipped samples */

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

/* What the coefficients hold. */
typedef struct {
    int n;     /* all inputs */
    int n_out; /* outputs */
    int constant;
    int most; /* sets of an input, at most */
    const mck_real *sets;
    const mck_real *centres;
    const mck_real *widths;
    const mck_real *consequents;
} network;

static network read_network(const mck_real *c)
{
    network net;
    int n_sets = 0;
    net.n = (int)c[0];
    net.n_out = (int)c[1];
    net.constant = c[3] > MCK_R(0.0);
    net.most = (int)c[4];
    net.sets = c + 5;
    for (int i = 0; i < net.n; i++) {
        n_sets += (int)net.sets[i];
    }
    net.centres = net.sets + net.n;
    net.widths = net.centres + n_sets;
    net.consequents = net.widths + n_sets;
    return net;
}

/* The memberships of inputs `first` to `last` alone, where x begins at the first of these; returns
 * how many combinations of their sets there are. */
static int memberships_between(const network *net, int first, int last, const mck_real *x,
                               mck_real *memberships)
{
    int at = 0;
    int combinations = 1;
    for (int i = 0; i < last; i++) {
        const int own = (int)net->sets[i];
        if (i >= first) {
            memberships_of(x[i - first], own, net->centres + at, net->widths + at,
                           memberships + i * net->most);
            combinations *= own;
        }
        at += own;
    }
    return combinations;
}

/* The product of memberships of inputs `first` to `last` in one combination of their sets. */
static mck_real firing_of(const network *net, int first, int last, int combination,
                          const mck_real *memberships)
{
    mck_real firing = MCK_R(1.0);
    for (int i = last - 1; i >= first; i--) {
        const int own = (int)net->sets[i];
        firing *= memberships[i * net->most + combination % own];
        combination /= own;
    }
    return firing;
}

/* The outputs at one input sample; `memberships` has room for inputs times most sets. */
static void answer(const mck_real *c, const mck_real *x, mck_real *memberships, mck_real *y)
{
    const network net = read_network(c);
    const int n_rules = memberships_between(&net, 0, net.n, x, memberships);
    const mck_real *row = net.consequents;
    for (int j = 0; j < net.n_out; j++) {
        y[j] = MCK_R(0.0);
    }
    for (int rule = 0; rule < n_rules; rule++) {
        const mck_real firing = firing_of(&net, 0, net.n, rule, memberships);
        if (firing > MCK_NOTHING) {
            for (int j = 0; j < net.n_out; j++) {
                mck_real total = net.constant ? row[net.n] : MCK_R(0.0);
                for (int i = 0; i < net.n; i++) {
                    total += row[i] * x[i];
                }
                y[j] += firing * total;
                row += net.n + net.constant;
            }
        } else {
            row += net.n_out * (net.n + net.constant);
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
    int m;       /* driven inputs */
    int n_rules; /* of the driven inputs */
    const mck_real *low;
    const mck_real *high;
    network net;
    mck_real *memberships;
    mck_real *tilts; /* their slopes, relative to them */
    mck_real *tilt;  /* those of one rule */
    mck_real *left;  /* rules of the driven inputs that are left in this sample */
    mck_real *x;
    mck_real *y;
    mck_real *best;
    mck_real *direction;
    mck_real *kept;
    mck_real *slopes;
} workspace;

static workspace work_in(const mck_part *part, mck_real *state)
{
    workspace w;
    w.m = part->n_states - 1;
    w.low = part->coefficients;
    w.high = w.low + w.m;
    w.net = read_network(w.high + w.m);
    w.n_rules = 1;
    for (int i = 0; i < w.m; i++) {
        w.n_rules *= (int)w.net.sets[i];
    }
    w.memberships = state + part->n_states;
    w.tilts = w.memberships + w.net.n * w.net.most;
    w.tilt = w.tilts + w.m * w.net.most;
    w.left = w.tilt + w.m;
    w.x = w.left + w.n_rules * w.m * (w.m + 1);
    w.y = w.x + w.m;
    w.best = w.y + w.m;
    w.direction = w.best + w.m;
    w.kept = w.direction + w.m;
    w.slopes = w.kept + w.m;
    return w;
}

/* The rules that are left where what schedules is known: every one is the mean of those it stands
 * for, weighted by their firing. A row an output: coefficients of the driven inputs, and a constant. */
static void contract(const workspace *w, const mck_real *scheduling)
{
    const network *net = &w->net;
    const int m = w->m;
    const int n_known = memberships_between(net, m, net->n, scheduling, w->memberships);
    for (int place = 0; place < w->n_rules * m * (m + 1); place++) {
        w->left[place] = MCK_R(0.0);
    }
    for (int known = 0; known < n_known; known++) {
        const mck_real firing = firing_of(net, m, net->n, known, w->memberships);
        mck_real *left = w->left;
        for (int rule = 0; rule < w->n_rules; rule++) {
            const mck_real *row = net->consequents +
                                  (rule * n_known + known) * m * (net->n + net->constant);
            for (int j = 0; j < m; j++) {
                mck_real total = net->constant ? row[net->n] : MCK_R(0.0);
                for (int i = m; i < net->n; i++) {
                    total += row[i] * scheduling[i - m];
                }
                for (int i = 0; i < m; i++) {
                    left[i] += firing * row[i];
                }
                left[m] += firing * total;
                left += m + 1;
                row += net->n + net->constant;
            }
        }
    }
}

/* Slopes of the logarithms of memberships at x. */
static void fill_tilts(const workspace *w)
{
    int at = 0;
    for (int i = 0; i < w->m; i++) {
        const int own = (int)w->net.sets[i];
        const mck_real *memberships = w->memberships + i * w->net.most;
        mck_real *tilts = w->tilts + i * w->net.most;
        mck_real mean = MCK_R(0.0);
        for (int s = 0; s < own; s++) {
            const mck_real width = w->net.widths[at + s];
            tilts[s] = (w->x[i] - w->net.centres[at + s]) / (width * width);
            mean += memberships[s] * tilts[s];
        }
        for (int s = 0; s < own; s++) {
            tilts[s] = mean - tilts[s];
        }
        at += own;
    }
}

/* What one rule of the driven inputs adds to the outputs, and to their slopes. */
static void add_rule(const workspace *w, mck_real firing, const mck_real *left)
{
    const int m = w->m;
    for (int j = 0; j < m; j++) {
        mck_real total = left[m];
        for (int i = 0; i < m; i++) {
            total += left[i] * w->x[i];
        }
        w->y[j] += firing * total;
        for (int i = 0; i < m; i++) {
            w->slopes[j * m + i] += firing * (left[i] + w->tilt[i] * total);
        }
        left += m + 1;
    }
}

/* What the outputs at x miss, in y, and their slopes by the driven inputs; returns the largest. */
static mck_real miss(const workspace *w, const mck_real *wanted)
{
    const int m = w->m;
    mck_real worst = MCK_R(0.0);
    (void)memberships_between(&w->net, 0, m, w->x, w->memberships);
    fill_tilts(w);
    for (int j = 0; j < m; j++) {
        w->y[j] = MCK_R(0.0);
    }
    for (int place = 0; place < m * m; place++) {
        w->slopes[place] = MCK_R(0.0);
    }
    for (int rule = 0; rule < w->n_rules; rule++) {
        mck_real firing = MCK_R(1.0);
        int rest = rule;
        for (int i = m - 1; i >= 0; i--) {
            const int own = (int)w->net.sets[i];
            const int place = i * w->net.most + rest % own;
            firing *= w->memberships[place];
            w->tilt[i] = w->tilts[place];
            rest /= own;
        }
        if (firing > MCK_NOTHING) {
            add_rule(w, firing, w->left + rule * m * (m + 1));
        }
    }
    for (int j = 0; j < m; j++) {
        w->y[j] -= wanted[j];
        worst = mck_max(worst, mck_abs(w->y[j]));
    }
    return worst;
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
    contract(w, in + m);
    for (int i = 0; i < m; i++) {
        w->x[i] = state[i];
    }
    for (int step = 0; step < MOST_STEPS; step++) {
        const mck_real worst = miss(w, in);
        if (worst < least) {
            /* once at rounding, a step that gains nothing ends the search */
            const int stuck = worst > MCK_R(0.5) * least && worst < solved;
            least = worst;
            for (int i = 0; i < m; i++) {
                w->best[i] = w->x[i];
                w->direction[i] = w->y[i];
            }
            if (stuck || !(worst > MCK_R(0.0))) {
                break;
            }
            mck_eliminate(m, w->slopes, w->direction);
            share = MCK_R(1.0);
        } else if (least < solved) {
            break;
        } else { /* a shorter step from the best */
            share *= MCK_R(0.5);
            if (share < MCK_R(1e-3)) {
                break;
            }
        }
        for (int i = 0; i < m; i++) {
            w->x[i] = mck_clip(w->best[i] - share * w->direction[i], w->low[i], w->high[i]);
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
