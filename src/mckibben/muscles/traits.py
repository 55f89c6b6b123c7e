"""Traits of a muscle's force balance, independent of its size, for comparison.

A data sheet gives the scales: the area at rest A and its loss with contraction by the braid's geometry,
the stroke, the highest pressure P, the force P A. Over these, in logarithms, are taken

    area         at rest (of models that know newtons); and its loss, over the braid's
    elasticity   the force without pressure, along the stroke, beyond that at displacement 0
    friction     after travels from a reversal, under a low and a high pressure
    relaxation   the stiffness that has not relaxed after some times
    damping      by velocity, and of the line
    wall         its stretch by pressure
    offset       the force without pressure at displacement 0 (of models that know newtons)

They depend neither on how many stops and lags a model has, nor on which displacements it was fitted.
What may vanish has the least that would matter added before the logarithm; the offset, which has a
sign, is over the force, and no logarithm.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import polynomial

from mckibben.arrays import Array
from mckibben.blocks.coupled.balance import Balance
from mckibben.muscles.sheet import Sheet

ALONG = np.array([0.2, 0.4, 0.6, 0.8, 1.0])
"""Contractions of the traits, relative to the largest."""

TRAVELS = np.geomspace(0.001, 0.2, 6)
"""Distances from a reversal, relative to the stroke."""

PRESSURES = np.array([0.25, 0.75])
"""Pressures at which friction is evaluated, relative to the highest."""

TIMES = np.array([0.1, 0.4, 1.6, 6.4, 25.6, 102.4])
"""Times at which relaxation is evaluated [s]."""

LEAST = {"elasticity": 0.05, "friction": 3e-4, "relaxation": 0.03, "damping": 1e-3, "wall": 3e-3}
"""What hardly matters: of the force at the largest contraction, of force, of elastic stiffness, of force
over stroke by a second, of stroke."""

GROUPS = {
    "area": 1,
    "loss": ALONG.size,
    "elasticity": ALONG.size,
    "friction": PRESSURES.size * TRAVELS.size,
    "relaxation": TIMES.size,
    "damping": 1,
    "wall": 1,
    "offset": 1,
}
"""Names of traits, and their number of entries."""

GRIDS = {"friction": (PRESSURES.size, TRAVELS.size)}
"""Shapes of traits that are not vectors."""

_ENDS = np.cumsum([0, *GROUPS.values()]).tolist()
PLACES = {
    name: slice(first, last)
    for name, first, last in zip(GROUPS, _ENDS[:-1], _ENDS[1:], strict=True)
}
"""Slices of the traits in the vector of all."""

POSITIONS = {
    name: np.stack([grid.ravel() for grid in np.indices(GRIDS.get(name, (count,)))], axis=1)
    for name, count in GROUPS.items()
}
"""Coordinates of each entry within its trait, shape (entries, axes)."""

COUNT: int = _ENDS[-1]


def traits(balance: Balance, sheet: Sheet, zero: float = 0.0) -> Array:
    """Return the traits of a muscle, undetermined ones as NaN.

    Parameters
    ----------
    balance : Balance
        Of one muscle.
    sheet : Sheet
        Its own.
    zero : float
        How short it is where displacements count from [mm].

    Returns
    -------
    array, shape (COUNT,)
    """
    area = np.array(balance.areas[0])
    ends = sheet.stroke * ALONG - zero
    at_rest = np.array([-zero])
    rest_force = max(float(_straight(area, balance, at_rest)[0]), 0.1 * float(area[0]))
    force = rest_force * sheet.max_pressure_bar  # in the model's own unit of force
    newtons = bool(balance.n_loads)
    values = {
        "area": [_log(rest_force / (balance.loads[0][0] * sheet.area)) if newtons else np.nan],
        "loss": _log(_straight(area, balance, ends) / rest_force, 0.01)
        - np.log(sheet.narrowed(ALONG)),
    }
    h, limits = np.array(balance.friction[0]), np.array(balance.limits)

    def rubbed(p: float, travels: Array) -> Array:
        grown = 1.0 + balance.friction_growth * (p / balance.highest_pressure - 1.0)
        return np.minimum(travels[:, np.newaxis], limits * grown) @ h

    elastance = balance.springs[0][1] + sum(balance.bladders)
    powers = np.array([balance.springs[0][0], elastance * balance.scale, *balance.elasticity[0]])
    at_zero = _straight(powers, balance, at_rest)
    elastic = _straight(powers, balance, ends) - at_zero
    furthest = min(sheet.stroke, float(balance.hull[0][1]) + zero)  # areas beyond are guesses
    share = np.array([furthest / sheet.stroke, 1.0])
    share_left = _straight(area, balance, np.array([furthest - zero]))[0] / rest_force
    held_force = force * max(share_left, 0.02) * np.divide(*sheet.narrowed(share)[::-1])
    values["elasticity"] = _log(elastic / held_force + LEAST["elasticity"], 0.01)
    pressures = sheet.max_pressure_bar * PRESSURES
    shares = [rubbed(p, sheet.stroke * TRAVELS) / (p * rest_force) for p in pressures.tolist()]
    values["friction"] = _log(np.concatenate(shares) + LEAST["friction"])
    fading = np.exp(-TIMES[:, np.newaxis] / np.array([*balance.lags, 1.0]))
    relaxing = fading @ np.array([*balance.relaxation[0], 0.0])
    stiffness = max(float(elastic[-1]), 0.05 * held_force) / sheet.stroke
    values["relaxation"] = _log(relaxing / stiffness + LEAST["relaxation"])
    damping = balance.damping[0] + sum(balance.lines)
    values["damping"] = _log([damping * sheet.stroke / force + LEAST["damping"]])
    stretch = balance.walls[0] * sheet.max_pressure_bar / sheet.stroke
    values["wall"] = _log([stretch + LEAST["wall"]])
    values["offset"] = [at_zero[0] / force if newtons else np.nan]
    return np.concatenate([np.ravel(values[name]) for name in GROUPS])


def _log(values: object, least: float = 1e-6) -> Array:
    return np.log(np.maximum(np.asarray(values, dtype=np.float64), least))


def _straight(powers: Array, balance: Balance, y: Array) -> Array:
    """Return a polynomial with linear extrapolation."""
    inside = np.clip(y, balance.hull[0][0], balance.hull[0][1])
    u = inside / balance.scale
    slope = polynomial.polyval(u, polynomial.polyder(powers)) / balance.scale
    return np.asarray(polynomial.polyval(u, powers) + slope * (y - inside))
