#include "balance_law.h"

#include "linear_system.h"

#define HEAD 16
#define MOST_STEPS 60
#define MOST_SEARCHED 25
#define BALANCED MCK_EITHER(2e-15, 1e-6)
#define SURE MCK_EITHER(1e-11, 1e-5)
#define LEAST_AREA MCK_R(0.01)
#define NEVER MCK_R(1e30)
#define OWN 8
#define HAIR MCK_EITHER(1e-9, 1e-6)

/* Coefficients of one muscle. */
typedef struct {
    mck_real low;
    mck_real high;
    mck_real wall;
    mck_real push;
    mck_real damping;
    mck_real line;
    mck_real bladder;
    mck_real mass;
    const mck_real *springs;
    const mck_real *elasticity;
    const mck_real *areas;
    const mck_real *friction;
    const mck_real *relaxation;
    const mck_real *loads;
} muscle;

mck_balance mck_balance_of(const mck_part *part, mck_real *state)
{
    const mck_real *c = part->coefficients;
    mck_balance f;
    f.n = (int)c[0];
    f.n_x = (int)c[1];
    f.degree = (int)c[2];
    f.n_loads = (int)c[3];
    f.m = (int)c[4];
    f.n_l = (int)c[5];
    f.n_e = (int)c[6];
    f.n_a = (int)c[7];
    f.scale = c[8];
    f.grip = c[9];
    f.lowest = c[10];
    f.highest = c[11];
    f.rate = c[12];
    f.tared = c[13];
    f.fresh = c[14];
    f.heavy = c[15] > MCK_R(0.0);
    f.limits = c + HEAD;
    f.decays = f.limits + f.m;
    f.gains = f.decays + f.n_l;
    f.muscles = f.gains + f.n_l;
    f.u = state;
    f.z = f.u + f.n;
    f.stops = f.z + f.n;
    f.lags = f.stops + f.n * f.m;
    f.moves = f.lags + f.n * f.n_l;
    f.tare = f.moves + (f.heavy ? 2 * f.n : 0);
    f.first = f.tare + f.n;
    f.amiss = f.first + 1;
    f.scratch = state + part->n_states;
    return f;
}

static muscle read_muscle(const mck_balance *f, int k)
{
    const int springs = (1 + f->n_x * f->degree) * (1 + f->n);
    const int width = OWN + springs + f->n_e + f->n_a + f->m + f->n_l + f->n_loads;
    const mck_real *own = f->muscles + k * width;
    muscle one;
    one.low = own[0];
    one.high = own[1];
    one.wall = own[2];
    one.push = own[3];
    one.damping = own[4];
    one.line = own[5];
    one.bladder = own[6];
    one.mass = own[7];
    one.springs = own + OWN;
    one.elasticity = one.springs + springs;
    one.areas = one.elasticity + f->n_e;
    one.friction = one.areas + f->n_a;
    one.relaxation = one.friction + f->m;
    one.loads = one.relaxation + f->n_l;
    return one;
}

/* Springs and loads of a muscle, and their gradient by y. */
static mck_real sprung(const mck_balance *f, const muscle *one, const mck_real *y,
                       const mck_real *x, mck_real *gradient)
{
    const mck_real *row = one->springs;
    mck_real force = row[0];
    for (int j = 0; j < f->n; j++) {
        gradient[j] = row[1 + j];
        force += gradient[j] * y[j];
    }
    for (int i = 0; i < f->n_x; i++) {
        mck_real power = MCK_R(1.0);
        for (int q = 0; q < f->degree; q++) {
            row += 1 + f->n;
            power *= x[i];
            force += power * row[0];
            for (int j = 0; j < f->n; j++) {
                const mck_real spring = power * row[1 + j];
                force += spring * y[j];
                gradient[j] += spring;
            }
        }
    }
    for (int i = 0; i < f->n_loads; i++) {
        force += one->loads[i] * x[f->n_x + i];
    }
    return force;
}

/* A muscle's own spring and elasticity at a shortening, and their slope. */
static mck_real elastic(const mck_balance *f, const muscle *one, mck_real u, mck_real *slope)
{
    const mck_real inside = mck_clip(u, one->low, one->high);
    const mck_real v = inside / f->scale;
    mck_real power = v;
    mck_real value = MCK_R(0.0);
    mck_real slanted = MCK_R(0.0);
    for (int i = 0; i < f->n_e; i++) {
        slanted += (mck_real)(i + 2) * one->elasticity[i] * power;
        power *= v;
        value += one->elasticity[i] * power;
    }
    slanted /= f->scale;
    *slope = slanted + one->bladder;
    return value + slanted * (u - inside) + one->bladder * u;
}

/* Effective area of a muscle, and its slope; beyond what is known it goes on straight. */
static mck_real area(const mck_balance *f, const muscle *one, mck_real y, mck_real *slope)
{
    const mck_real inside = mck_clip(y, one->low, one->high);
    const mck_real u = inside / f->scale;
    const mck_real least = LEAST_AREA * one->areas[0];
    mck_real value = MCK_R(0.0);
    *slope = MCK_R(0.0);
    for (int i = f->n_a - 1; i >= 0; i--) {
        *slope = *slope * u + value;
        value = value * u + one->areas[i];
    }
    *slope /= f->scale;
    value += *slope * (y - inside);
    if (!(value > least)) {
        value = least;
        *slope = MCK_R(0.0);
    }
    return value;
}

/* Friction of muscle k at a displacement and a pressure, and its slopes by both. */
static mck_real rubbed(const mck_balance *f, const muscle *one, int k, int way,
                       mck_real y, mck_real p, mck_real *by_y, mck_real *by_p)
{
    const mck_real grown = mck_max(p + f->grip, MCK_R(0.0));
    const mck_real moved = y + one->wall * p - f->z[k];
    mck_real force = MCK_R(0.0);
    *by_y = MCK_R(0.0);
    *by_p = MCK_R(0.0);
    for (int i = 0; way != MCK_AT_REST && i < f->m; i++) {
        const mck_real h = one->friction[i];
        const mck_real limit = f->limits[i] * grown;
        const mck_real s = f->stops[k * f->m + i] + moved;
        const mck_real held = mck_clip(s, -limit, limit);
        force += h * held;
        if (s > held) {
            *by_p += h * f->limits[i];
        } else if (s < held) {
            *by_p -= h * f->limits[i];
        } else {
            *by_y += h;
            *by_p += h * one->wall;
        }
    }
    return force;
}

/* Relaxation, damping and inertia of muscle k at a displacement, and their slope by it. */
static mck_real lagging(const mck_balance *f, const muscle *one, int k, int way,
                        mck_real y, mck_real *slope)
{
    const mck_real moved = y - f->u[k];
    const mck_real flow =
        area(f, one, mck_clip(f->u[k], one->low, one->high), slope) / one->areas[0];
    const mck_real damping = one->damping + one->line * flow * flow;
    *slope = way == MCK_IN_TIME ? damping * f->rate : MCK_R(0.0);
    mck_real force = *slope * moved;
    if (way == MCK_IN_TIME && f->heavy) {
        const mck_real heavy = one->mass * f->rate * f->rate;
        const mck_real *before = f->moves + 2 * k;
        force += heavy * (MCK_R(2.0) * moved - MCK_R(3.0) * before[0] + before[1]);
        *slope += MCK_R(2.0) * heavy;
    }
    for (int i = 0; way != MCK_AT_REST && i < f->n_l; i++) {
        const mck_real gain = way == MCK_IN_TIME ? f->gains[i] : f->fresh;
        const mck_real q = f->decays[i] * f->lags[k * f->n_l + i] + gain * moved;
        force += one->relaxation[i] * q;
        *slope += one->relaxation[i] * gain;
    }
    return force;
}

/* What muscle k resists with at a shortening and a pressure, its slope, and its size. */
static mck_real resisted(const mck_balance *f, const muscle *one, int k, int way, mck_real u,
                         mck_real p, mck_real *slope, mck_real *size)
{
    mck_real stiff;
    mck_real by_u;
    mck_real by_p;
    mck_real by_moving;
    mck_real a_slope;
    const mck_real stretched = elastic(f, one, u, &stiff);
    const mck_real friction = rubbed(f, one, k, way, u, p, &by_u, &by_p);
    const mck_real behind = lagging(f, one, k, way, u, &by_moving);
    const mck_real given = p * area(f, one, u, &a_slope);
    *slope = stiff + by_u + by_moving - p * a_slope;
    *size = mck_abs(stretched) + mck_abs(friction) + mck_abs(behind) + mck_abs(given);
    return stretched + friction + behind - given;
}

/* How short muscle k is where its ends are y nearer: less, if it is slack. */
static mck_real shortened(const mck_balance *f, const muscle *one, int k, int way, mck_real y,
                          mck_real p)
{
    mck_real slope;
    mck_real size;
    mck_real low = -NEVER;
    mck_real high = y;
    mck_real u = y;
    mck_real reach = MCK_R(1e-3) * f->scale;
    if (one->push >= NEVER) {
        return y;
    }
    mck_real excess = resisted(f, one, k, way, u, p, &slope, &size) - one->push;
    int done = !(excess > MCK_R(0.0));
    for (int step = 0; step < MOST_STEPS && !done; step++) {
        const mck_real guess = slope > MCK_R(0.0) ? u - excess / slope : -NEVER;
        if (low < guess && guess < high) {
            u = guess;
        } else {
            u = low > -NEVER ? MCK_R(0.5) * (low + high) : high - reach;
            reach *= MCK_R(2.0);
        }
        excess = resisted(f, one, k, way, u, p, &slope, &size) - one->push;
        done = mck_abs(excess) <= BALANCED * (size + one->push);
        if (excess > MCK_R(0.0)) {
            high = u;
        } else {
            low = u;
        }
    }
    return u;
}

void mck_balance_keep(const mck_balance *f, int way, const mck_real *y, const mck_real *p)
{
    for (int k = 0; k < f->n; k++) {
        const muscle one = read_muscle(f, k);
        const mck_real u = shortened(f, &one, k, way, y[k], p[k]);
        const mck_real z = u + one.wall * p[k];
        const mck_real grown =
            way != MCK_AT_REST ? mck_max(p[k] + f->grip, MCK_R(0.0)) : MCK_R(0.0);
        for (int i = 0; i < f->m; i++) {
            mck_real *stop = f->stops + k * f->m + i;
            const mck_real limit = f->limits[i] * grown;
            *stop = mck_clip(*stop + z - f->z[k], -limit, limit);
        }
        for (int i = 0; i < f->n_l; i++) {
            mck_real *lag = f->lags + k * f->n_l + i;
            const mck_real gain = way == MCK_IN_TIME ? f->gains[i] : f->fresh;
            const mck_real behind = f->decays[i] * *lag + gain * (u - f->u[k]);
            *lag = way == MCK_AT_REST ? MCK_R(0.0) : behind;
        }
        if (f->heavy) {
            mck_real *before = f->moves + 2 * k;
            before[1] = way == MCK_IN_TIME ? before[0] : MCK_R(0.0);
            before[0] = way == MCK_IN_TIME ? u - f->u[k] : MCK_R(0.0);
        }
        f->u[k] = u;
        f->z[k] = z;
    }
    *f->first = MCK_R(0.0);
}

int mck_balance_way(const mck_balance *f)
{
    return *f->first > MCK_R(0.0) ? MCK_FROM_REST : MCK_IN_TIME;
}

/* The one root of a function that rises piecewise straight. */
mck_real mck_balance_pressed(const mck_balance *f, int k, int way, const mck_real *y,
                             const mck_real *x, mck_real *gradient, int *reached)
{
    const muscle one = read_muscle(f, k);
    mck_real unused;
    const mck_real asked = sprung(f, &one, y, x, gradient);
    *reached = asked >= -one.push;
    mck_real held = mck_max(asked, -one.push) + elastic(f, &one, y[k], &unused);
    held += lagging(f, &one, k, way, y[k], &unused);
    const mck_real a = area(f, &one, y[k], &unused);
    mck_real low = -MCK_INFINITY;
    mck_real high = MCK_INFINITY;
    mck_real p = held / a;
    int found = 0;
    for (int step = 0; step < MOST_STEPS && !found; step++) {
        mck_real by_y;
        mck_real by_p;
        const mck_real force = rubbed(f, &one, k, way, y[k], p, &by_y, &by_p);
        const mck_real excess = p * a - held - force;
        found = mck_abs(excess) <= BALANCED * (mck_abs(p * a) + mck_abs(held) + mck_abs(force));
        if (!found) {
            const mck_real slope = a - by_p;
            if (excess > MCK_R(0.0)) {
                high = p;
            } else {
                low = p;
            }
            p -= excess / (slope > MCK_R(0.0) ? slope : a);
            if (!(low < p && p < high)) { /* only where friction outgrows the area */
                p = MCK_R(0.5) * (low + high);
            }
        }
    }
    return p;
}

mck_real mck_balance_lack(const mck_balance *f, int way, const mck_real *y, const mck_real *x,
                          const mck_real *p, mck_real *residual, mck_real *matrix)
{
    mck_real worst = MCK_R(0.0);
    for (int k = 0; k < f->n; k++) {
        const muscle one = read_muscle(f, k);
        mck_real *row = matrix + k * f->n;
        mck_real slope;
        mck_real size;
        const mck_real force = sprung(f, &one, y, x, row);
        mck_real resisting = resisted(f, &one, k, way, y[k], p[k], &slope, &size);
        if (resisting > one.push) {
            resisting = one.push;
            slope = MCK_R(0.0);
        }
        residual[k] = force + resisting;
        size += mck_abs(force);
        for (int j = 0; j < f->n; j++) {
            size += mck_abs(row[j] * y[j]);
        }
        row[k] += slope;
        if (!(size < MCK_INFINITY)) {
            worst = MCK_INFINITY;
        } else if (size > MCK_R(0.0)) {
            worst = mck_max(worst, mck_abs(residual[k]) / size);
        }
    }
    return worst;
}

mck_balance_forces mck_balance_share(const mck_balance *f, int k, const mck_real *y,
                                     const mck_real *x, mck_real p, mck_real *gradient)
{
    const muscle one = read_muscle(f, k);
    mck_balance_forces found = {MCK_R(0.0), MCK_R(0.0), MCK_R(0.0),
                                MCK_R(0.0), MCK_R(0.0), MCK_R(0.0)};
    (void)sprung(f, &one, y, x, gradient);
    for (int j = 0; j < f->n; j++) {
        found.pulled += gradient[j] * y[j];
    }
    if (y[k] - f->u[k] <= HAIR * f->scale) {
        mck_real lost;
        found.held = elastic(f, &one, y[k], &found.stiff);
        found.given = p * area(f, &one, y[k], &lost);
        found.stiff -= p * lost;
        for (int i = 0; i < f->m; i++) {
            found.rubbed += one.friction[i] * f->stops[k * f->m + i];
        }
        for (int i = 0; i < f->n_l; i++) {
            found.relaxing += one.relaxation[i] * f->lags[k * f->n_l + i];
        }
    }
    return found;
}

static mck_real product(int n, const mck_real *a, const mck_real *b)
{
    mck_real sum = MCK_R(0.0);
    for (int k = 0; k < n; k++) {
        sum += a[k] * b[k];
    }
    return sum;
}

/* Go along `step` from where the muscles are, until the energy falls much slower than at the start, at
 * the rate `down`; returns what is left of the residual. */
static mck_real search(const mck_balance *f, int way, mck_real *y, const mck_real *x,
                       const mck_real *p, mck_real *residual, mck_real *matrix,
                       const mck_real *step, mck_real *start, mck_real down)
{
    mck_real low = MCK_R(0.0);
    mck_real high = MCK_R(-1.0);
    mck_real share = MCK_R(1.0);
    mck_real low_rate = down;
    mck_real high_rate = MCK_R(0.0);
    mck_real left = MCK_R(0.0);
    int done = 0;
    for (int k = 0; k < f->n; k++) {
        start[k] = y[k];
    }
    for (int tried = 0; tried < MOST_SEARCHED && !done; tried++) {
        for (int k = 0; k < f->n; k++) {
            y[k] = start[k] + share * step[k];
        }
        left = mck_balance_lack(f, way, y, x, p, residual, matrix);
        const mck_real rate = product(f->n, residual, step);
        done = left <= BALANCED || mck_abs(rate) <= MCK_R(0.7) * mck_abs(down) ||
               !(left < MCK_INFINITY);
        if (rate > MCK_R(0.0)) {
            high = share;
            high_rate = rate;
        } else {
            low = share;
            low_rate = rate;
        }
        if (high < MCK_R(0.0)) {
            share *= MCK_R(2.0);
        } else { /* where the rate would vanish were it straight, but well inside */
            const mck_real straight = -low_rate / (high_rate - low_rate);
            share = low + (high - low) * mck_clip(straight, MCK_R(0.1), MCK_R(0.9));
        }
    }
    return left;
}

mck_real mck_balance_settle(const mck_balance *f, int way, mck_real *y, const mck_real *x,
                            const mck_real *p, mck_real *scratch)
{
    mck_real *residual = scratch;
    mck_real *step = residual + f->n;
    mck_real *start = step + f->n;
    mck_real *matrix = start + f->n;
    mck_real left = mck_balance_lack(f, way, y, x, p, residual, matrix);
    mck_real before = MCK_R(2.0) * left + MCK_R(1.0);
    int sure = 0;
    for (int tried = 0; tried < MOST_STEPS && !sure; tried++) {
        if (left <= BALANCED || (left >= before && left < MCK_NEARLY) || !(left < MCK_INFINITY)) {
            break;
        }
        before = left;
        sure = left <= SURE;
        for (int k = 0; k < f->n; k++) {
            step[k] = -residual[k];
        }
        mck_eliminate(f->n, matrix, step);
        mck_real down = product(f->n, residual, step);
        if (!(down < MCK_R(0.0))) { /* where the energy is not convex: straight down */
            for (int k = 0; k < f->n; k++) {
                step[k] = -residual[k];
            }
            down = product(f->n, residual, step);
        }
        if (sure) {
            for (int k = 0; k < f->n; k++) {
                y[k] += step[k];
            }
        } else {
            left = search(f, way, y, x, p, residual, matrix, step, start, down);
        }
    }
    for (int k = 0; k < f->n && !(left < MCK_NEARLY); k++) {
        y[k] = f->u[k];
    }
    return left;
}

void mck_balance_begin(const mck_part *part, const mck_balance *f, const mck_real *x)
{
    mck_real *y = f->scratch;
    mck_real *p = y + f->n;
    for (int i = 0; i < part->n_states; i++) {
        f->u[i] = MCK_R(0.0);
    }
    for (int k = 0; k < f->n; k++) {
        y[k] = MCK_R(0.0);
        p[k] = MCK_R(0.0);
    }
    (void)mck_balance_settle(f, MCK_AT_REST, y, x, p, p + f->n);
    mck_balance_keep(f, MCK_AT_REST, y, p);
    for (int k = 0; k < f->n; k++) {
        f->tare[k] = f->tared > MCK_R(0.0) ? y[k] : MCK_R(0.0);
    }
    *f->first = MCK_R(1.0);
}

