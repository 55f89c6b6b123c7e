/* The elastic-plastic model, and its exact inverse. Template for authors: one file with both directions,
 * named after the kind, that lies beside the block's Python or among the primitives.
 *
 * Coefficients: gain, weight, threshold. State: the play operator's output.
 * Inverse: those, lowest and highest input; state: the play operator's output, count of samples
 * clipped. */
#ifndef MCK_ELASTIC_PLASTIC_H
#define MCK_ELASTIC_PLASTIC_H

#include "mck.h"

void mck_elastic_plastic_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_elastic_plastic_step(const mck_part *part, mck_real *state, const mck_real *in,
                              mck_real *out);

void mck_elastic_plastic_inverse_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_elastic_plastic_inverse_step(const mck_part *part, mck_real *state, const mck_real *in,
                                      mck_real *out);

#endif
