#include "horner.h"

mck_real mck_horner(mck_real x, int n, const mck_real *ascending)
{
    mck_real y = MCK_R(0.0);
    for (int k = n - 1; k >= 0; k--) {
        y = y * x + ascending[k];
    }
    return y;
}
