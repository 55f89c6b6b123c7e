#include "flow.h"

static int is_zero(mck_real x) { return !(x < MCK_R(0.0)) && !(x > MCK_R(0.0)); }

/* The way after which w = |v| has shrunk to zero. */
static mck_real way_to_zero(mck_real w, mck_real psi, int n)
{
    if (is_zero(psi)) {
        return w;
    }
    if (n == 1) {
        return -mck_log1p(-psi * w) / psi;
    }
    const mck_real q = mck_sqrt(mck_abs(psi));
    return psi < MCK_R(0.0) ? mck_atan(q * w) / q : mck_atanh(q * w) / q;
}

/* What is left of w = |v| after the way tau. */
static mck_real shrunk(mck_real w, mck_real tau, mck_real psi, int n)
{
    if (is_zero(psi)) {
        return w - tau;
    }
    if (n == 1) {
        return w + mck_expm1(psi * tau) * (w - MCK_R(1.0) / psi);
    }
    const mck_real q = mck_sqrt(mck_abs(psi));
    if (psi < MCK_R(0.0)) {
        const mck_real t = mck_tan(q * tau);
        return (w - t / q) / (MCK_R(1.0) + w * q * t);
    }
    const mck_real t = mck_tanh(q * tau);
    return (w - t / q) / (MCK_R(1.0) - w * q * t);
}

mck_real mck_flow(mck_real v, mck_real tau, mck_real unloading, mck_real loading, int n)
{
    if (v < MCK_R(0.0)) {
        const mck_real needed = way_to_zero(-v, unloading, n);
        if (tau <= needed) {
            return mck_min(-shrunk(-v, tau, unloading, n), MCK_R(0.0));
        }
        v = MCK_R(0.0);
        tau = tau - needed;
    }
    if (n == 1) {
        const mck_real limit = MCK_R(1.0) / loading;
        return limit - (limit - v) * mck_exp(-loading * tau);
    }
    const mck_real q = mck_sqrt(loading);
    const mck_real t = mck_tanh(q * tau);
    return (v + t / q) / (MCK_R(1.0) + v * q * t);
}
