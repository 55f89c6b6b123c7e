/* PID feedback, one loop for each of n outputs. Inputs: n references, n measurements, n bases if any.
 *
 * Coefficients: sample time, share of the derivative's filter, lowest and highest output, whether
 * there are bases, whether a measurement answers the reference of the step before; n kp, n ki, n kd.
 * State: n integrals, n filtered rates, n last measurements, n last references; scratch: n. */
#ifndef MCK_PID_H
#define MCK_PID_H

#include "mck.h"

void mck_pid_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_pid_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out);

#endif
