/* What all primitives share: the number type, its tolerances, and how a primitive is called.
 *
 * A primitive is one step function, and a start function where it has memory:
 *
 *     void mck_NAME_start(const mck_part *part, mck_real *state, const mck_real *in);
 *     void mck_NAME_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out);
 *
 * `part` is constant and may live in flash. `state` belongs to the caller: part->n_states numbers
 * of memory, behind them the scratch numbers that some primitives compute in. `start` fills the
 * memory before the first sample `in`; `step` takes one sample. Nothing is allocated, nothing is
 * global, every loop is bounded, and only <math.h> is used. Inputs must be finite.
 */
#ifndef MCK_H
#define MCK_H

#include <math.h>

#include "mck_config.h"

#ifdef __FAST_MATH__
#error "compile without -ffast-math: infinity, NaN and the order of operations have a meaning here"
#endif

#ifdef MCK_FLOAT32
typedef float mck_real;
#define MCK_R(literal) literal##f
#define mck_abs fabsf
#define mck_atan atanf
#define mck_atanh atanhf
#define mck_copysign copysignf
#define mck_exp expf
#define mck_expm1 expm1f
#define mck_log logf
#define mck_log1p log1pf
#define mck_sqrt sqrtf
#define mck_tan tanf
#define mck_tanh tanhf
#else
typedef double mck_real;
#define MCK_R(literal) literal
#define mck_abs fabs
#define mck_atan atan
#define mck_atanh atanh
#define mck_copysign copysign
#define mck_exp exp
#define mck_expm1 expm1
#define mck_log log
#define mck_log1p log1p
#define mck_sqrt sqrt
#define mck_tan tan
#define mck_tanh tanh
#endif

/* A tolerance of its own for either precision. */
#ifdef MCK_FLOAT32
#define MCK_EITHER(for_double, for_float) for_float##f
#else
#define MCK_EITHER(for_double, for_float) for_double
#endif

#define MCK_ROUNDING MCK_EITHER(1e-14, 1e-6)  /* relative: differences below are rounding */
#define MCK_BRACKET MCK_EITHER(1e-15, 1e-7)   /* relative: brackets are closed to this */
#define MCK_SLACK MCK_EITHER(1e-9, 1e-4)      /* relative: limits passed by less are not passed */
#define MCK_SOLVED MCK_EITHER(1e-11, 1e-5)    /* relative: residuals below count as solved */
#define MCK_NOTHING MCK_EITHER(1e-300, 1e-37) /* weights below do not count */

#define MCK_INFINITY ((mck_real)INFINITY)

/* Memory before the first sample: as if the input had only risen to it, or as if nothing had ever
 * happened. */
#define MCK_FIRST_SAMPLE 0
#define MCK_VIRGIN 1

typedef struct {
    const mck_real *coefficients; /* in the order that the primitive's header says */
    int n_coefficients;
    int n_states;
    int n_inputs;
    int n_outputs;
    int start; /* MCK_FIRST_SAMPLE or MCK_VIRGIN */
} mck_part;

static inline mck_real mck_min(mck_real a, mck_real b) { return b < a ? b : a; }

static inline mck_real mck_max(mck_real a, mck_real b) { return b > a ? b : a; }

static inline mck_real mck_clip(mck_real x, mck_real low, mck_real high)
{
    return mck_min(mck_max(x, low), high);
}

/* Add a step to a sum. In single precision, what rounding loses is carried to the next step (Kahan),
 * so that sums of a million small steps do not drift. */
static inline void mck_accumulate(mck_real *sum, mck_real *lost, mck_real step)
{
#ifdef MCK_FLOAT32
    const mck_real whole = step - *lost;
    const mck_real next = *sum + whole;
    *lost = (next - *sum) - whole;
    *sum = next;
#else
    (void)lost;
    *sum += step;
#endif
}

/* The play (backlash) operator with threshold r: its output s follows x through a dead zone. */
static inline mck_real mck_play(mck_real s, mck_real x, mck_real r)
{
    return mck_clip(s, x - r, x + r);
}

#endif
