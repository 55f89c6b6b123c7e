/* A recurrent fuzzy network in a NARMAX loop, running free. Inputs: the driven one, what schedules.
 *
 * Coefficients: lags of output, driven input and scheduling inputs, sets; centres, widths and
 * feedbacks, each regressors by sets; consequents rule by rule, each a coefficient for every regressor
 * and a constant. State: past outputs, driven inputs, scheduling inputs, memberships; scratch: one a
 * regressor. */
#ifndef MCK_RECURRENT_FUZZY_NETWORK_H
#define MCK_RECURRENT_FUZZY_NETWORK_H

#include "mck.h"

void mck_recurrent_fuzzy_network_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_recurrent_fuzzy_network_step(const mck_part *part, mck_real *state, const mck_real *in,
                                      mck_real *out);

#endif
