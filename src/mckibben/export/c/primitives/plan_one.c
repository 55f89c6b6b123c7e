#include "plan_one.h"

#define FAR MCK_R(1e30)
#define STAYING MCK_R(1e-6)

typedef struct {
    int count;
    mck_real *x; /* knots of the derivative, */
    mck_real *d; /* and its values */
    mck_real low;
    mck_real high;
    mck_real fall;
    mck_real rise;
} curve;

static void read_limits(curve *v, int n_rows, const mck_real *rows)
{
    v->low = -FAR;
    v->high = FAR;
    for (int i = 0; i < n_rows; i++) {
        const mck_real *row = rows + 3 * i;
        const mck_real end = row[1] / row[2];
        if (!(row[0] > MCK_R(0.0))) {
            if (row[2] > MCK_R(0.0)) {
                v->high = mck_min(v->high, end);
            } else {
                v->low = mck_max(v->low, end);
            }
        }
    }
    v->rise = v->high - v->low;
    v->fall = v->rise;
    for (int i = 0; i < n_rows; i++) {
        const mck_real *row = rows + 3 * i;
        const mck_real end = row[1] / row[2];
        if (row[0] > MCK_R(0.0)) {
            if (row[2] > MCK_R(0.0)) {
                v->rise = mck_min(v->rise, end);
            } else {
                v->fall = mck_min(v->fall, -end);
            }
        }
    }
}

/* Where the derivative passes 0, within the range; `place` is the first knot beyond, `at` its value. */
static mck_real turn(const curve *v, int *place, mck_real *at)
{
    const int count = v->count;
    const mck_real *x = v->x;
    const mck_real *d = v->d;
    mck_real least;
    int i = 0;
    while (i < count && !(d[i] > MCK_R(0.0))) {
        i++;
    }
    int cut = i == 0 || i == count;
    if (cut) {
        least = x[i == 0 ? 0 : count - 1];
    } else {
        least = x[i - 1] - d[i - 1] * (x[i] - x[i - 1]) / (d[i] - d[i - 1]);
    }
    const mck_real inside = mck_clip(least, v->low, v->high);
    cut |= inside < least || inside > least;
    *at = MCK_R(0.0);
    if (cut) {
        i = 0;
        while (i < count && !(x[i] > inside)) {
            i++;
        }
        if (i == 0 || i == count) {
            *at = d[i == 0 ? 0 : count - 1];
        } else {
            const mck_real share = (inside - x[i - 1]) / (x[i] - x[i - 1]);
            *at = d[i - 1] + share * (d[i] - d[i - 1]);
        }
    }
    *place = i;
    return inside;
}

/* Move what lies below the minimum by the furthest rise, and what lies above by the furthest fall. */
static void part(curve *v, int place, mck_real least, mck_real at)
{
    for (int i = v->count - 1; i >= place; i--) {
        v->x[i + 4] = v->x[i] + v->fall;
        v->d[i + 4] = mck_max(v->d[i], MCK_R(0.0));
    }
    for (int i = 0; i < place; i++) {
        v->x[i] -= v->rise;
        v->d[i] = mck_min(v->d[i], MCK_R(0.0));
    }
    v->x[place] = least - v->rise;
    v->x[place + 1] = least - v->rise;
    v->x[place + 2] = least + v->fall;
    v->x[place + 3] = least + v->fall;
    v->d[place] = mck_min(at, MCK_R(0.0));
    v->d[place + 1] = MCK_R(0.0);
    v->d[place + 2] = MCK_R(0.0);
    v->d[place + 3] = mck_max(at, MCK_R(0.0));
    v->count += 4;
}

void mck_plan_one(int length, int n_rows, const mck_real *rows, mck_real before,
                  const mck_real *slopes, const mck_real *nominal, const mck_real *errors,
                  mck_real *p, mck_real *scratch)
{
    const int most = 4 * length + 2;
    mck_real *best = scratch + 2 * most;
    int place;
    mck_real at;
    curve v;
    mck_real size = MCK_R(0.0);
    for (int t = 0; t < length; t++) {
        size += slopes[t] * slopes[t];
    }
    const mck_real staying = STAYING * mck_max(size / (mck_real)length, STAYING);
    v.count = 2;
    v.x = scratch;
    v.d = scratch + most;
    read_limits(&v, n_rows, rows);
    v.x[0] = v.low;
    v.x[1] = v.high;
    v.d[0] = MCK_R(0.0);
    v.d[1] = MCK_R(0.0);
    for (int t = length - 1; t >= 0; t--) {
        if (t + 1 < length) {
            best[t + 1] = turn(&v, &place, &at);
            part(&v, place, best[t + 1], at);
        }
        const mck_real weight = slopes[t] * slopes[t] + staying;
        const mck_real wished = weight * nominal[t] + slopes[t] * errors[t];
        for (int i = 0; i < v.count; i++) {
            v.d[i] += weight * v.x[i] - wished;
        }
    }
    best[0] = turn(&v, &place, &at);
    mck_real last = before;
    for (int t = 0; t < length; t++) {
        last = mck_clip(mck_clip(best[t], last - v.fall, last + v.rise), v.low, v.high);
        p[t] = last;
    }
}
