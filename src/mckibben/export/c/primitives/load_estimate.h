/* From displacements and pressures of n muscles in parallel, and what schedules them, to their loads.
 *
 * Coefficients: the balance's, see balance_law.h; the pseudo-inverse of shares, loads by n. State: the balance's; scratch: its, and what schedules with the loads. */
#ifndef MCK_LOAD_ESTIMATE_H
#define MCK_LOAD_ESTIMATE_H

#include "mck.h"

void mck_load_estimate_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_load_estimate_step(const mck_part *part, mck_real *state, const mck_real *in,
                            mck_real *out);

#endif
