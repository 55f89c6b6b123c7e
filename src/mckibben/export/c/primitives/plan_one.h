/* The plan of plan.h for one muscle: exact, by dynamic programming on the derivative of what is left to
 * lose, which is piecewise straight. */
#ifndef MCK_PLAN_ONE_H
#define MCK_PLAN_ONE_H

#include "mck.h"

/* As mck_plan; rows are [whether of changes, bound, weight], and scratch has 9 N + 4 numbers. */
void mck_plan_one(int length, int n_rows, const mck_real *rows, mck_real before,
                  const mck_real *slopes, const mck_real *nominal, const mck_real *errors,
                  mck_real *p, mck_real *scratch);

#endif
