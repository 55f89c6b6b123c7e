"""What of a balance of forces is learnt while it runs: see `mckibben.blocks.coupled.balance_adapting`.

Where no load is measured, forces are known but for their unit, which is the area of muscle 1: that is
not learnt, and a loss of area shows as springs and friction that grew.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.coupled.balance_adapting import (
    AREA,
    FRICTION,
    KINDS,
    OFFSET,
    RELAXATION,
    STIFFNESS,
    balance_adaptive_start,
    balance_adaptive_step,
)
from mckibben.blocks.fields import rows, vector
from mckibben.blocks.inverse import Inverse
from mckibben.blocks.learning import Group, Learnable

if TYPE_CHECKING:
    from mckibben.blocks.coupled.balance import Balance

USUAL_TOP = 10.0
"""Highest pressure where none is said [bar]."""

ALWAYS = 1e9
"""Ratio of factors that is never reached."""

LEAST_LEFT = 0.05
"""Area that friction has to leave, relative to that at rest, as where it was identified."""

GRID = 21
"""Places along what is known of a displacement where conditions are looked at."""


GROUPS = {
    STIFFNESS: Group("springs", "stiffer", "softer"),
    AREA: Group("area", "larger", "smaller"),
    FRICTION: Group("friction"),
    RELAXATION: Group("relaxation", "more", "less"),
    OFFSET: Group("pull", "more", "less"),
}


def learnable_balance(balance: Balance) -> Learnable:
    """Return what is learnt of a balance of forces, a compensator: factors of 1, and forces of 0.

    Factors are expected to change by 30 %, forces by 10 % of that of the highest pressure at rest.
    """
    n, learnt = len(balance.driven), learnt_of(balance)
    kinds = np.array([kind for _, kind in learnt])
    offsets = kinds == OFFSET
    at_rest = np.array([balance.areas[k][0] * top_of(balance) for k, _ in learnt])
    fitted, scales = np.where(offsets, 0.0, 1.0), np.where(offsets, at_rest, 1.0)
    span = max(high - low for low, high in balance.hull)

    def with_parameters(theta: Array) -> Block:
        return Inverse(changed(balance, learnt, theta))

    def group_changes(theta: Array) -> Array:
        """Return means over muscles; a force that is added is a pull that is less."""
        changes = (theta - fitted) / scales
        means = [changes[kinds == kind].mean() if kind in kinds else 0.0 for kind in GROUPS]
        return np.array(
            [-m if kind == OFFSET else m for kind, m in zip(GROUPS, means, strict=True)]
        )

    def numbers(sample_time: float | None) -> Array:
        """Return n, which parameters are learnt, their bounds, and the coefficients as fitted."""
        which = [k * KINDS + kind for k, kind in learnt]
        return np.concatenate([[n], which, ratios(balance), balance.coefficients(sample_time)])

    return Learnable(
        balance_adaptive_step,
        balance_adaptive_start,
        fitted=fitted,
        scales=scales,
        spread=np.diag(np.where(offsets, 0.1, 0.3) ** 2),
        with_parameters=with_parameters,
        numbers=numbers,
        groups=tuple(GROUPS.values()),
        group_changes=group_changes,
        whole_changes=np.full(len(GROUPS), span or np.inf),
        known_span=span,
        compensates=True,
        n_more_states=n + len(balance.inputs),  # displacements, pressures and what scheduled
        n_more_scratch=n * fitted.size + 2 * n * n + n + balance.coefficients(1.0).size,
    )


def learnt_of(balance: Balance) -> list[tuple[int, int]]:
    """Return the muscle and the kind of every parameter that is learnt."""
    found = []
    for k in range(len(balance.driven)):
        there = {
            OFFSET: True,
            STIFFNESS: True,
            AREA: k > 0 or balance.n_loads > 0,
            FRICTION: any(balance.friction[k]),
            RELAXATION: any(balance.relaxation[k]),
        }
        found += [(k, kind) for kind in range(KINDS) if there[kind]]
    return found


def top_of(balance: Balance) -> float:
    """Return the highest pressure."""
    reach = balance.pressure_range
    return USUAL_TOP if reach is None else max(abs(reach[0]), abs(reach[1]))


def changed(balance: Balance, learnt: list[tuple[int, int]], theta: Array) -> Balance:
    """Return the balance with other forces and factors."""
    n = len(balance.driven)
    factors = np.ones((n, KINDS))
    factors[:, OFFSET] = 0.0
    for (k, kind), value in zip(learnt, theta.tolist(), strict=True):
        factors[k, kind] = value
    stiff = factors[:, STIFFNESS]
    springs = np.array(balance.springs).reshape(n, -1, 1 + n)
    springs[:, :, 1:] *= np.sqrt(np.outer(stiff, stiff))[:, np.newaxis, :]
    springs[:, 0, 0] += factors[:, OFFSET]

    def scaled(table: Any, kind: int) -> Any:
        return rows(np.array(table) * factors[:, kind, np.newaxis])

    return replace(
        balance,
        springs=rows(springs.reshape(n, -1)),
        elasticity=scaled(balance.elasticity, STIFFNESS),
        areas=scaled(balance.areas, AREA),
        friction=scaled(balance.friction, FRICTION),
        relaxation=scaled(balance.relaxation, RELAXATION),
        bladders=vector(np.array(balance.bladders) * stiff) if balance.bladders else (),
    )


def ratios(balance: Balance) -> Array:
    """Return most friction by area, and most area by stiffness, as factors, of every muscle in turn.

    At least 1: what was fitted may be.
    """
    found, softest, top = [], softest_of(balance), top_of(balance)
    for k in range(len(balance.driven)):
        u = np.linspace(balance.hull[k][0], balance.hull[k][1], GRID) / balance.scale
        area = np.polynomial.Polynomial(balance.areas[k])
        elasticity = np.polynomial.Polynomial([0.0, 0.0, *balance.elasticity[k]])
        rubbed = float(np.dot(balance.friction[k], np.array(balance.limits) + balance.walls[k]))
        spared = float(area(u).min()) - LEAST_LEFT * balance.areas[k][0]
        bladder = balance.bladders[k] if balance.bladders else 0.0
        stiff = elasticity.deriv()(u) / balance.scale + bladder + softest
        lost = top * area.deriv()(u) / balance.scale
        loses = lost > 0.0
        soft = float(np.min(stiff[loses] / lost[loses])) if loses.any() else ALWAYS
        found += [max(spared / rubbed, 1.0) if rubbed > 0.0 else ALWAYS, max(soft, 1.0)]
    return np.minimum(found, ALWAYS)


def softest_of(balance: Balance) -> float:
    """Return the least stiffness of the springs between muscles, whatever schedules them."""
    n = len(balance.driven)
    springs = np.array(balance.springs).reshape(n, -1, 1 + n)[:, :, 1:]
    n_x = len(balance.scheduled) - balance.n_loads
    ends = balance.known[:n_x] if balance.known else n_x * ((0.0, 0.0),)
    found = []
    for shares in product((0.0, 0.5, 1.0), repeat=n_x):
        x = [low + share * (high - low) for share, (low, high) in zip(shares, ends, strict=True)]
        powers = [1.0, *(v**d for v in x for d in range(1, balance.degree + 1))]
        matrix = np.tensordot(np.array(powers), springs, (0, 1))
        found.append(float(np.linalg.eigvalsh(0.5 * (matrix + matrix.T))[0]))
    return max(min(found), 0.0)
