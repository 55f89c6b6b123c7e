#include "elastic_plastic.h"

#include "operators.h"
#include "root.h"

/* mck.h says what a step and a start may do. Numbers are written MCK_R(1.0), so that they are of the
 * precision that was asked for; products and sums stand in the order that the kernel has. */

void mck_elastic_plastic_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    mck_operators_start(part->start, 1, part->coefficients + 2, in[0], in[0], state);
}

void mck_elastic_plastic_step(const mck_part *part, mck_real *state, const mck_real *in,
                              mck_real *out)
{
    const mck_real gain = part->coefficients[0];
    const mck_real weight = part->coefficients[1];
    state[0] = mck_play(state[0], in[0], part->coefficients[2]);
    out[0] = gain * in[0] + weight * (in[0] - state[0]);
}

/* The inverse starts where the model gives the first reference, sought by bisection. */
void mck_elastic_plastic_inverse_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    mck_real memory[3]; /* the play operator, and what mck_solved_start writes behind it */
    mck_part sought = *part;
    sought.n_states = 3;
    mck_solved_start(mck_elastic_plastic_start, mck_elastic_plastic_step, &sought, memory, in[0]);
    state[0] = memory[0];
    state[1] = MCK_R(0.0);
}

void mck_elastic_plastic_inverse_step(const mck_part *part, mck_real *state, const mck_real *in,
                                      mck_real *out)
{
    const mck_real gain = part->coefficients[0];
    const mck_real weight = part->coefficients[1];
    const mck_real r = part->coefficients[2];
    const mck_real lowest = part->coefficients[3];
    const mck_real highest = part->coefficients[4];
    const mck_real slack = MCK_SLACK * (highest - lowest);
    mck_real u = (in[0] + weight * state[0]) / (gain + weight);
    if (u > state[0] + r) {
        u = (in[0] - weight * r) / gain;
    } else if (u < state[0] - r) {
        u = (in[0] + weight * r) / gain;
    }
    if (u < lowest - slack || u > highest + slack) {
        state[1] += MCK_R(1.0);
    }
    u = mck_clip(u, lowest, highest);
    state[0] = mck_play(state[0], u, r);
    out[0] = u;
}
