#include "force_feedforward.h"

#include "horner.h"
#include "multistate_friction.h"

#define POLYNOMIAL 0
#define CHOU_HANNAFORD 1
#define LEAST_PULL MCK_R(1e-9)

/* The force per bar at a length; `rest` becomes the force without pressure. */
static mck_real pull_at(const mck_real *c, int kind, int size, mck_real length, mck_real *rest)
{
    if (kind == POLYNOMIAL) {
        const int n = (int)c[2];
        const mck_real x = (length - c[0]) / c[1];
        *rest = mck_horner(x, size - 3 - n, c + 3 + n);
        return mck_horner(x, n, c + 3);
    }
    if (kind == CHOU_HANNAFORD) {
        *rest = c[2];
        return c[0] * (length * length - c[1]);
    }
    const mck_real e = MCK_R(1.0) - length / c[0];
    const mck_real mu = c[4] * mck_exp(MCK_R(-40.0) * e) + c[5];
    const mck_real left = MCK_R(1.0) - c[7] * e;
    *rest = c[8];
    return mu * c[1] * (c[2] * left * left - c[3]);
}

/* The friction as a part of its own, on the same state. */
static mck_part friction_of(const mck_part *part)
{
    const int before = 2 + (int)part->coefficients[1];
    mck_part friction = *part;
    friction.coefficients = part->coefficients + before;
    friction.n_coefficients = part->n_coefficients - before;
    return friction;
}

void mck_force_feedforward_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    const mck_part friction = friction_of(part);
    mck_multistate_friction_start(&friction, state, in + 1);
}

void mck_force_feedforward_step(const mck_part *part, mck_real *state, const mck_real *in,
                                mck_real *out)
{
    const mck_part friction = friction_of(part);
    const mck_real *c = part->coefficients;
    mck_real slid = MCK_R(0.0);
    mck_real gain = MCK_R(0.0);
    mck_real reference = MCK_R(0.0);
    if (friction.n_coefficients > 0) {
        gain = friction.coefficients[1];
        reference = friction.coefficients[2];
        const mck_real at[2] = {in[1], reference};
        mck_multistate_friction_step(&friction, state, at, &slid);
    }
    mck_real rest = MCK_R(0.0);
    const mck_real pull = pull_at(c + 2, (int)c[0], (int)c[1], in[1], &rest) + gain * slid;
    const mck_real missing = in[0] - rest - slid * (MCK_R(1.0) - gain * reference);
    out[0] = mck_abs(pull) < LEAST_PULL ? (mck_real)NAN : missing / pull;
}
