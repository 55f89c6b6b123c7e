"""Bounds of a force balance: springs stay stiff, areas exceed friction, and stiffness their loss.

Then the energy is convex, and there is one equilibrium. Identification demands it of coefficients, and
adaptation of factors on them.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.polynomial import Polynomial

from mckibben.arrays import Array
from mckibben.blocks.coupled import balance_terms as at
from mckibben.blocks.coupled.balance_terms import NEVER, ORDER, Indices, Sizes, layout

LEAST_LEFT = 0.05
"""Smallest area left after friction, relative to the area at rest."""

GRID = 21
"""Grid points over the known range of a displacement at which constraints are checked."""


def places_of(c: Array) -> dict[str, Indices]:
    """Return where the coefficients of a balance are, a row a coordinate or muscle."""
    return layout(Sizes(*c[: at.COORDINATES].astype(int).tolist())).at


def ratios(c: Array, k: int, scheduled: Array) -> tuple[float, float]:
    """Return the bounds on friction over area, and on area over stiffness, as factors.

    At least 1: what was fitted may be. Springs of coordinates add what they have for all muscles
    whatever their factors: f w w' is at most f diag(w w'), times how many coordinates one moves.

    Parameters
    ----------
    c : array
        Coefficients of the balance.
    k : int
        The muscle.
    scheduled : array, shape (s, 2)
        Lowest and highest of what schedules springs.
    """
    places, m, scale = places_of(c), int(c[at.N_COORDINATES]), c[at.SCALE]
    muscle = {name: c[places[name][k]] for name in ORDER["muscle"]}
    springs, ways = c[places["springs"]].reshape(m, -1, 1 + m), c[places["directions"]]
    low, high = muscle["hull"].tolist()
    u = np.linspace(low, high, GRID) / scale
    area, elasticity = Polynomial(muscle["areas"]), Polynomial([0.0, 0.0, *muscle["elasticity"]])
    rise = c[at.GROWTH] / c[at.TOP]
    rubbed = float(muscle["friction"] @ (rise * c[places["limits"][0]] + muscle["walls"]))
    area_left = float(area(u).min()) - LEAST_LEFT * muscle["areas"][0]
    n_moved, most = np.count_nonzero(ways[k]), (ways**2).sum(axis=0).max()
    soft = softest(springs, scheduled, int(c[at.DEGREE]))[0]
    stiff = elasticity.deriv()(u) / scale + max(soft, 0.0) / (n_moved * most) + muscle["bladders"]
    lost = c[at.TOP] * area.deriv()(u) / scale
    loses = lost > 0.0
    least = float(np.min(stiff[loses] / lost[loses], initial=NEVER))
    return max(area_left / rubbed, 1.0) if rubbed > 0.0 else NEVER, max(least, 1.0)


def softest(springs: Array, ends: Array, degree: int) -> tuple[float, Array, Array]:
    """Return the smallest stiffness of springs, shape (m, powers, 1 + m), and where it is.

    Over all combinations of the ``ends`` and middles of what schedules, which are returned with the
    direction.
    """
    result = []
    for x in corners(ends):
        matrix = springs_at(springs, x, degree)[:, 1:]
        stiffnesses, directions = np.linalg.eigh(0.5 * (matrix + matrix.T))
        result.append((float(stiffnesses[0]), x, directions[:, 0]))
    return min(result, key=lambda candidate: candidate[0])


def springs_at(springs: Array, x: Array, degree: int) -> Array:
    """Return constant forces and springs, shape (..., m, 1 + m), at what schedules, shape (s, ...)."""
    return np.einsum("q...,jqi->...ji", powers_of(x, degree), springs)


def corners(ends: Array) -> list[Array]:
    """Return all combinations of ends, shape (s, 2), and of the middles between them."""
    low, high = ends.T
    return [low + np.array(s) * (high - low) for s in product((0.0, 0.5, 1.0), repeat=len(low))]


def powers_of(x: Array, degree: int) -> Array:
    """Return the powers of what schedules, shape (1 + powers, ...), that multiply springs."""
    powers = [v**d for v in x for d in range(1, degree + 1)]
    return np.array([np.ones(x.shape[1:]), *powers])
