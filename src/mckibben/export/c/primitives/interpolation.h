/* Straight lines between knots; the end pieces continue beyond them. */
#ifndef MCK_INTERPOLATION_H
#define MCK_INTERPOLATION_H

#include "mck.h"

mck_real mck_interpolate(mck_real x, int n, const mck_real *knots, const mck_real *values);

#endif
