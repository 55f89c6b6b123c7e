/* The inverse of a generalised Prandtl-Ishlinskii model that learns its weights and an offset, see
 * learnt_operators.h. */
#ifndef MCK_GPI_ADAPTIVE_H
#define MCK_GPI_ADAPTIVE_H

#include "mck.h"

void mck_gpi_adaptive_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_gpi_adaptive_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out);

#endif
