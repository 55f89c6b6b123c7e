"""What a balance of forces says of muscles, in sentences with units."""

from __future__ import annotations

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.coupled.balance import Balance
from mckibben.estimators.coupled.balance_structure import GRID, LEAST_LEFT, LEAST_STIFF, Structure

NEAR = 1.2
"""Times a bound up to which it is said to hold something back."""


def sentences(block: Balance, structure: Structure) -> list[str]:
    """Return how much of every muscle is area, spring, friction and relaxation."""
    unit = "N" if structure.in_newtons else block.given[0].unit
    driving = block.given[0].unit
    per = f" N/{driving}" if structure.in_newtons else " of muscle 1's at rest"
    p = 0.5 * structure.highest
    found = []
    for k, channel in enumerate(block.driven):
        y = float(np.mean(block.hull[k]))
        rest, middle = (_area(block, k, at) for at in (0.0, y))
        spring = block.springs[k][1 + k] + (block.bladders[k] if block.bladders else 0.0)
        stiff = spring + _slope(block.elasticity[k], y / block.scale) / block.scale
        rubbing = sum(
            h * r * (p + block.grip) for h, r in zip(block.friction[k], block.limits, strict=True)
        )
        fading = sum(block.relaxation[k])
        times = " and ".join(f"{lag:.3g} s" for lag in block.lags)
        found.append(
            f"{channel.name} at {y:.3g} mm and {p:.3g} {driving}: area {middle:.3g}{per} ({rest:.3g} at "
            f"rest); springs and rubber {stiff:.3g} {unit}/mm; friction up to {rubbing:.3g} {unit} "
            f"either way, {100 * rubbing / max(middle * p, 1e-12):.2g} % of the pull"
            + (f"; {fading:.3g} {unit}/mm more that fades within {times}" if block.lags else "")
            + (
                f"; it pushes up to {block.pushes[k]:.3g} {unit}, then goes slack"
                if block.pushes
                else ""
            )
        )
    return found


def held_back(block: Balance, structure: Structure) -> list[str]:
    """Return which conditions of physics hold the fit back."""
    found = []
    for k, channel in enumerate(block.driven):
        places = np.linspace(block.hull[k][0], block.hull[k][1], GRID)
        taken = sum(
            h * (r + block.walls[k]) for h, r in zip(block.friction[k], block.limits, strict=True)
        )
        left = np.array([_area(block, k, y) for y in places]) - taken
        worst = int(np.argmin(left))
        if left[worst] < NEAR * LEAST_LEFT * block.areas[k][0]:
            found.append(
                f"{channel.name}: friction would outweigh the area at {places[worst]:.3g} mm, and "
                "is kept from it; beware of pressures there"
            )
        stiff = [_stiffness(block, k, at, p) for at in places for p in (0.0, structure.highest)]
        softest = int(np.argmin(stiff))
        if (
            stiff[softest]
            < 2.0 * LEAST_STIFF * block.areas[k][0] * structure.highest / structure.scale
        ):
            found.append(
                f"{channel.name}: it would have no stiffness left at {places[softest // 2]:.3g} mm, and "
                "is kept from it"
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


def _area(block: Balance, k: int, y: float) -> float:
    powers = (y / block.scale) ** np.arange(len(block.areas[k]))
    return float(np.array(block.areas[k]) @ powers)


def _slope(elasticity: tuple[float, ...], u: float) -> float:
    """Return the slope of the elastic force by u."""
    orders: Array = np.arange(2, 2 + len(elasticity), dtype=np.float64)
    return float(np.array(elasticity) @ (orders * u ** (orders - 1)))
