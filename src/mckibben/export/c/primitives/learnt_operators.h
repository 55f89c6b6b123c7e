/* A weighted sum of play operators whose weights and offset are learnt while it is inverted.
 *
 * Numbers of the family: lowest and highest common input, n lowest weights, n lowest partial sums, then
 * those of the inverse. Parameters: n weights, offset.
 * Memory: that of the inverse, which ends in previous reference and samples clipped, then the direction
 * of travel, then what is learnt. Inputs: reference, measured; scratch: 3 p. */
#ifndef MCK_LEARNT_OPERATORS_H
#define MCK_LEARNT_OPERATORS_H

#include "learning.h"

/* Learn from in[1], take over what was learnt, and move the n operators s with thresholds r until they
 * give in[0]. `last` is [previous reference, samples clipped, direction of travel]. Returns the
 * direction taken, 1, -1 or 0. */
int mck_follow_learning(const mck_learner *m, const mck_learnt *learnt, const mck_real *r, mck_real *s,
                        mck_real *last, const mck_real *in);

/* Numbers of the inverse, behind those of the family. */
const mck_real *mck_inverse_numbers(const mck_learner *m);

#endif
