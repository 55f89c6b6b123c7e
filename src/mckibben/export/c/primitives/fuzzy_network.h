/* A first-order Takagi-Sugeno network with a rule for every combination of Gaussian sets; and its
 * solution for the driven inputs by Newton's method, within their limits: once a sample, rules are
 * contracted to those of the driven inputs alone, whose slopes are exact.
 *
 * Coefficients: inputs n, outputs, driven inputs, whether there are constants, most sets of an input,
 * sets of every input, all centres, all widths, consequents rule by rule. No state; scratch: inputs
 * times most sets.
 * Inverse of m driven inputs: m lowest, m highest, then the network's; state: last solution, count of
 * samples clipped; scratch: (inputs + m) times most sets + combinations of the driven inputs' sets
 * times m (m + 1) + m (m + 6). */
#ifndef MCK_FUZZY_NETWORK_H
#define MCK_FUZZY_NETWORK_H

#include "mck.h"

void mck_fuzzy_network_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real
                            *out);

void mck_fuzzy_network_inverse_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_fuzzy_network_inverse_step(const mck_part *part, mck_real *state, const mck_real *in,
                                    mck_real *out);

#endif
