#include "root.h"

#define MOST_STEPS 200

typedef struct {
    mck_real u;
    mck_real error;
} place;

/* Close a bracket: `near` and `far` have errors of different signs. */
static mck_real close_bracket(mck_trial trial, const mck_part *part, const mck_real *state,
                              mck_real target, mck_real tiny, place near, place far)
{
    mck_real weight_near = near.error;
    mck_real weight_far = far.error;
    int side = 0;
    for (int iteration = 0; iteration < MOST_STEPS; iteration++) {
        const mck_real width = far.u - near.u;
        if (mck_abs(width) <= tiny) {
            break;
        }
        mck_real u = near.u + MCK_R(0.5) * width;
        if (iteration % 3 != 2) {
            const mck_real chord = near.u - weight_near * width / (weight_far - weight_near);
            if (mck_min(near.u, far.u) < chord && chord < mck_max(near.u, far.u)) {
                u = chord;
            }
        }
        if (!(mck_min(near.u, far.u) < u && u < mck_max(near.u, far.u))) {
            break;
        }
        const mck_real error = trial(part, state, u) - target;
        if (!(error < MCK_R(0.0)) && !(error > MCK_R(0.0))) {
            return u;
        }
        if ((error > MCK_R(0.0)) == (near.error > MCK_R(0.0))) {
            near.u = u;
            near.error = error;
            weight_near = error;
            weight_far = side == 1 ? MCK_R(0.5) * weight_far : far.error;
            side = 1;
        } else {
            far.u = u;
            far.error = error;
            weight_far = error;
            weight_near = side == 2 ? MCK_R(0.5) * weight_near : near.error;
            side = 2;
        }
    }
    return mck_abs(near.error) < mck_abs(far.error) ? near.u : far.u;
}

mck_real mck_solve_near(mck_trial trial, const mck_part *part, const mck_real *state,
                        mck_real target, mck_real start, mck_real lowest, mck_real highest,
                        int *clipped)
{
    const mck_real tiny = MCK_BRACKET * (highest - lowest);
    const mck_real error_start = trial(part, state, start) - target;
    place above = {start, error_start};
    place below = {start, error_start};
    mck_real direction = error_start > MCK_R(0.0) ? MCK_R(-1.0) : MCK_R(1.0);
    mck_real step = (highest - lowest) / MCK_R(256.0);
    *clipped = 0;
    if (mck_abs(error_start) <= MCK_ROUNDING * mck_abs(target)) {
        return start;
    }
    for (int walked = 0; walked < 2 * MOST_STEPS; walked++) {
        place near;
        place far;
        if (direction > MCK_R(0.0)) {
            near = above;
            above.u = mck_min(above.u + step, highest);
            above.error = trial(part, state, above.u) - target;
            far = above;
        } else {
            near = below;
            below.u = mck_max(below.u - step, lowest);
            below.error = trial(part, state, below.u) - target;
            far = below;
        }
        if (!(far.error < MCK_R(0.0)) && !(far.error > MCK_R(0.0))) {
            return far.u;
        }
        if ((far.error > MCK_R(0.0)) != (error_start > MCK_R(0.0))) {
            return close_bracket(trial, part, state, target, tiny, near, far);
        }
        if (above.u >= highest && below.u <= lowest) {
            break;
        }
        direction = -direction;
        if (direction * error_start < MCK_R(0.0)) {
            step *= MCK_R(1.5);
        }
    }
    const mck_real slack = MCK_SLACK * mck_abs(above.error - below.error);
    if (mck_abs(above.error) < mck_abs(below.error)) {
        *clipped = mck_abs(above.error) > slack;
        return above.u;
    }
    *clipped = mck_abs(below.error) > slack;
    return below.u;
}

mck_real mck_solved_input(mck_trial trial, const mck_part *part, mck_real *state, mck_real wanted)
{
    const mck_real lowest = part->coefficients[part->n_coefficients - 2];
    const mck_real highest = part->coefficients[part->n_coefficients - 1];
    const int n = part->n_states - 2;
    int clipped = 0;
    const mck_real u =
        mck_solve_near(trial, part, state, wanted, state[n], lowest, highest, &clipped);
    state[n] = u;
    if (clipped) {
        state[n + 1] += MCK_R(1.0);
    }
    return u;
}

static mck_real first_output(mck_start start, mck_step step, const mck_part *part, mck_real *state,
                             mck_real u)
{
    mck_real y = MCK_R(0.0);
    start(part, state, &u);
    step(part, state, &u, &y);
    return y;
}

mck_real mck_first_input(mck_start start, mck_step step, const mck_part *part, mck_real *state,
                         mck_real wanted, mck_real lowest, mck_real highest, int below)
{
    mck_real low = lowest;
    mck_real high = highest;
    for (int iteration = 0; iteration < MOST_STEPS; iteration++) {
        const mck_real middle = MCK_R(0.5) * (low + high);
        if (!(low < middle && middle < high)) {
            break;
        }
        if (first_output(start, step, part, state, middle) < wanted) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return below ? low : MCK_R(0.5) * (low + high);
}

void mck_solved_start(mck_start start, mck_step step, const mck_part *part, mck_real *state,
                      mck_real wanted)
{
    const mck_real lowest = part->coefficients[part->n_coefficients - 2];
    const mck_real highest = part->coefficients[part->n_coefficients - 1];
    const int n = part->n_states - 2;
    mck_real u = lowest;
    if (first_output(start, step, part, state, lowest) < wanted) {
        u = highest;
        if (first_output(start, step, part, state, highest) > wanted) {
            u = mck_first_input(start, step, part, state, wanted, lowest, highest, 0);
        }
    }
    start(part, state, &u);
    state[n] = u;
    state[n + 1] = MCK_R(0.0);
}
