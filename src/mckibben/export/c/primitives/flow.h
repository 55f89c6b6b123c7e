/* The closed-form flow that Bouc-Wen models share: z along a straight stretch of the input.
 *
 * With v = z in the direction of motion and tau > 0 the way travelled, dv/dtau = 1 - psi |v|^n,
 * psi being `unloading` while v < 0 and `loading` after; n is 1 or 2. */
#ifndef MCK_FLOW_H
#define MCK_FLOW_H

#include "mck.h"

mck_real mck_flow(mck_real v, mck_real tau, mck_real unloading, mck_real loading, int n);

#endif
