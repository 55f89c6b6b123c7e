/* A polynomial with n ascending coefficients. */
#ifndef MCK_HORNER_H
#define MCK_HORNER_H

#include "mck.h"

mck_real mck_horner(mck_real x, int n, const mck_real *ascending);

#endif
