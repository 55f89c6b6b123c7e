/* What holds in every sample of a balance of forces: its terms, and its two solutions.
 *
 * Coefficients: n, scheduling inputs, degree, loads, stops m, lags l, elastic terms, area's terms,
 * scale, pressure below zero at which stops hold nothing, lowest and highest pressure, samples a second,
 * tare, what is left at the start to relax, mass; m limits, l decays, l gains; then of every muscle:
 * lowest and highest displacement known, wall, force at which it goes slack, damping, line, own spring,
 * mass, springs (powers of what schedules by 1 + n), elasticity, area, friction, relaxation, loads.
 * State: n shortenings, n stretches, n by m stops, n by l lags, with mass n by 2 last moves, n tares,
 * whether nothing came before, count of samples amiss; scratch: n n + 6 n. */
#ifndef MCK_BALANCE_LAW_H
#define MCK_BALANCE_LAW_H

#include "mck.h"

/* Relative: a residual below is an equilibrium, but for rounding. */
#define MCK_NEARLY MCK_EITHER(1e-9, 1e-4)

/* Ways to a sample: without friction and lags; all at once, before anything relaxes or damps; in the
 * sample time. */
#define MCK_AT_REST 0
#define MCK_FROM_REST 1
#define MCK_IN_TIME 2

/* Coefficients, state and scratch; stops are n by m, lags n by n_l. */
typedef struct {
    int n;
    int n_x;
    int degree;
    int n_loads;
    int m;
    int n_l;
    int n_e;
    int n_a;
    int heavy;
    mck_real scale;
    mck_real grip;
    mck_real lowest;
    mck_real highest;
    mck_real rate;
    mck_real tared;
    mck_real fresh;
    const mck_real *limits;
    const mck_real *decays;
    const mck_real *gains;
    const mck_real *muscles;
    mck_real *u;
    mck_real *z;
    mck_real *stops;
    mck_real *lags;
    mck_real *moves;
    mck_real *tare;
    mck_real *first;
    mck_real *amiss;
    mck_real *scratch;
} mck_balance;

mck_balance mck_balance_of(const mck_part *part, mck_real *state);

/* Rest without pressure, and take the tare there; nothing has come before the first sample. `x` is what
 * schedules, then the loads, here and below. The first n numbers of scratch are then the displacements. */
void mck_balance_begin(const mck_part *part, const mck_balance *f, const mck_real *x);

/* Way to the next sample. */
int mck_balance_way(const mck_balance *f);

/* Bring the state to where the muscles are now; something has come. */
void mck_balance_keep(const mck_balance *f, int way, const mck_real *y, const mck_real *p);

/* The pressure of muscle k that balances it where all muscles are, or, where it would have to push more
 * than it can, at which it is about to go slack; and whether one does. `gradient` has n numbers. */
mck_real mck_balance_pressed(const mck_balance *f, int k, int way, const mck_real *y,
                             const mck_real *x, mck_real *gradient, int *reached);

/* What every muscle's forces exceed its pull by, n numbers, and its slopes by displacements, n by n;
 * returns the largest share. */
mck_real mck_balance_lack(const mck_balance *f, int way, const mck_real *y, const mck_real *x,
                          const mck_real *p, mck_real *residual, mck_real *matrix);

/* Forces of muscle k where it is. */
typedef struct {
    mck_real pulled;   /* by the springs between muscles, without constants */
    mck_real held;     /* by elasticity and its own spring */
    mck_real given;    /* by pressure */
    mck_real rubbed;   /* by stops */
    mck_real relaxing; /* by lags */
    mck_real stiff;    /* its slope but for springs, stops and lags */
} mck_balance_forces;

/* Return them where muscles are at y under x; a muscle that is slack has none of its own. `gradient` gets
 * the springs. */
mck_balance_forces mck_balance_share(const mck_balance *f, int k, const mck_real *y,
                                     const mck_real *x, mck_real p, mck_real *gradient);

/* Move the displacements to where pressures hold them; returns what is left of the residual.
 * Where no place is found, they stay where they were. `scratch` has n n + 3 n numbers. */
mck_real mck_balance_settle(const mck_balance *f, int way, mck_real *y, const mck_real *x,
                            const mck_real *p, mck_real *scratch);

#endif
