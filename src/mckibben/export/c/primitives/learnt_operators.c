#include "learnt_operators.h"

#include "operators.h"

const mck_real *mck_inverse_numbers(const mck_learner *m) { return m->family + 2 + 2 * (m->p - 1); }

/* Raise weights that are too low for a sum that rises right after every reversal. */
static void keep_rising(int n, mck_real *theta, const mck_real *least)
{
    mck_real total = MCK_R(0.0);
    for (int i = 0; i < n; i++) {
        theta[i] = mck_max(mck_max(theta[i], least[i]), least[n + i] - total);
        total += theta[i];
    }
}

/* Move what is used to what is aimed at, as far as the input need not turn before the reference. */
static void take_over(int n, const mck_real *aim, mck_real *used, const mck_real *s, mck_real y,
                      mck_real travel, mck_real band)
{
    mck_real total = used[n];
    mck_real change = aim[n] - used[n];
    for (int i = 0; i < n; i++) {
        total += used[i] * s[i];
        change += (aim[i] - used[i]) * s[i];
    }
    const mck_real room = y - total;
    const mck_real left = room - change;
    if (travel * left < MCK_R(0.0) && mck_abs(left) <= band && mck_abs(change) > MCK_R(0.0)) {
        const mck_real share = mck_clip(room / change, MCK_R(0.0), MCK_R(1.0));
        if (share < MCK_R(1.0)) {
            for (int i = 0; i <= n; i++) {
                used[i] += share * (aim[i] - used[i]);
            }
            return;
        }
    }
    for (int i = 0; i <= n; i++) {
        used[i] = aim[i];
    }
}

int mck_follow_learning(const mck_learner *m, const mck_learnt *learnt, const mck_real *r, mck_real *s,
                        mck_real *last, const mck_real *in)
{
    const int n = m->p - 1;
    mck_real *theta = learnt->theta;
    mck_real *used = learnt->used;
    mck_real believed = theta[n];
    mck_real asked = used[n];
    mck_real expected = m->fitted[n];
    for (int i = 0; i < n; i++) {
        learnt->work[i] = s[i];
        believed += theta[i] * s[i];
        asked += used[i] * s[i];
        expected += m->fitted[i] * s[i];
    }
    learnt->work[n] = MCK_R(1.0);
    if (mck_learn(m, learnt, learnt->sense, in[1], believed, asked, expected)) {
        keep_rising(n, theta, m->family + 2);
    }
    if (in[0] > last[0]) {
        last[2] = MCK_R(1.0);
    } else if (in[0] < last[0]) {
        last[2] = MCK_R(-1.0);
    }
    const mck_real share = mck_trusted(learnt, 1);
    mck_real *aim = learnt->work;
    for (int i = 0; i <= n; i++) {
        aim[i] = m->fitted[i] + share * (theta[i] - m->fitted[i]);
    }
    take_over(n, aim, used, s, in[0], last[2], MCK_GATE * learnt->sense[MCK_USUAL]);
    mck_real total = MCK_R(0.0);
    for (int i = 0; i < n; i++) {
        total += used[i] * s[i];
    }
    int clipped = 0;
    const int way = mck_follow(n, in[0] - used[n], total, m->family[0], m->family[1], r, used, s,
                               &clipped);
    if (clipped) {
        last[1] += MCK_R(1.0);
    }
    last[0] = in[0];
    return way;
}
