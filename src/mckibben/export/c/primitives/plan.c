#include "plan.h"

#include "supply.h"

#define MOST_STEPS 30
#define CLOSED MCK_EITHER(1e-11, 1e-7)
#define STAYING MCK_EITHER(1e-9, 1e-6)
#define ROOM MCK_R(0.3)

typedef struct {
    int length;
    int n;
    int m;
    const mck_real *rows;
    const mck_real *before;
    mck_real *hessian;
    mck_real *off;
    mck_real *factors;
    mck_real *wished;
    mck_real *right;
    mck_real *step;
    mck_real *room;
    mck_real *price;
    mck_real *shortage;
    mck_real *goal;
    mck_real *room_step;
    mck_real *price_step;
    mck_real *work;
} horizon;

/* Invert a positive definite matrix by Gauss and Jordan; destroys it. */
static void invert_small(int n, mck_real *matrix, mck_real *result)
{
    for (int i = 0; i < n * n; i++) {
        result[i] = MCK_R(0.0);
    }
    for (int i = 0; i < n; i++) {
        result[i * n + i] = MCK_R(1.0);
    }
    for (int i = 0; i < n; i++) {
        const mck_real pivot = MCK_R(1.0) / matrix[i * n + i];
        for (int j = 0; j < n; j++) {
            matrix[i * n + j] *= pivot;
            result[i * n + j] *= pivot;
        }
        for (int row = 0; row < n; row++) {
            const mck_real share = matrix[row * n + i];
            for (int j = 0; j < n && row != i; j++) {
                matrix[row * n + j] -= share * matrix[i * n + j];
                result[row * n + j] -= share * result[i * n + j];
            }
        }
    }
}

/* Add to y a matrix times x and a number. */
static void applied(int n, const mck_real *matrix, const mck_real *x, mck_real scale, mck_real *y)
{
    for (int i = 0; i < n; i++) {
        mck_real total = MCK_R(0.0);
        for (int j = 0; j < n; j++) {
            total += matrix[i * n + j] * x[j];
        }
        y[i] += scale * total;
    }
}

/* Sums of products of two n by n matrices. */
static void times(int n, const mck_real *a, const mck_real *b, mck_real *result)
{
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++) {
            mck_real total = MCK_R(0.0);
            for (int k = 0; k < n; k++) {
                total += a[i * n + k] * b[k * n + j];
            }
            result[i * n + j] = total;
        }
    }
}

/* Add what limits of the samples t and, of changes, t + 1 weigh. */
static void weigh(const horizon *h, int t, mck_real *matrix)
{
    const int n = h->n;
    mck_real *off = h->off + t * n * n;
    for (int later = 0; later < 2 && t + later < h->length; later++) {
        for (int i = 0; i < h->m; i++) {
            const mck_real *row = h->rows + i * (n + 2);
            const int changes = row[0] > MCK_R(0.0);
            const int place = (t + later) * h->m + i;
            if (later == 0 || changes) {
                const mck_real weight = h->price[place] / h->room[place];
                for (int j = 0; j < n; j++) {
                    for (int k = 0; k < n; k++) {
                        const mck_real added = weight * row[2 + j] * row[2 + k];
                        matrix[j * n + k] += added;
                        if (later == 0 && changes) {
                            off[j * n + k] -= added;
                        }
                    }
                }
            }
        }
    }
}

/* Factor the system of one step: inverses along the diagonal. */
static void factor(const horizon *h)
{
    const int block = h->n * h->n;
    mck_real *matrix = h->work;
    mck_real *product = matrix + block;
    for (int t = 0; t < h->length; t++) {
        mck_real *off = h->off + t * block;
        mck_real *own = h->factors + t * block;
        for (int i = 0; i < block; i++) {
            matrix[i] = h->hessian[t * block + i];
            off[i] = MCK_R(0.0);
        }
        weigh(h, t, matrix);
        if (t > 0) {
            times(h->n, own - block, off, product);
            times(h->n, off, product, own);
            for (int i = 0; i < block; i++) {
                matrix[i] -= own[i];
            }
        }
        invert_small(h->n, matrix, own);
    }
}

/* Solve for one step of pressures, of the room that limits leave, and of their prices. */
static void move(const horizon *h)
{
    const int n = h->n;
    const int block = n * n;
    mck_real *none = h->work;
    mck_real *forward = none + n;
    for (int k = 0; k < n; k++) {
        none[k] = MCK_R(0.0);
    }
    for (int i = 0; i < h->length * n; i++) {
        h->step[i] = h->right[i];
    }
    for (int t = 0; t < h->length; t++) {
        mck_real *step = h->step + t * n;
        for (int i = 0; i < h->m; i++) {
            const int place = t * h->m + i;
            const mck_real *row = h->rows + i * (n + 2);
            const mck_real pull = h->goal[place] - h->price[place] +
                                  h->price[place] / h->room[place] * h->shortage[place];
            for (int k = 0; k < n; k++) {
                step[k] -= pull * row[2 + k];
                if (t > 0 && row[0] > MCK_R(0.0)) {
                    step[k - n] += pull * row[2 + k];
                }
            }
        }
    }
    for (int t = 0; t < h->length; t++) {
        mck_real *step = h->step + t * n;
        for (int k = 0; k < n; k++) {
            forward[k] = step[k];
        }
        if (t > 0) {
            applied(n, h->off + t * block, step - n, MCK_R(-1.0), forward);
        }
        for (int k = 0; k < n; k++) {
            step[k] = MCK_R(0.0);
        }
        applied(n, h->factors + t * block, forward, MCK_R(1.0), step);
    }
    for (int t = h->length - 2; t >= 0; t--) {
        mck_real *step = h->step + t * n;
        for (int k = 0; k < n; k++) {
            forward[k] = MCK_R(0.0);
        }
        applied(n, h->off + (t + 1) * block, step + n, MCK_R(1.0), forward);
        applied(n, h->factors + t * block, forward, MCK_R(-1.0), step);
    }
    for (int t = 0; t < h->length; t++) {
        const mck_real *step = h->step + t * n;
        for (int i = 0; i < h->m; i++) {
            const int place = t * h->m + i;
            const mck_real change =
                mck_weighed(n, h->rows + i * (n + 2), t == 0 ? none : step - n, step);
            h->room_step[place] = -h->shortage[place] - change;
            h->price_step[place] = h->goal[place] - h->price[place] -
                                   h->price[place] / h->room[place] * h->room_step[place];
        }
    }
}

/* The share of a step, at most 1, at which the first value becomes 0. */
static mck_real furthest(int count, const mck_real *values, const mck_real *steps)
{
    mck_real share = MCK_R(1.0);
    for (int i = 0; i < count; i++) {
        if (steps[i] < MCK_R(0.0)) {
            share = mck_min(share, -values[i] / steps[i]);
        }
    }
    return share;
}

/* The quadratic form, over the mean squared slope, and where limits leave room at the start. */
static void begin(const horizon *h, const mck_real *slopes, const mck_real *nominal,
                  const mck_real *errors, mck_real *p)
{
    const int n = h->n;
    const int block = n * n;
    mck_real size = MCK_R(0.0);
    for (int i = 0; i < h->length * block; i++) {
        size += slopes[i] * slopes[i];
    }
    size = mck_max(size / (mck_real)(h->length * n), MCK_R(1e-30));
    for (int t = 0; t < h->length; t++) {
        const mck_real *slope = slopes + t * block;
        mck_real *own = h->hessian + t * block;
        for (int i = 0; i < n; i++) {
            for (int j = 0; j < n; j++) {
                mck_real total = MCK_R(0.0);
                for (int k = 0; k < n; k++) {
                    total += slope[k * n + i] * slope[k * n + j];
                }
                own[i * n + j] = total / size;
            }
            own[i * n + i] += STAYING; /* where nothing pulls, stay */
        }
        for (int i = 0; i < n; i++) {
            mck_real pull = MCK_R(0.0);
            for (int k = 0; k < n; k++) {
                pull += slope[k * n + i] * errors[t * n + k] / size;
                pull += own[i * n + k] * nominal[t * n + k];
            }
            h->wished[t * n + i] = pull;
            p[t * n + i] = nominal[t * n + i];
        }
        for (int i = 0; i < h->m; i++) {
            const mck_real *row = h->rows + i * (n + 2);
            const mck_real *last = t == 0 ? h->before : p + (t - 1) * n;
            h->room[t * h->m + i] = mck_max(row[1] - mck_weighed(n, row, last, p + t * n), ROOM);
            h->price[t * h->m + i] = ROOM;
        }
    }
}

/* What the pressures' gradient lacks, and what rooms are off; returns 1 where a plan is found. */
static int lack(const horizon *h, const mck_real *p, mck_real *gap)
{
    const int n = h->n;
    mck_real amiss = MCK_R(0.0);
    *gap = MCK_R(0.0);
    for (int i = 0; i < h->length * n; i++) {
        h->right[i] = h->wished[i];
    }
    for (int t = 0; t < h->length; t++) {
        mck_real *right = h->right + t * n;
        applied(n, h->hessian + t * n * n, p + t * n, MCK_R(-1.0), right);
    }
    for (int t = 0; t < h->length; t++) {
        mck_real *right = h->right + t * n;
        for (int i = 0; i < h->m; i++) {
            const int place = t * h->m + i;
            const mck_real *row = h->rows + i * (n + 2);
            const mck_real *last = t == 0 ? h->before : p + (t - 1) * n;
            h->shortage[place] = mck_weighed(n, row, last, p + t * n) + h->room[place] - row[1];
            amiss = mck_max(amiss, mck_abs(h->shortage[place]));
            *gap += h->room[place] * h->price[place];
            for (int k = 0; k < n; k++) {
                right[k] -= h->price[place] * row[2 + k];
                if (t > 0 && row[0] > MCK_R(0.0)) {
                    right[k - n] += h->price[place] * row[2 + k];
                }
            }
        }
    }
    *gap /= (mck_real)(h->length * h->m);
    return *gap <= CLOSED && amiss * amiss <= CLOSED;
}

/* One step of Mehrotra's: where a step to no gap at all would lead, then one that aims for less; returns
 * 0 where rounding leaves none. */
static int advance(const horizon *h, mck_real gap, mck_real *p)
{
    const int count = h->length * h->m;
    factor(h);
    for (int i = 0; i < count; i++) {
        h->goal[i] = MCK_R(0.0);
    }
    move(h);
    mck_real share = furthest(count, h->room, h->room_step);
    mck_real dear = furthest(count, h->price, h->price_step);
    mck_real then = MCK_R(0.0);
    for (int i = 0; i < count; i++) {
        then += (h->room[i] + share * h->room_step[i]) * (h->price[i] + dear * h->price_step[i]);
    }
    then = then / (mck_real)count / gap;
    const mck_real centre = gap * then * then * then;
    for (int i = 0; i < count; i++) {
        h->goal[i] = (centre - h->room_step[i] * h->price_step[i]) / h->room[i];
    }
    move(h);
    share = mck_min(furthest(count, h->room, h->room_step),
                    furthest(count, h->price, h->price_step));
    share *= MCK_R(0.99);
    mck_real size = MCK_R(0.0);
    for (int i = 0; i < h->length * h->n; i++) {
        size += mck_abs(h->step[i]);
    }
    if (!(size < MCK_INFINITY)) { /* as near as rounding lets it come */
        return 0;
    }
    for (int i = 0; i < h->length * h->n; i++) {
        p[i] += share * h->step[i];
    }
    for (int i = 0; i < count; i++) {
        h->room[i] += share * h->room_step[i];
        h->price[i] += share * h->price_step[i];
    }
    return 1;
}

int mck_plan(int length, int n, int n_rows, const mck_real *rows, const mck_real *before,
             const mck_real *slopes, const mck_real *nominal, const mck_real *errors, mck_real *p,
             mck_real *scratch)
{
    const int block = n * n;
    const int count = length * n_rows;
    horizon h;
    h.length = length;
    h.n = n;
    h.m = n_rows;
    h.rows = rows;
    h.before = before;
    h.hessian = scratch;
    h.off = h.hessian + length * block;
    h.factors = h.off + length * block;
    h.wished = h.factors + length * block;
    h.right = h.wished + length * n;
    h.step = h.right + length * n;
    h.room = h.step + length * n;
    h.price = h.room + count;
    h.shortage = h.price + count;
    h.goal = h.shortage + count;
    h.room_step = h.goal + count;
    h.price_step = h.room_step + count;
    h.work = h.price_step + count;
    begin(&h, slopes, nominal, errors, p);
    int taken = 0;
    mck_real gap;
    while (taken < MOST_STEPS && !lack(&h, p, &gap) && advance(&h, gap, p)) {
        taken++;
    }
    return taken;
}
