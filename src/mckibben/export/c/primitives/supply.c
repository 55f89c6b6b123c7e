#include "supply.h"

mck_real mck_weighed(int n, const mck_real *row, const mck_real *before, const mck_real *p)
{
    const int changes = row[0] > MCK_R(0.0);
    mck_real total = MCK_R(0.0);
    for (int k = 0; k < n; k++) {
        total += row[2 + k] * (p[k] - (changes ? before[k] : MCK_R(0.0)));
    }
    return total;
}

/* The muscle that a row is of, or -1 if of several. */
static int own_place(int n, const mck_real *row)
{
    int found = -1;
    int several = 0;
    for (int k = 0; k < n; k++) {
        if (row[2 + k] > MCK_R(0.0) || row[2 + k] < MCK_R(0.0)) {
            several |= found >= 0;
            found = k;
        }
    }
    return several ? -1 : found;
}

int mck_allowed(int n, int n_rows, const mck_real *rows, const mck_real *before, mck_real *p)
{
    int there = 1;
    for (int changes = 1; changes >= 0; changes--) { /* the range is what counts in the end */
        for (int i = 0; i < n_rows; i++) {
            const mck_real *row = rows + i * (n + 2);
            const int k = own_place(n, row);
            if (k >= 0 && (int)row[0] == changes) {
                const mck_real over = mck_weighed(n, row, before, p) - row[1];
                if (over > MCK_R(0.0)) {
                    p[k] -= over / row[2 + k];
                    there = there && over <= MCK_SLACK;
                }
            }
        }
    }
    mck_real share = MCK_R(1.0);
    for (int i = 0; i < n_rows; i++) {
        const mck_real *row = rows + i * (n + 2);
        if (own_place(n, row) < 0) {
            const mck_real now = mck_weighed(n, row, before, p);
            const mck_real was = mck_weighed(n, row, before, before);
            if (now > row[1]) {
                there = there && now - row[1] <= MCK_SLACK;
                if (now > was) {
                    share = mck_min(share, mck_max(row[1] - was, MCK_R(0.0)) / (now - was));
                }
            }
        }
    }
    for (int k = 0; k < n && share < MCK_R(1.0); k++) {
        p[k] = before[k] + share * (p[k] - before[k]);
    }
    return there;
}
