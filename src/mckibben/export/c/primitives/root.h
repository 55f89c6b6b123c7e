/* Inverses without a closed form: one root a sample, within a bracket, in a bounded number of steps. */
#ifndef MCK_ROOT_H
#define MCK_ROOT_H

#include "mck.h"

/* The output that the input u would give, nothing changed. */
typedef mck_real (*mck_trial)(const mck_part *part, const mck_real *state, mck_real u);

/* Find u with trial(u) = target nearest to `start`: walk in growing steps, both ways in turn, until
 * the target is bracketed, then close the bracket by regula falsi (Illinois) and bisection.
 * `clipped` becomes 1 where neither limit brackets the target; u is then the nearer limit. */
mck_real mck_solve_near(mck_trial trial, const mck_part *part, const mck_real *state,
                        mck_real target, mck_real start, mck_real lowest, mck_real highest,
                        int *clipped);

/* One step of a solved inverse: its coefficients end with the lowest and highest input, its state
 * with the last input and the count of samples clipped. Returns the input; the caller advances. */
mck_real mck_solved_input(mck_trial trial, const mck_part *part, mck_real *state, mck_real wanted);

/* A start function, and a step function that gives one output. */
typedef void (*mck_start)(const mck_part *part, mck_real *state, const mck_real *in);
typedef void (*mck_step)(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out);

/* Find by bisection the input whose first output, after a start, is nearest to `wanted`; `state` is
 * computed in. With `below`, give the end of the last bracket below it instead of the middle. */
mck_real mck_first_input(mck_start start, mck_step step, const mck_part *part, mck_real *state,
                         mck_real wanted, mck_real lowest, mck_real highest, int below);

/* Start a solved inverse: forward memory as after that input, then the input, nothing clipped. */
void mck_solved_start(mck_start start, mck_step step, const mck_part *part, mck_real *state,
                      mck_real wanted);

#endif
