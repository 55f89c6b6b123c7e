/* Springs that slip (Maxwell slip), beside a reversible polynomial; and its inverse, solved for every
 * sample.
 *
 * Coefficients: size of the polynomial, stiffness ratio, limit ratio, centre, scale, polynomial, n
 * breakaways, n weights. State: n deflections, previous input;
 * scratch: n.
 * Inverse: lowest and highest input behind; state: as forward, last input, count clipped;
 * scratch: n. */
#ifndef MCK_MAXWELL_SLIP_H
#define MCK_MAXWELL_SLIP_H

#include "mck.h"

void mck_maxwell_slip_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_maxwell_slip_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real
                           *out);

void mck_maxwell_slip_inverse_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_maxwell_slip_inverse_step(const mck_part *part, mck_real *state, const mck_real *in,
                                   mck_real *out);

#endif
