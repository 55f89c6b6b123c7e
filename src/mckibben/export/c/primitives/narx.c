#include "narx.h"

#include "operators.h"

#define HEAD 7
#define PLACES 1201 /* where rest is looked for, from -1.5 to 1.5 */

int mck_narx_head(const mck_part *part) { return HEAD + (int)part->coefficients[2]; }

static mck_real scaled(const mck_part *part, mck_real u)
{
    return (u - part->coefficients[3]) / part->coefficients[4];
}

static void rest_at(const mck_part *part, mck_real *state, mck_real y)
{
    for (int i = 0; i < (int)part->coefficients[0]; i++) {
        state[i] = y;
    }
}

static mck_real place(int k) { return MCK_R(-1.5) + (mck_real)k * MCK_R(0.0025); }

static mck_real change_at(mck_regression regression, const mck_part *part, mck_real *state, int k)
{
    rest_at(part, state, place(k));
    return regression(part, state) - place(k);
}

static int sign(mck_real x) { return (x > MCK_R(0.0)) - (x < MCK_R(0.0)); }

/* How many places have a crossing behind them; `at` becomes the one of the number asked for. */
static int crossings(mck_regression regression, const mck_part *part, mck_real *state, int wanted,
                     int *at)
{
    int found = 0;
    mck_real before = change_at(regression, part, state, 0);
    for (int k = 1; k < PLACES; k++) {
        const mck_real change = change_at(regression, part, state, k);
        if (sign(change) != sign(before)) {
            if (found == wanted) {
                *at = k - 1;
            }
            found++;
        }
        before = change;
    }
    return found;
}

static mck_real least_change(mck_regression regression, const mck_part *part, mck_real *state)
{
    int best = 0;
    mck_real least = mck_abs(change_at(regression, part, state, 0));
    for (int k = 1; k < PLACES; k++) {
        const mck_real change = mck_abs(change_at(regression, part, state, k));
        if (change < least) {
            least = change;
            best = k;
        }
    }
    return place(best);
}

void mck_narx_start(mck_regression regression, const mck_part *part, mck_real *state, mck_real u)
{
    const int n_out = (int)part->coefficients[0];
    const int n_in = (int)part->coefficients[1];
    const int n_plays = (int)part->coefficients[2];
    const mck_real x = scaled(part, u);
    for (int i = 0; i < n_in; i++) {
        state[n_out + i] = x;
    }
    mck_operators_start(part->start, n_plays, part->coefficients + HEAD, x, x,
                        state + n_out + n_in);
    int at = 0;
    const int found = crossings(regression, part, state, 0, &at);
    if (found == 0) {
        rest_at(part, state, least_change(regression, part, state));
        return;
    }
    if (part->start == MCK_VIRGIN) {
        (void)crossings(regression, part, state, found / 2, &at);
    }
    const mck_real here = change_at(regression, part, state, at);
    const mck_real rise = change_at(regression, part, state, at + 1) - here;
    const mck_real share = sign(rise) == 0 ? MCK_R(0.0) : -here / rise;
    rest_at(part, state, place(at) + share * MCK_R(0.0025));
}

mck_real mck_narx_step(mck_regression regression, const mck_part *part, mck_real *state, mck_real u)
{
    const int n_out = (int)part->coefficients[0];
    const int n_in = (int)part->coefficients[1];
    const int n_plays = (int)part->coefficients[2];
    const mck_real x = scaled(part, u);
    mck_real *inputs = state + n_out;
    mck_real *plays = inputs + n_in;
    for (int i = n_in - 1; i > 0; i--) {
        inputs[i] = inputs[i - 1];
    }
    if (n_in > 0) {
        inputs[0] = x;
    }
    for (int i = 0; i < n_plays; i++) {
        plays[i] = mck_play(plays[i], x, part->coefficients[HEAD + i]);
    }
    const mck_real y = regression(part, state);
    for (int i = n_out - 1; i > 0; i--) {
        state[i] = state[i - 1];
    }
    if (n_out > 0) {
        state[0] = y;
    }
    return part->coefficients[5] + part->coefficients[6] * y;
}
