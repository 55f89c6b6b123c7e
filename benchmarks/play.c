/* References for the kernels' speed: plain loops, as one would write them by hand. */
#include <math.h>
#include <stddef.h>

void pi(size_t n, size_t n_op, const double *r, const double *w, double *s, const double *u, double *y)
{
    for (size_t t = 0; t < n; t++) {
        double sum = 0.0;
        for (size_t i = 0; i < n_op; i++) {
            double lower = u[t] - r[i], upper = u[t] + r[i], v = s[i];
            v = v < lower ? lower : v;
            v = v > upper ? upper : v;
            s[i] = v;
            sum += w[i] * v;
        }
        y[t] = sum;
    }
}

void gpi(size_t n, size_t n_op, const double *r, const double *w, double *s, const double *e,
         const double *u, double *y)
{
    double previous = u[0];
    for (size_t t = 0; t < n; t++) {
        double lower = u[t] > previous ? tanh(e[0] * u[t] + e[1]) + e[2] : -INFINITY;
        double upper = u[t] < previous ? tanh(e[3] * u[t] + e[4]) + e[5] : INFINITY;
        double sum = 0.0;
        for (size_t i = 0; i < n_op; i++) {
            double v = s[i], low = lower - r[i], high = upper + r[i];
            v = v < low ? low : v;
            v = v > high ? high : v;
            s[i] = v;
            sum += w[i] * v;
        }
        y[t] = sum;
        previous = u[t];
    }
}
