/* Weighted sums of play operators: how they start, and the walk that inverts them. */
#ifndef MCK_OPERATORS_H
#define MCK_OPERATORS_H

#include "mck.h"

/* Start n operators with thresholds r; `rising` and `falling` are the first input as the two edges
 * see it, the same for classical operators. */
void mck_operators_start(int rule, int n, const mck_real *r, mck_real rising, mck_real falling,
                         mck_real *s);

/* Move the input of sum w_i s_i until the sum is `target`; `lowest` and `highest` are its limits.
 * Stays where the reference does, so that rounding is never taken for a reversal. Returns the
 * direction taken, 1, -1 or 0; `clipped` becomes 1 where the input would have to leave its limits. */
int mck_follow(int n, mck_real target, mck_real previous, mck_real lowest, mck_real highest,
               const mck_real *r, const mck_real *w, mck_real *s, int *clipped);

/* Set the operators to what one excursion from rest leaves when the sum is `target`. */
void mck_solve_from_rest(int n, mck_real target, mck_real lowest, mck_real highest,
                         const mck_real *r, const mck_real *w, mck_real *s);

#endif
