#include "force_balance.h"

#include "linear_system.h"

#define ELASTIC 3 /* own elastic terms, y^2 to y^4 */
#define AREA 3    /* terms of the area, y to y^3 */
#define HEAD 7
#define MOST_STEPS 60
#define BALANCED MCK_EITHER(4e-16, 1e-6)
#define NEARLY MCK_EITHER(1e-13, 1e-5)

/* Coefficients and scratch; stops and slopes are n by m. */
typedef struct {
    int n;
    int n_x;
    int degree;
    int m;
    mck_real scale;
    const mck_real *c;
    mck_real *stops;
    mck_real *slopes;
    mck_real *y;
    mck_real *gradient;
} model;

static model read_model(const mck_part *part, mck_real *state)
{
    model m;
    m.c = part->coefficients;
    m.n = (int)m.c[0];
    m.n_x = (int)m.c[1];
    m.degree = (int)m.c[2];
    m.m = (int)m.c[3];
    m.scale = m.c[4];
    m.stops = state + part->n_states;
    m.slopes = m.stops + m.n * m.m;
    m.y = m.slopes + m.n * m.m;
    m.gradient = m.y + m.n;
    return m;
}

/* Numerator and denominator of the pressure of muscle k, the denominator's slope, and the numerator's
 * gradient. */
static mck_real balance(const model *f, int k, const mck_real *x, mck_real *bottom,
                        mck_real *bottom_slope)
{
    const int n_p = 1 + f->n_x * f->degree;
    const int width = n_p * (1 + f->n) + ELASTIC + f->m * n_p;
    const mck_real *own = f->c + HEAD + f->m + k * (width + AREA + f->m);
    const mck_real *elastic = own + n_p * (1 + f->n);
    const mck_real *friction = elastic + ELASTIC;
    const mck_real *area = own + width;
    const mck_real *stops = f->stops + k * f->m;
    const mck_real *slopes = f->slopes + k * f->m;
    mck_real top = MCK_R(0.0);
    for (int j = 0; j < f->n; j++) {
        f->gradient[j] = MCK_R(0.0);
    }
    for (int q = 0; q < n_p; q++) {
        const mck_real *row = own + q * (1 + f->n);
        mck_real power = MCK_R(1.0);
        for (int repeat = 0; q > 0 && repeat < (q - 1) % f->degree + 1; repeat++) {
            power *= x[(q - 1) / f->degree];
        }
        top += power * row[0];
        for (int j = 0; j < f->n; j++) {
            const mck_real gain = power * row[1 + j];
            top += gain * f->y[j];
            f->gradient[j] += gain;
        }
        for (int i = 0; i < f->m; i++) {
            const mck_real gain = power * friction[f->m * q + i];
            top += gain * stops[i];
            f->gradient[k] += gain * slopes[i];
        }
    }
    mck_real power = f->y[k];
    for (int i = 0; i < ELASTIC; i++) {
        f->gradient[k] += (mck_real)(i + 2) * elastic[i] * power;
        power *= f->y[k];
        top += elastic[i] * power;
    }
    power = MCK_R(1.0);
    *bottom = MCK_R(1.0);
    *bottom_slope = MCK_R(0.0);
    for (int i = 0; i < AREA; i++) {
        *bottom_slope += (mck_real)(i + 1) * area[i] * power;
        power *= f->y[k];
        *bottom += area[i] * power;
    }
    for (int i = 0; i < f->m; i++) {
        *bottom += area[AREA + i] * stops[i];
        *bottom_slope += area[AREA + i] * slopes[i];
    }
    return top;
}

/* Move the stops from where the arm was, in the state, to where it is. */
static void strain(const model *f, const mck_real *state)
{
    for (int k = 0; k < f->n; k++) {
        for (int i = 0; i < f->m; i++) {
            const mck_real r = f->c[HEAD + i];
            const int place = k * f->m + i;
            const mck_real value = state[f->n + place] + (f->y[k] - state[k]) / r;
            const int sticks = MCK_R(-1.0) < value && value < MCK_R(1.0);
            f->slopes[place] = sticks ? MCK_R(1.0) / r : MCK_R(0.0);
            f->stops[place] = mck_clip(value, MCK_R(-1.0), MCK_R(1.0));
        }
    }
}

/* Keep where the arm is. */
static void keep(const model *f, mck_real *state)
{
    for (int k = 0; k < f->n; k++) {
        state[k] = f->y[k];
    }
    for (int place = 0; place < f->n * f->m; place++) {
        state[f->n + place] = f->stops[place];
    }
}

void mck_force_balance_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    const model f = read_model(part, state);
    for (int k = 0; k < f.n; k++) {
        state[k] = in[k] / f.scale;
        for (int i = 0; i < f.m; i++) {
            const mck_real loaded = mck_clip(state[k] / f.c[HEAD + i], MCK_R(-1.0), MCK_R(1.0));
            state[f.n + k * f.m + i] = part->start == MCK_VIRGIN ? MCK_R(0.0) : loaded;
        }
    }
    state[part->n_states - 1] = MCK_R(0.0);
}

void mck_force_balance_step(const mck_part *part, mck_real *state, const mck_real *in,
                            mck_real *out)
{
    const model f = read_model(part, state);
    int clipped = 0;
    for (int j = 0; j < f.n; j++) {
        f.y[j] = in[j] / f.scale;
    }
    strain(&f, state);
    for (int k = 0; k < f.n; k++) {
        mck_real bottom;
        mck_real slope;
        const mck_real p = balance(&f, k, in + f.n, &bottom, &slope) / bottom;
        out[k] = mck_clip(p, f.c[5], f.c[6]);
        clipped |= mck_abs(out[k] - p) > MCK_SLACK * (MCK_R(1.0) + mck_abs(p));
    }
    keep(&f, state);
    if (clipped) {
        state[part->n_states - 1] += MCK_R(1.0);
    }
}

/* As if the arm had gone in small steps from its rest to the first pressures. */
void mck_force_balance_inverse_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    const model f = read_model(part, state);
    mck_real *residual = f.gradient + f.n;
    mck_real *steps = residual + f.n + f.n * f.n;
    for (int k = 0; k < part->n_states; k++) {
        state[k] = MCK_R(0.0);
    }
    for (int i = 0; i < f.n_x; i++) {
        steps[f.n + i] = in[f.n + i];
    }
    for (int k = 0; k <= 40; k++) {
        for (int j = 0; j < f.n; j++) {
            steps[j] = (mck_real)k * MCK_R(0.025) * in[j];
        }
        mck_force_balance_inverse_step(part, state, steps, f.y);
    }
    for (int place = f.n; place < part->n_states; place++) {
        if (part->start == MCK_VIRGIN || place == part->n_states - 1) {
            state[place] = MCK_R(0.0);
        }
    }
}

void mck_force_balance_inverse_step(const mck_part *part, mck_real *state, const mck_real *in,
                                    mck_real *out)
{
    const model f = read_model(part, state);
    mck_real *residual = f.gradient + f.n;
    mck_real *matrix = residual + f.n;
    mck_real before = MCK_INFINITY;
    int solved = 0;
    for (int j = 0; j < f.n; j++) {
        f.y[j] = state[j];
    }
    for (int step = 0; step < MOST_STEPS && !solved; step++) {
        mck_real worst = MCK_R(0.0);
        strain(&f, state);
        for (int k = 0; k < f.n; k++) {
            mck_real bottom;
            mck_real slope;
            const mck_real top = balance(&f, k, in + f.n, &bottom, &slope);
            residual[k] = in[k] * bottom - top;
            worst = mck_max(worst, mck_abs(residual[k]));
            for (int j = 0; j < f.n; j++) {
                matrix[k * f.n + j] = f.gradient[j];
            }
            matrix[k * f.n + k] -= in[k] * slope;
        }
        solved = worst <= BALANCED * (MCK_R(1.0) + mck_abs(in[0])) ||
                 (worst >= before && worst < NEARLY);
        before = worst;
        if (!solved) {
            mck_eliminate(f.n, matrix, residual);
            mck_real far = MCK_R(0.0);
            for (int k = 0; k < f.n; k++) {
                far = mck_max(far, mck_abs(residual[k]));
            }
            /* small steps keep to the branch that the arm is on; halved ones break ties at kinks */
            mck_real share =
                far > MCK_R(0.0) ? mck_min(MCK_R(1.0), MCK_R(0.1) / far) : MCK_R(1.0);
            if (step > 20) {
                share *= MCK_R(0.5);
            }
            for (int k = 0; k < f.n; k++) {
                f.y[k] += share * residual[k];
            }
        }
    }
    /* halved steps may leave a residual that is still falling, and next to nothing */
    if (!solved && before >= NEARLY) {
        state[part->n_states - 1] += MCK_R(1.0);
    }
    strain(&f, state);
    keep(&f, state);
    for (int j = 0; j < f.n; j++) {
        out[j] = f.scale * f.y[j];
    }
}
