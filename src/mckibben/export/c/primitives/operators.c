#include "operators.h"

void mck_operators_start(int rule, int n, const mck_real *r, mck_real rising, mck_real falling,
                         mck_real *s)
{
    for (int i = 0; i < n; i++) {
        s[i] = rising - r[i];
        if (rule == MCK_VIRGIN) {
            s[i] = mck_clip(MCK_R(0.0), rising - r[i], falling + r[i]);
        }
    }
}

/* While the input z rises, operator i moves once z > s_i + r_i, and operators start moving in the
 * order of their thresholds; between two starts the sum is linear in z. Falling is the mirror,
 * `way` = -1. Returns the z that the target asks for, whether or not `limit` allows it. */
static mck_real move_to(mck_real way, mck_real target, mck_real limit, int n, const mck_real *r,
                        const mck_real *w, mck_real *s)
{
    mck_real still = MCK_R(0.0);
    for (int i = 0; i < n; i++) {
        still += w[i] * s[i];
    }
    mck_real slope = MCK_R(0.0);
    mck_real moving = MCK_R(0.0);
    mck_real z = s[0];
    for (int i = 0; i < n; i++) {
        still -= w[i] * s[i];
        slope += w[i];
        moving += w[i] * r[i];
        z = (target - still + way * moving) / slope;
        if (i + 1 == n || way * z <= way * s[i + 1] + r[i + 1]) {
            break;
        }
    }
    for (int i = 0; i < n; i++) {
        if (way > MCK_R(0.0)) {
            s[i] = mck_max(s[i], mck_min(z, limit) - r[i]);
        } else {
            s[i] = mck_min(s[i], mck_max(z, limit) + r[i]);
        }
    }
    return z;
}

int mck_follow(int n, mck_real target, mck_real previous, mck_real lowest, mck_real highest,
               const mck_real *r, const mck_real *w, mck_real *s, int *clipped)
{
    const mck_real slack = MCK_SLACK * mck_abs(highest - lowest);
    mck_real total = MCK_R(0.0);
    mck_real size = MCK_R(0.0);
    for (int i = 0; i < n; i++) {
        total += w[i] * s[i];
        size += mck_abs(w[i] * s[i]);
    }
    const mck_real missing = target - total;
    if (target > previous && missing > MCK_ROUNDING * size) {
        *clipped = move_to(MCK_R(1.0), target, highest, n, r, w, s) > highest + slack;
        return 1;
    }
    if (target < previous && missing < -MCK_ROUNDING * size) {
        *clipped = move_to(MCK_R(-1.0), target, lowest, n, r, w, s) < lowest - slack;
        return -1;
    }
    *clipped = (missing > w[0] * slack && s[0] >= highest) ||
               (missing < -w[0] * slack && s[0] <= lowest);
    return 0;
}

void mck_solve_from_rest(int n, mck_real target, mck_real lowest, mck_real highest,
                         const mck_real *r, const mck_real *w, mck_real *s)
{
    for (int i = 0; i < n; i++) {
        s[i] = MCK_R(0.0);
    }
    if (target > MCK_R(0.0)) {
        (void)move_to(MCK_R(1.0), target, highest, n, r, w, s);
    } else if (target < MCK_R(0.0)) {
        (void)move_to(MCK_R(-1.0), target, lowest, n, r, w, s);
    }
}
