#include "preisach.h"

#include "root.h"

#define DEPTH 64

/* Where things are in the state. */
#define CORNERS 2
#define OUTPUTS (CORNERS + DEPTH)
#define LAST_INPUT (OUTPUTS + DEPTH)
#define LAST_OUTPUT (LAST_INPUT + 1)
#define CLIPPED (LAST_OUTPUT + 1)

typedef struct {
    int n;
    const mck_real *levels;
    const mck_real *table; /* E at pairs of levels */
    mck_real offset;
} model;

static model read_model(const mck_part *part)
{
    model m;
    m.n = (int)part->coefficients[0];
    m.levels = part->coefficients + 1;
    m.table = m.levels + m.n;
    m.offset = m.table[m.n * m.n];
    return m;
}

/* The interval of the levels that u lies in; `share` becomes where in it, 0 to 1. */
static int interval(const model *m, mck_real u, mck_real *share)
{
    int low = 0;
    int high = m->n - 2;
    while (low < high) {
        const int middle = (low + high + 1) / 2;
        if (u >= m->levels[middle]) {
            low = middle;
        } else {
            high = middle - 1;
        }
    }
    *share = (u - m->levels[low]) / (m->levels[low + 1] - m->levels[low]);
    return low;
}

/* The weight of all relays within b and a, bilinear between the levels. */
static mck_real everett(const model *m, mck_real a, mck_real b)
{
    mck_real x;
    mck_real y;
    const int i = interval(m, a, &x);
    const int j = interval(m, b, &y);
    const mck_real *below = m->table + i * m->n;
    const mck_real *above = below + m->n;
    if (i == j) {
        return above[i] * (x - y);
    }
    const mck_real low = below[j] * (MCK_R(1.0) - y) + below[j + 1] * y;
    const mck_real high = above[j] * (MCK_R(1.0) - y) + above[j + 1] * y;
    return low * (MCK_R(1.0) - x) + high * x;
}

static int same(mck_real a, mck_real b) { return !(a < b) && !(a > b); }

/* The input for which E between it and the turning point `other` is `target`. */
static mck_real solve(const model *m, mck_real target, mck_real other, int rising)
{
    mck_real share;
    const int j = interval(m, other, &share);
    mck_real near = other;
    mck_real near_e = MCK_R(0.0);
    for (int step = 0; step < m->n; step++) {
        const int k = rising ? j + 1 + step : j - step;
        if (k < 0 || k >= m->n) {
            break;
        }
        const mck_real far = m->levels[k];
        if (same(far, near)) {
            continue;
        }
        const mck_real far_e = rising ? everett(m, far, other) : everett(m, other, far);
        if (far_e >= target || k == 0 || k == m->n - 1) {
            if (same(far_e, near_e)) {
                return far;
            }
            return near + (far - near) * (target - near_e) / (far_e - near_e);
        }
        near = far;
        near_e = far_e;
    }
    return near;
}

/* Remember a turning point where the direction changes; more than fit are forgotten in pairs. A memory
 * that was put there from elsewhere may hold anything: no place outside is believed. */
static int turn(mck_real *state, mck_real going)
{
    const int known = state[0] >= MCK_R(1.0) && state[0] <= (mck_real)DEPTH;
    int depth = known ? (int)state[0] : 1;
    if (!same(going, state[1])) {
        if (depth == DEPTH) {
            depth -= 2;
        }
        state[CORNERS + depth] = state[LAST_INPUT];
        state[OUTPUTS + depth] = state[LAST_OUTPUT];
        state[1] = going;
        depth++;
    }
    return depth;
}

static void move(const model *m, mck_real *state, mck_real input)
{
    const mck_real u = mck_clip(input, m->levels[0], m->levels[m->n - 1]);
    if (same(u, state[LAST_INPUT])) {
        return;
    }
    const mck_real going = u > state[LAST_INPUT] ? MCK_R(1.0) : MCK_R(-1.0);
    int depth = turn(state, going);
    while (depth >= 3 && !((u - state[CORNERS + depth - 2]) * going < MCK_R(0.0))) {
        depth -= 2; /* a loop is closed and wiped out */
    }
    state[0] = (mck_real)depth;
    const mck_real corner = state[CORNERS + depth - 1];
    const mck_real y = state[OUTPUTS + depth - 1];
    state[LAST_INPUT] = u;
    if (same(u, corner)) {
        state[LAST_OUTPUT] = y;
    } else if (going > MCK_R(0.0)) {
        state[LAST_OUTPUT] = y + MCK_R(2.0) * everett(m, u, corner);
    } else {
        state[LAST_OUTPUT] = y - MCK_R(2.0) * everett(m, corner, u);
    }
}

void mck_preisach_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    const model m = read_model(part);
    const mck_real low = m.levels[0];
    const mck_real high = m.levels[m.n - 1];
    for (int k = 0; k < part->n_states; k++) {
        state[k] = MCK_R(0.0);
    }
    state[0] = MCK_R(1.0);
    state[1] = MCK_R(1.0);
    state[CORNERS] = low;
    state[OUTPUTS] = m.offset;
    state[LAST_INPUT] = low;
    state[LAST_OUTPUT] = m.offset;
    if (part->start == MCK_VIRGIN) {
        /* swings from end to end, ever less, to the first sample */
        const int swings = DEPTH / 2 - 2;
        const mck_real middle = mck_clip(in[0], low, high);
        for (int k = 0; k < swings; k++) {
            const mck_real share = MCK_R(1.0) - (mck_real)k / (mck_real)(swings - 1);
            move(&m, state, middle + share * (high - middle));
            move(&m, state, middle + share * (low - middle));
        }
    } else {
        move(&m, state, in[0]);
    }
}

void mck_preisach_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out)
{
    const model m = read_model(part);
    move(&m, state, in[0]);
    out[0] = state[LAST_OUTPUT];
}

void mck_preisach_inverse_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    const model m = read_model(part);
    const mck_real u = mck_first_input(mck_preisach_start, mck_preisach_step, part, state, in[0],
                                       m.levels[0], m.levels[m.n - 1], 1);
    mck_preisach_start(part, state, &u);
    state[CLIPPED] = MCK_R(0.0);
}

void mck_preisach_inverse_step(const mck_part *part, mck_real *state, const mck_real *in,
                               mck_real *out)
{
    const model m = read_model(part);
    const mck_real bottom = state[OUTPUTS];
    const mck_real size = MCK_R(2.0) * m.table[(m.n - 1) * m.n];
    const mck_real target = mck_clip(in[0], bottom, bottom + size);
    if (mck_abs(target - in[0]) > MCK_SLACK * size) {
        state[CLIPPED] += MCK_R(1.0);
    }
    if (mck_abs(target - state[LAST_OUTPUT]) > MCK_ROUNDING * size) {
        const mck_real going = target > state[LAST_OUTPUT] ? MCK_R(1.0) : MCK_R(-1.0);
        int depth = turn(state, going);
        while (depth >= 3 && (target - state[OUTPUTS + depth - 2]) * going >= MCK_R(0.0)) {
            depth -= 2;
        }
        state[0] = (mck_real)depth;
        const mck_real half = MCK_R(0.5) * mck_abs(target - state[OUTPUTS + depth - 1]);
        const mck_real u = solve(&m, half, state[CORNERS + depth - 1], going > MCK_R(0.0));
        state[LAST_INPUT] = mck_clip(u, m.levels[0], m.levels[m.n - 1]);
        state[LAST_OUTPUT] = target;
    }
    out[0] = state[LAST_INPUT];
}
