/* What all C of a model shares: the number type, infinity, and small functions. */
#ifndef MCK_H
#define MCK_H

#include <math.h>

#include "mck_config.h"

#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__)
#error "compile without -ffast-math and -ffinite-math-only: infinity and NaN have a meaning here"
#endif

#ifdef MCK_FLOAT32
typedef float mck_real;
#else
typedef double mck_real;
#endif

#define MCK_INFINITY ((mck_real)INFINITY)

static inline mck_real mck_min(mck_real a, mck_real b) { return b < a ? b : a; }

static inline mck_real mck_max(mck_real a, mck_real b) { return b > a ? b : a; }

/* Return a sum after a change; what rounding loses is carried to the next change (Kahan). */
static inline mck_real mck_sum(mck_real total, mck_real change, mck_real *lost)
{
    const mck_real whole = change - *lost;
    const mck_real next = total + whole;
    *lost = (next - total) - whole;
    return next;
}

#endif
