/* What pressures of n muscles and their changes may be: rows [whether of changes, bound, n weights], a
 * weighted sum of pressures, or of how they change in a step, that stays at or below the bound. */
#ifndef MCK_SUPPLY_H
#define MCK_SUPPLY_H

#include "mck.h"

/* The weighted sum that a row limits. */
mck_real mck_weighed(int n, const mck_real *row, const mck_real *before, const mck_real *p);

/* Move pressures to where they may go from those before; returns 1 if they already were there. */
int mck_allowed(int n, int n_rows, const mck_real *rows, const mck_real *before, mck_real *p);

#endif
