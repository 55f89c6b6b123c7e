/* Visco-elastic creep behind a model of the immediate response: n Kelvin-Voigt elements; and its
 * exact inverse.
 *
 * Coefficients: n decays over a sample, n compliances. State: n elements. Inverse: the same. */
#ifndef MCK_CREEP_H
#define MCK_CREEP_H

#include "mck.h"

void mck_creep_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_creep_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out);

void mck_creep_inverse_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_creep_inverse_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real
                            *out);

#endif
