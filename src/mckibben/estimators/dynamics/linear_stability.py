"""Coordinates in which every point is a stable polynomial.

A polynomial with a leading 1 has its roots within the unit circle where its reflection coefficients
lie between -1 and 1. A search in their inverse hyperbolic tangents needs no bounds, so that it does not
stop at one while other parameters could still improve.

Source: Monahan, "A note on enforcing stationarity in autoregressive-moving average models", 1984.
"""

from __future__ import annotations

import numpy as np

from mckibben.arrays import Array

LARGEST = 1.0 - 1e-7
"""Reflection coefficient."""


def spectral_radius(tail: Array) -> float:
    """Return the largest size of the roots of a polynomial with a leading 1."""
    if tail.size == 0 or not np.isfinite(tail).all():
        return 0.0 if tail.size == 0 else np.inf
    if tail.size > 2:
        return float(np.abs(np.roots([1.0, *tail])).max())
    a, b = float(tail[0]), float(tail[1]) if tail.size == 2 else 0.0
    inner = a * a - 4.0 * b
    return 0.5 * (abs(a) + inner**0.5) if inner >= 0 else b**0.5


def inside(tail: Array, radius: float) -> Array:
    """Return a polynomial, leading 1 left out, with roots outside reflected to within a radius.

    Reflection at the unit circle leaves the spectrum of a noise as it is, but for a factor.
    """
    if spectral_radius(tail) < radius:
        return tail
    roots = np.roots([1.0, *tail])
    outside = np.abs(roots) > 1.0
    roots[outside] = 1.0 / roots[outside].conj()
    size = np.abs(roots)
    far = size >= radius
    roots[far] *= radius * (1.0 - 1e-9) / size[far]
    return np.asarray(np.real(np.poly(roots))[1:], dtype=np.float64)


def free_coordinates(tail: Array) -> Array:
    """Return the coordinates of a stable polynomial, leading 1 left out; those of the next within."""
    a, found = tail, np.empty(tail.size)
    for m in range(tail.size, 0, -1):
        k = found[m - 1] = float(np.clip(a[-1], -LARGEST, LARGEST))
        a = (a[:-1] - k * a[-2::-1]) / (1.0 - k * k) if m > 1 else a[:0]
    return np.asarray(np.arctanh(found / (1.0 + 1e-9)))


def polynomial(coordinates: Array) -> tuple[Array, Array]:
    """Return the polynomial of coordinates, leading 1 left out, and its derivatives by them, (n, n)."""
    n = coordinates.size
    reflection = np.clip(np.tanh(coordinates), -LARGEST, LARGEST)
    a, slopes = np.empty(0), np.empty((0, n))
    for m, k in enumerate(reflection.tolist()):
        by_own = np.eye(1, n, m)
        grown = slopes + k * slopes[::-1] + np.outer(a[::-1], by_own)
        a, slopes = np.append(a + k * a[::-1], k), np.vstack([grown, by_own])
    return a, slopes * (1.0 - reflection**2)
