#include "linear_system.h"

static mck_real not_zero(mck_real x)
{
    return (x < MCK_R(0.0) || x > MCK_R(0.0)) ? x : MCK_NOTHING;
}

static void swap(mck_real *a, mck_real *b)
{
    const mck_real kept = *a;
    *a = *b;
    *b = kept;
}

void mck_eliminate(int n, mck_real *matrix, mck_real *right)
{
    for (int column = 0; column < n; column++) {
        int pivot = column;
        for (int row = column + 1; row < n; row++) {
            if (mck_abs(matrix[row * n + column]) > mck_abs(matrix[pivot * n + column])) {
                pivot = row;
            }
        }
        if (pivot != column) {
            for (int j = 0; j < n; j++) {
                swap(&matrix[column * n + j], &matrix[pivot * n + j]);
            }
            swap(&right[column], &right[pivot]);
        }
        const mck_real scale = not_zero(matrix[column * n + column]);
        for (int row = column + 1; row < n; row++) {
            const mck_real factor = matrix[row * n + column] / scale;
            for (int j = column; j < n; j++) {
                matrix[row * n + j] -= factor * matrix[column * n + j];
            }
            right[row] -= factor * right[column];
        }
    }
    for (int row = n - 1; row >= 0; row--) {
        for (int j = row + 1; j < n; j++) {
            right[row] -= matrix[row * n + j] * right[j];
        }
        right[row] /= not_zero(matrix[row * n + row]);
    }
}
