"""What a balance of forces says of muscles, in sentences with units."""

from __future__ import annotations

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.coupled.balance import Balance
from mckibben.estimators.coupled.balance_structure import GRID, LEAST_LEFT, LEAST_STIFF, Structure

POOR = 0.1
"""Error relative to the range from which a model is said not to explain the recordings."""

NEAR = 1.2
"""Times a bound up to which it is said to hold something back."""


def sentences(block: Balance, structure: Structure) -> list[str]:
    """Return how much of every muscle is area, spring, friction and relaxation."""
    unit = "N" if structure.in_newtons else block.given[0].unit
    driving = block.given[0].unit
    per = f" N/{driving}" if structure.in_newtons else " of muscle 1's at rest"
    p, x = 0.5 * structure.highest, structure.scheduled_hull.mean(axis=1)
    at = "".join(
        f", {channel.name} {value:.3g} {channel.unit}"
        for channel, value in zip(structure.scheduled, x, strict=True)
    )
    times = " and ".join(f"{lag:.3g} s" for lag in block.lags)
    found = []
    for k, channel in enumerate(block.driven):
        y, mm = float(np.mean(block.hull[k])), channel.unit
        rest, middle = (_area(block, k, place) for place in (0.0, y))
        stiff = _slope(block.elasticity[k], y / block.scale) / block.scale + _spring(
            block, k, x, structure
        )
        rubbing = 0.0
        for h, limit in zip(block.friction[k], block.limits, strict=True):
            travel = limit * (p + block.grip)
            if travel < 0.5 * (block.hull[k][1] - block.hull[k][0]):
                rubbing += h * travel
            else:  # never breaks away
                stiff += h
        fading = sum(block.relaxation[k])
        found.append(
            f"{channel.name} at {y:.3g} {mm} and {p:.3g} {driving}{at}: area {middle:.3g}{per} "
            f"({rest:.3g} at rest); springs and rubber {stiff:.3g} {unit}/{mm}; friction up to "
            f"{rubbing:.3g} {unit} either way, {100 * rubbing / max(middle * p, 1e-12):.2g} % of the "
            "pull"
            + (f"; {fading:.3g} {unit}/{mm} more that fades within {times}" if block.lags else "")
            + (f"; {1e3 * block.mass[k]:.3g} kg are moved" if block.mass and unit == "N" else "")
            + (
                f"; it pushes up to {block.pushes[k]:.3g} {unit}, then goes slack"
                if block.pushes
                else ""
            )
        )
    return found


def missed(cost: float) -> list[str]:
    """Return that a model misses much of the range, if it does."""
    if cost < POOR:
        return []
    return [
        f"this model misses {100 * cost:.2g} % of what moves: it does not explain these recordings. "
        "Remedy: check channels, units, signs and zeros, recording by recording"
    ]


def held_back(block: Balance, structure: Structure) -> list[str]:
    """Return which conditions of physics hold the fit back."""
    found = []
    for k, channel in enumerate(block.driven):
        mm = channel.unit
        places = np.linspace(block.hull[k][0], block.hull[k][1], GRID)
        taken = sum(
            h * (r + block.walls[k]) for h, r in zip(block.friction[k], block.limits, strict=True)
        )
        left = np.array([_area(block, k, y) for y in places]) - taken
        worst = int(np.argmin(left))
        if left[worst] < NEAR * LEAST_LEFT * block.areas[k][0]:
            found.append(
                f"{channel.name}: friction would outweigh the area at {places[worst]:.3g} {mm}, and "
                "is kept from it; beware of pressures there"
            )
        stiff = [_stiffness(block, k, at, p) for at in places for p in (0.0, structure.highest)]
        softest = int(np.argmin(stiff))
        if (
            stiff[softest]
            < 2.0 * LEAST_STIFF * block.areas[k][0] * structure.highest / structure.scale
        ):
            found.append(
                f"{channel.name}: it would have no stiffness left at {places[softest // 2]:.3g} {mm}, "
                "and is kept from it"
            )
        if block.walls[k] > 0.099 * structure.scale / structure.highest / NEAR:
            found.append(f"{channel.name}: its wall's stretch is at its bound")
    shortest, longest = structure.lag_range
    for lag in block.lags:
        if not 1.01 * shortest < lag < 0.99 * longest:
            found.append(f"a lag is at its bound, {lag:.3g} s")
    return found


def _stiffness(block: Balance, k: int, y: float, p: float) -> float:
    """Return a muscle's own stiffness without friction and what schedules."""
    u = y / block.scale
    narrows = sum(i * a * u ** (i - 1) for i, a in enumerate(block.areas[k]) if i)
    own = block.springs[k][1 + k] + (block.bladders[k] if block.bladders else 0.0)
    return float(own + (_slope(block.elasticity[k], u) - p * narrows) / block.scale)


def _spring(block: Balance, k: int, x: Array, structure: Structure) -> float:
    """Return a muscle's own spring under what schedules it."""
    springs = np.array(block.springs[k]).reshape(-1, 1 + structure.n)[:, 1 + k]
    own = block.bladders[k] if block.bladders else 0.0
    return float(structure.powers(x) @ springs) + own


def _area(block: Balance, k: int, y: float) -> float:
    powers = (y / block.scale) ** np.arange(len(block.areas[k]))
    return float(np.array(block.areas[k]) @ powers)


def _slope(elasticity: tuple[float, ...], u: float) -> float:
    """Return the slope of the elastic force by u."""
    orders: Array = np.arange(2, 2 + len(elasticity), dtype=np.float64)
    return float(np.array(elasticity) @ (orders * u ** (orders - 1)))
