"""What of a balance of forces is learnt while it runs: see `mckibben.blocks.coupled.balance_adapting`.

Where no load is measured, forces are known but for their unit, which is the area of muscle 1: that is
not learnt, and a loss of area shows as springs and friction that grew.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING, Any, ClassVar, cast

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.adaptive.adaptable import Adaptable, Group
from mckibben.blocks.base import Block
from mckibben.blocks.coupled.balance_adapting import (
    AREA,
    FRICTION,
    KINDS,
    OFFSET,
    RELAXATION,
    STIFFNESS,
)
from mckibben.blocks.fields import rows, vector
from mckibben.blocks.inverse import Inverse

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


class LearntBalance(Adaptable):
    """A balance of forces, as far as it is learnt."""

    groups: ClassVar[tuple[Group, ...]] = (
        Group("springs", "stiffer", "softer"),
        Group("area", "larger", "smaller"),
        Group("friction"),
        Group("relaxation", "more", "less"),
        Group("pull", "more", "less"),
    )
    learns_inverted: ClassVar[bool] = False

    @property
    def _own(self) -> Balance:
        return cast("Balance", self)

    @property
    def learnt(self) -> list[tuple[int, int]]:
        """Muscle and kind of every parameter that is learnt."""
        own = self._own
        found = []
        for k in range(len(own.driven)):
            there = {
                OFFSET: True,
                STIFFNESS: True,
                AREA: k > 0 or own.n_loads > 0,
                FRICTION: any(own.friction[k]),
                RELAXATION: any(own.relaxation[k]),
            }
            found += [(k, kind) for kind in range(KINDS) if there[kind]]
        return found

    @property
    def taught(self) -> Array:
        """Forces of 0, factors of 1."""
        return np.array([float(kind != OFFSET) for _, kind in self.learnt])

    @property
    def top(self) -> float:
        """Highest pressure."""
        reach = self._own.pressure_range
        return USUAL_TOP if reach is None else max(abs(reach[0]), abs(reach[1]))

    @property
    def scales(self) -> Array:
        """Force of the highest pressure on the area at rest; 1 of factors."""
        at_rest = [row[0] * self.top for row in self._own.areas]
        return np.array([at_rest[k] if kind == OFFSET else 1.0 for k, kind in self.learnt])

    @property
    def spread(self) -> Array:
        """Factors by 30 %, forces by 10 % of the scale."""
        return np.diag([(0.1 if kind == OFFSET else 0.3) ** 2 for _, kind in self.learnt])

    def retaught(self, theta: Array) -> Block:
        """Return the balance with other forces and factors, solved for displacements."""
        own, n = self._own, len(self._own.driven)
        factors = np.ones((n, KINDS))
        factors[:, OFFSET] = 0.0
        for (k, kind), value in zip(self.learnt, theta.tolist(), strict=True):
            factors[k, kind] = value
        stiff = factors[:, STIFFNESS]
        shared = np.sqrt(np.outer(stiff, stiff))
        springs = np.array(own.springs).reshape(n, -1, 1 + n)
        springs[:, :, 1:] *= shared[:, np.newaxis, :]
        springs[:, 0, 0] += factors[:, OFFSET]

        def scaled(table: Any, kind: int) -> Any:
            return rows(np.array(table) * factors[:, kind, np.newaxis])

        changed = replace(
            own,
            springs=rows(springs.reshape(n, -1)),
            elasticity=scaled(own.elasticity, STIFFNESS),
            areas=scaled(own.areas, AREA),
            friction=scaled(own.friction, FRICTION),
            relaxation=scaled(own.relaxation, RELAXATION),
            bladders=vector(np.array(own.bladders) * stiff) if own.bladders else (),
        )
        return Inverse(changed)

    def group_changes(self, theta: Array) -> Array:
        """Return means over muscles; of the pull, of the force of the highest pressure."""
        found = np.zeros(len(self.groups))
        places = {STIFFNESS: 0, AREA: 1, FRICTION: 2, RELAXATION: 3, OFFSET: 4}
        for kind, place in places.items():
            of_kind = [i for i, (_, one) in enumerate(self.learnt) if one == kind]
            if of_kind:
                changes = (theta - self.taught)[of_kind] / self.scales[of_kind]
                found[place] = -changes.mean() if kind == OFFSET else changes.mean()
        return found

    @property
    def ratios(self) -> Array:
        """Most friction by area, and most area by stiffness, as factors, of every muscle in turn.

        At least 1: what was fitted may be.
        """
        own, found = self._own, []
        softest = self._softest()
        for k in range(len(own.driven)):
            u = np.linspace(own.hull[k][0], own.hull[k][1], GRID) / own.scale
            area = np.polynomial.Polynomial(own.areas[k])
            elasticity = np.polynomial.Polynomial([0.0, 0.0, *own.elasticity[k]])
            rubbed = float(np.dot(own.friction[k], np.array(own.limits) + own.walls[k]))
            spared = float(area(u).min()) - LEAST_LEFT * own.areas[k][0]
            bladder = own.bladders[k] if own.bladders else 0.0
            stiff = elasticity.deriv()(u) / own.scale + bladder + softest
            lost = self.top * area.deriv()(u) / own.scale
            loses = lost > 0.0
            soft = float(np.min(stiff[loses] / lost[loses])) if loses.any() else ALWAYS
            found += [max(spared / rubbed, 1.0) if rubbed > 0.0 else ALWAYS, max(soft, 1.0)]
        return np.minimum(found, ALWAYS)

    def _softest(self) -> float:
        """Return the least stiffness of the springs between muscles, whatever schedules them."""
        own, n = self._own, len(self._own.driven)
        springs = np.array(own.springs).reshape(n, -1, 1 + n)[:, :, 1:]
        n_x = len(own.scheduled) - own.n_loads
        ends = own.known[:n_x] if own.known else n_x * ((0.0, 0.0),)
        found = []
        for shares in product((0.0, 0.5, 1.0), repeat=n_x):
            x = [
                low + share * (high - low) for share, (low, high) in zip(shares, ends, strict=True)
            ]
            powers = [1.0, *(v**d for v in x for d in range(1, own.degree + 1))]
            matrix = np.tensordot(np.array(powers), springs, (0, 1))
            found.append(float(np.linalg.eigvalsh(0.5 * (matrix + matrix.T))[0]))
        return max(min(found), 0.0)

    @property
    def known_span(self) -> float:
        """Of the displacements known."""
        return max(high - low for low, high in self._own.hull)

    @property
    def n_more_states(self) -> int:
        """Displacements, pressures and what scheduled, of the last sample."""
        return len(self._own.driven) + len(self._own.inputs)

    @property
    def n_learning_scratch(self) -> int:
        """Slopes of residuals, two matrices and a vector; then the coefficients as they are now."""
        n = len(self._own.driven)
        return n * self.taught.size + 2 * n * n + n + self._own.coefficients(1.0).size

    def adaptive_numbers(self, sample_time: float | None) -> Array:
        """Return n, which parameters are learnt, their bounds, and the coefficients as fitted."""
        n, which = len(self._own.driven), [k * KINDS + kind for k, kind in self.learnt]
        return np.concatenate([[n], which, self.ratios, self._own.coefficients(sample_time)])
