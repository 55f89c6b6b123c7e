/* The pressures of a horizon of N samples, nearest to a wish: minimises the sum of |G (p - q) - e|^2
 * over all samples where every row of supply.h holds, by a primal-dual interior-point method with a
 * bounded number of steps. */
#ifndef MCK_PLAN_H
#define MCK_PLAN_H

#include "mck.h"

/* `slopes` (G) are N times n by n, `nominal` (q), `errors` (e) and `p` N by n; scratch has
 * N (3 n n + 3 n + 6 rows) + 2 n n + 2 n numbers. Returns how many steps it took. */
int mck_plan(int length, int n, int n_rows, const mck_real *rows, const mck_real *before,
             const mck_real *slopes, const mck_real *nominal, const mck_real *errors, mck_real *p,
             mck_real *scratch);

#endif
