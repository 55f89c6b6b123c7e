#include "interpolation.h"

mck_real mck_interpolate(mck_real x, int n, const mck_real *knots, const mck_real *values)
{
    int low = 0;
    int high = n - 1;
    while (high - low > 1) {
        const int middle = (low + high) / 2;
        if (x < knots[middle]) {
            high = middle;
        } else {
            low = middle;
        }
    }
    const mck_real slope = (values[high] - values[low]) / (knots[high] - knots[low]);
    if (x - knots[low] < knots[high] - x) {
        return values[low] + slope * (x - knots[low]);
    }
    return values[high] - slope * (knots[high] - x);
}
