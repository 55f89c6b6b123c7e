"""Structure of a force balance: candidate terms, their parameters, and physical constraints.

Two vectors describe a balance:

values
    All parameters: the linear coefficients, in the order of `mckibben.blocks.coupled.balance_terms` from
    those of the first coordinate on, then the nonlinear parameters.
free parameters
    One for every `Term`. Linear coefficients are ``base + mix @ free``: the springs between two
    coordinates are equal, and a coefficient of a muscle is the common one plus a difference.

The unit of force is such that the area of muscle 1 at rest is 1.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.blocks.coupled import balance_terms as at
from mckibben.blocks.coupled.balance import (
    GRID,
    LEAST_LEFT,
    Balance,
    corners,
    fields_of,
    powers_of,
    softest,
)
from mckibben.blocks.coupled.balance_terms import (
    LINEAR,
    NEVER,
    NONLINEAR,
    TABLE,
    Indices,
    Sizes,
    layout,
)
from mckibben.blocks.fields import Channel, rows, vector

Item = TypeVar("Item")

LEAST_AREA = 1e-9
"""Smallest area at rest, relative to a muscle's typical area."""

LEAST_STIFF = 1e-3
"""Smallest stiffness, relative to the force at the highest pressure over the stroke."""

MOST_STRETCH = {False: 0.1, True: 1.0}
"""Largest stretch of the wall at the highest pressure, relative to the largest shortening, by whether
errors are of force. At a held length stops feel only its ratio to their travel, and noise of the length
is the less motion to them the larger it is.
"""


@dataclass(frozen=True)
class Bench:
    """Channels, ranges and geometry of the recordings.

    Parameters
    ----------
    driven, scheduled, loaded, given : tuple of Channel
        Coordinates, scheduling inputs, loads, and pressures.
    directions : array, shape (n, m)
        Shortening of every muscle per unit of every coordinate.
    hull : array, shape (n, 2)
        Lowest and highest shortening of every muscle, recorded or in its prior [mm].
    lowest, travel : array, shape (m,)
        Lowest value and range of every coordinate.
    levels : array, shape (s, 2)
        Lowest and highest value of every scheduling input.
    highest, heaviest : float
        Highest pressure [bar]; largest load, 1 without one.
    preload : float
        Mean pressure [bar].
    tare : bool
        Whether coordinates are relative to the start of each recording, at rest.
    lag_range : (float, float)
        Shortest and longest time constant identifiable from the recordings [s].
    step : float
        Shortest sample time [s]; 0 without time.
    of_force : bool
        Whether errors are those of the one load, not of coordinates; its coefficient is then 1, instead
        of the area.
    curved : bool
        Whether every scheduling input has three levels or more.
    unmeasured : tuple of int
        Recordings whose unmeasured constant loads are estimated.
    """

    driven: tuple[Channel, ...]
    scheduled: tuple[Channel, ...]
    loaded: tuple[Channel, ...]
    given: tuple[Channel, ...]
    directions: Array
    hull: Array
    lowest: Array
    travel: Array
    levels: Array
    highest: float
    heaviest: float
    preload: float
    tare: bool
    lag_range: tuple[float, float]
    step: float
    of_force: bool = False
    curved: bool = True
    unmeasured: tuple[int, ...] = ()

    @property
    def directed(self) -> bool:
        """Whether muscles act along directions, instead of each on a coordinate of its own."""
        n, m = self.directions.shape
        return n != m or not bool((self.directions == np.eye(n)).all())

    @property
    def unit(self) -> float:
        """Typical area of a muscle."""
        return self.heaviest / self.highest if self.of_force else 1.0

    @property
    def most_stretch(self) -> float:
        """Largest stretch of the wall by pressure [mm/bar]."""
        return MOST_STRETCH[self.of_force] * self.scale / self.highest

    @property
    def scale(self) -> float:
        """Largest shortening [mm]."""
        return float(np.abs(self.hull).max())

    @property
    def stroke(self) -> float:
        """Largest range of a shortening [mm]."""
        return float(np.ptp(self.hull, axis=1).max())

    @property
    def largest(self) -> Array:
        """Largest magnitude of scheduling inputs, 1 if that is 0."""
        most = np.abs(self.levels).max(axis=1)
        return np.where(most > 0, most, 1.0)

    def natural(self, unit: str) -> float:
        """Return the natural size of a unit."""
        force = self.highest * self.unit
        sizes = {"N": force, "N/bar": self.unit, "bar": self.highest, "mm/bar": self.most_stretch}
        return sizes.get(unit, force / self.scale if unit.startswith("N") else 1.0)


class Term(NamedTuple):
    """A free parameter: its kind, its index, and its muscle if it is the difference of one."""

    kind: str
    which: int = 0
    muscle: int | None = None


@dataclass(frozen=True)
class Structure:
    """Sizes of a balance, its terms, and the positions of their parameters.

    Parameters
    ----------
    bench : Bench
    n_elastic, n_area : int
        Number of elastic terms, from the square on; of area terms, with the constant.
    limits, lags : tuple of float
        Break-away travels of the stops [mm/bar]; initial time constants [s].
    obstacles : tuple of (int, float)
        Side, 1 or -1, and initial position in the range of every coordinate, 0 to 1.
    degree : int
        Highest power of the scheduling inputs.
    settled : bool
        Whether muscles have settled at the start of every recording.
    """

    bench: Bench
    n_elastic: int
    n_area: int
    limits: tuple[float, ...]
    lags: tuple[float, ...]
    obstacles: tuple[tuple[int, float], ...] = ()
    degree: int = 1
    settled: bool = False

    # -- positions of parameters -----------------------------------------------------------------

    @property
    def n(self) -> int:
        """Number of muscles."""
        return len(self.bench.given)

    @property
    def m(self) -> int:
        """Number of coordinates."""
        return len(self.bench.driven)

    @property
    def n_x(self) -> int:
        """Number of scheduling inputs, without loads."""
        return len(self.bench.scheduled)

    @cached_property
    def sizes(self) -> Sizes:
        """The numbers of all that the balance has."""
        return Sizes(
            muscles=self.n,
            coordinates=self.m,
            schedules=self.n_x,
            degree=self.degree,
            loads=len(self.bench.loaded),
            stops=len(self.limits),
            lags=len(self.lags),
            elastic=self.n_elastic,
            area=self.n_area,
            obstacles=len(self.obstacles),
        )

    @cached_property
    def at(self) -> dict[str, Indices]:
        """Indices of the values: of linear ones a row a coordinate or muscle, of others a vector."""
        places = layout(self.sizes)
        first = places.head[at.COORDINATES]
        found = {name: index - first for name, index in places.at.items()}
        end = places.size - first
        for name in NONLINEAR:
            # all muscles have one stretch of the wall
            count = 1 if name == "walls" else self.sizes.of(TABLE[name].of)
            found[name] = end + np.arange(count * self.sizes.number(TABLE[name].width))
            end += found[name].size
        return found

    @cached_property
    def springs(self) -> Indices:
        """Indices of springs, shape (m, powers, 1 + m): a constant, then to every coordinate."""
        return self.at["springs"].reshape(self.m, -1, 1 + self.m)

    @cached_property
    def n_linear(self) -> int:
        """Number of linear coefficients, including unused ones."""
        return int(self.at[NONLINEAR[0]][0])

    @property
    def size(self) -> int:
        """Number of values."""
        return self.n_linear + sum(self.at[name].size for name in NONLINEAR)

    def nonlinear_values(self, values: Array, name: str) -> Array:
        """Return the nonlinear parameters of a kind."""
        part = values[self.at[name]]
        return np.exp(part) if TABLE[name].log else part

    # -- free parameters -------------------------------------------------------------------------

    @cached_property
    def _columns(self) -> list[tuple[Term, list[int]]]:
        """All linear terms, and the indices of their coefficients."""
        columns: list[tuple[Term, list[int]]] = []
        for q, j in product(range(self.springs.shape[1]), range(self.m)):
            if q or not self.bench.tare:  # relative coordinates have no constant force
                columns.append((Term("springs", q), [int(self.springs[j, q, 0])]))
            for i in range(j, self.m):
                both = {int(self.springs[j, q, 1 + i]), int(self.springs[i, q, 1 + j])}
                columns.append((Term("springs", q), sorted(both)))
        for j in range(self.m):
            if not self.bench.of_force:
                columns += [(Term("loads", j), [index]) for index in self.at["loads"][j].tolist()]
            for number, index in self._stiffnesses(j):
                columns.append((Term("obstacles", number), [index]))
        for kind in LINEAR["muscle"]:
            for which, shared in enumerate(self.at[kind].T.tolist()):
                if kind != "areas" or which or self.bench.of_force:
                    columns.append((Term(kind, which), shared))
                columns += [(Term(kind, which, k), [shared[k]]) for k in range(1, self.n)]
        return columns

    def _stiffnesses(self, j: int) -> list[tuple[int, int]]:
        """Return number and index of every stiffness of the obstacles of a coordinate."""
        table = self.at["obstacles"][j].reshape(-1, self.sizes.obstacle)[:, at.STIFFNESS :]
        return [(number, index) for number, row in enumerate(table.tolist()) for index in row]

    @cached_property
    def terms(self) -> tuple[Term, ...]:
        """Candidate terms, linear first, then nonlinear."""
        nonlinear = [Term(name, which) for name in NONLINEAR for which in range(self.at[name].size)]
        return (*(term for term, _ in self._columns), *nonlinear)

    @cached_property
    def mix(self) -> Array:
        """Matrix from free parameters to linear coefficients, shape (linear, free)."""
        mix = np.zeros((self.n_linear, len(self._columns)))
        for column, (_, indices) in enumerate(self._columns):
            mix[indices, column] = 1.0
        return mix

    @cached_property
    def base(self) -> Array:
        """Linear coefficients if all free ones are 0: areas at rest, or that of the load, are 1."""
        values = np.zeros(self.n_linear)
        if self.bench.of_force:
            values[self.at["loads"][0]] = 1.0
        else:
            values[self.at["areas"][:, 0]] = 1.0
        return values

    def free(self, name: str) -> slice:
        """Return the positions of a kind of nonlinear parameter among the free ones."""
        shift = self.mix.shape[1] - self.n_linear
        size = self.at[name].size
        first = int(self.at[name][0]) + shift if size else 0
        return slice(first, first + size)

    @cached_property
    def not_negative(self) -> NDArray[np.bool_]:
        """Mask of the non-negative linear coefficients."""
        mask = np.zeros(self.n_linear, dtype=bool)
        for name in (*LINEAR["coordinate"], *LINEAR["muscle"]):
            mask[self.at[name]] = TABLE[name].least == 0.0
        return mask

    @cached_property
    def bounded(self) -> NDArray[np.bool_]:
        """Mask of the non-negative free parameters; slackening starts from a model without."""
        shape = [TABLE[name].least == 0.0 and name != "pushes" for name, _, _ in self.terms]
        shape[: self.mix.shape[1]] = self.not_negative @ self.mix > 0
        return np.array(shape) & np.array([muscle is None for _, _, muscle in self.terms])

    def expanded(self, free: Array) -> Array:
        """Return all values from the free ones."""
        n = self.mix.shape[1]
        return np.concatenate([self.base + self.mix @ free[:n], free[n:]])

    def initial(self, friction_offset: float, stretch: float = 0.0) -> Array:
        """Return initial free parameters: all terms without effect, except the friction offset.

        ``stretch`` of the wall is relative to the largest.
        """
        low = self.bench.lowest[:, np.newaxis]
        positions = low + np.outer(self.bench.travel, [position for _, position in self.obstacles])
        free = np.zeros(len(self.terms))
        free[self.free("friction_offset")] = friction_offset
        free[self.free("walls")] = stretch * self.bench.most_stretch
        free[self.free("lags")] = np.log(self.lags)
        free[self.free("pushes")] = NEVER
        free[self.free("places")] = positions.ravel()
        return free

    def transferred(self, other: Structure, free: Array, default: Array | None = None) -> Array:
        """Return free parameters as those of another structure, ``default`` for its further ones."""
        result = other.initial(0.0) if default is None else default[: len(other.terms)].copy()
        by_key: dict[tuple[object, ...], list[float]] = {}
        for key, value in zip(self.keys, free.tolist(), strict=True):
            by_key.setdefault(key, []).append(value)
        for index, key in enumerate(other.keys):
            if by_key.get(key):
                result[index] = by_key[key].pop(0)
        return result

    @cached_property
    def keys(self) -> list[tuple[object, ...]]:
        """Keys of the terms across structures: limits, lags and obstacles by their initial values."""
        by: dict[str, Sequence[object]] = {"friction": self.limits, "relaxation": self.lags}
        by |= {"lags": self.lags, "obstacles": self.obstacles, "places": self.m * self.obstacles}
        return [
            (kind, by[kind][which] if kind in by else which, muscle)
            for kind, which, muscle in self.terms
        ]

    def scales(self) -> Array:
        """Return the scales of all free parameters, relative to an area at rest of 1."""
        linear = np.zeros(self.n_linear)
        for name in (*LINEAR["coordinate"], *LINEAR["muscle"]):
            linear[self.at[name]] = self.bench.natural(TABLE[name].unit)
        force = self.bench.natural("N")
        linear[self.at["loads"]] = force / self.bench.heaviest
        powers = 1.0 / powers_of(self.bench.largest, self.degree)
        linear[self.springs] = np.outer(powers, [force, *self.m * [self.bench.natural("N/mm")]])
        return np.append(self.mix.T @ linear / self.mix.sum(axis=0), self.nonlinear_bounds()[2])

    def nonlinear_bounds(self) -> tuple[Array, Array, Array]:
        """Return lower and upper bounds of the nonlinear parameters, and their scales."""
        bench, n = self.bench, self.n_linear
        lower, upper, scales = np.zeros((3, self.size - n))
        for name in NONLINEAR:
            kind, here = TABLE[name], self.at[name] - n
            natural = np.full(here.size, bench.natural(kind.unit))
            if name == "friction_slopes":
                natural = bench.highest / bench.largest
            elif name == "places":
                natural = bench.travel.repeat(len(self.obstacles))
            lower[here], upper[here] = kind.least * natural, kind.most * natural
            scales[here] = kind.scale * natural
        lags = self.at["lags"] - n
        lower[lags], upper[lags] = np.log(bench.lag_range)
        scales[self.at["filling"] - n] = max(4.0 * bench.step, 1e-9)
        return lower, upper, scales

    # -- block -----------------------------------------------------------------------------------

    def block(self, values: Array, *, final: bool = False) -> Balance:
        """Return the balance with these values, without the air and dead zone in front of it.

        The ``final`` one has no terms without effect, and the springs of muscles that cannot go slack
        are added to those of their coordinates.
        """
        bench, n = self.bench, self.n
        given = {name: values[self.at[name]] for name in (*LINEAR["muscle"], "springs", "loads")}
        for name in LINEAR["muscle"]:
            if TABLE[name].least == 0.0:
                given[name] = np.maximum(given[name], 0.0)
        given["areas"][:, 0] = np.maximum(given["areas"][:, 0], LEAST_AREA * bench.unit)
        shape = {name: self.nonlinear_values(values, name) for name in NONLINEAR}
        taut, ratio = bool((shape["pushes"] >= NEVER).all()), float(shape["asymmetry"][0])
        merged = final and taut and not bench.directed
        if merged:
            own = np.arange(self.m)
            given["springs"][own, 1 + own] += given["bladders"][:, 0]
        left_out = {
            "lines": final and not given["lines"].any(),
            "mass": (final and not given["mass"].any()) or not bench.step or not taut,
            "bladders": merged,
        }
        fields = fields_of(given)
        fields |= {name: () for name, out in left_out.items() if out}
        growths = shape["friction_slopes"]
        return Balance(
            **fields,
            walls=vector(np.full(n, shape["walls"][0])),
            pushes=() if taut else vector(shape["pushes"]),
            limits=self.limits,
            friction_offset=float(shape["friction_offset"][0]),
            friction_slopes=vector(growths) if not final or growths.any() else (),
            asymmetry=None if final and ratio == 1.0 else ratio,
            obstacles=rows(self._obstacles(values)) if self.obstacles else (),
            lags=vector(shape["lags"]),
            hull=rows(bench.hull),
            scale=bench.scale,
            degree=self.degree,
            driven=bench.driven,
            scheduled=(*bench.scheduled, *bench.loaded),
            given=bench.given,
            tare=bench.tare,
            settled=self.settled,
            directions=rows(bench.directions) if bench.directed else (),
            preload=bench.preload if bench.directed else 0.0,
            held=bench.of_force,
        )

    def _obstacles(self, values: Array) -> Array:
        """Return side, position and stiffnesses of the obstacles, a row a coordinate."""
        table = values[self.at["obstacles"]].reshape(self.m, -1, self.sizes.obstacle)
        table[..., at.SIDE] = [side for side, _ in self.obstacles]
        table[..., at.PLACE] = self.nonlinear_values(values, "places").reshape(self.m, -1)
        table[..., at.STIFFNESS :] = np.maximum(table[..., at.STIFFNESS :], 0.0)
        return table.reshape(self.m, -1)

    def coefficients(self, values: Array, sample_time: float | None) -> Array:
        """Return the coefficients of the block, those of inactive terms included."""
        c = self.block(values).coefficients(sample_time)
        least = 1e-12 * self.bench.unit * self.bench.highest / self.bench.scale
        lines = self.at["lines"]
        c[lines + (c.size - self.n_linear)] = np.maximum(values[lines], least)
        return c

    def reduced(self, active: Collection[Term]) -> Structure:
        """Return the structure without inactive stops, lags, obstacles and powers."""
        used = {(term.kind, term.which) for term in active}

        def chosen(kind: str, items: tuple[Item, ...]) -> tuple[Item, ...]:
            return tuple(item for i, item in enumerate(items) if (kind, i) in used)

        def highest(kind: str, least: int) -> int:
            return 1 + max((which for name, which in used if name == kind), default=least - 1)

        squares = any(kind == "springs" and q > 0 and q % 2 == 0 for kind, q in used)
        return replace(
            self,
            n_elastic=highest("elasticity", 0),
            n_area=highest("areas", 1),
            limits=chosen("friction", self.limits),
            lags=chosen("relaxation", self.lags),
            obstacles=chosen("obstacles", self.obstacles),
            degree=self.degree if squares else 1,
        )

    # -- physics ---------------------------------------------------------------------------------

    @property
    def least_stiffness(self) -> float:
        """Smallest admissible stiffness."""
        return LEAST_STIFF * self.bench.unit * self.bench.highest / self.bench.scale

    def constraints(self, values: Array) -> tuple[Array, Array]:
        """Return physical constraints of linear coefficients, ``matrix @ coefficients >= lower``.

        Shapes (c, linear) and (c,). They depend on the nonlinear parameters, which are fixed at their
        present values: friction reduces the effective area.
        """
        matrix: list[Array] = []
        lower: list[float] = []

        def add(entries: dict[int, float], bound: float) -> None:
            matrix.append(np.zeros(self.n_linear))
            matrix[-1][list(entries)] = list(entries.values())
            lower.append(bound)

        for index in np.flatnonzero(self.not_negative).tolist():
            add({index: 1.0}, 0.0)
        ratio = float(self.nonlinear_values(values, "asymmetry")[0])
        wall = float(self.nonlinear_values(values, "walls")[0])
        reduction = -(np.array(self.limits) * max(1.0, ratio) + wall)
        for k in range(self.n):
            areas, friction, elastic = (
                self.at[kind][k].tolist() for kind in ("areas", "friction", "elasticity")
            )
            bladder = int(self.at["bladders"][k, 0])
            add({areas[0]: 1.0}, 0.1 * self.bench.unit)
            order, power = np.arange(1, self.n_area), np.arange(2, 2 + self.n_elastic)
            low, high = self.bench.hull[k].tolist()
            for u in np.linspace(low, high, GRID) / self.bench.scale:
                effective = dict(zip(areas, (u ** np.arange(self.n_area)).tolist(), strict=True))
                effective[areas[0]] -= LEAST_LEFT
                add(effective | dict(zip(friction, reduction.tolist(), strict=True)), 0.0)
                stiff = power * u ** (power - 1) / self.bench.scale
                narrowing = order * u ** (order - 1) / self.bench.scale
                for p in (0.0, self.bench.highest):
                    entries = dict(zip(elastic, stiff.tolist(), strict=True)) | {bladder: 1.0}
                    entries |= dict(zip(areas[1:], (-p * narrowing).tolist(), strict=True))
                    add(entries, self.least_stiffness)
        for x, direction in product(corners(self.bench.levels), np.eye(self.m)):
            matrix.append(self.stiffness_row(x, direction))
            lower.append(self.least_stiffness)
        return np.array(matrix), np.array(lower)

    def stiffness_row(self, x: Array, direction: Array) -> Array:
        """Return the constraint row of the stiffness of springs along a direction."""
        row = np.zeros(self.n_linear)
        scheduled = powers_of(x, self.degree)[:, np.newaxis] * direction[:, np.newaxis, np.newaxis]
        row[self.springs[:, :, 1:]] = scheduled * direction
        return row

    def softest(self, values: Array) -> tuple[Array, float]:
        """Return the constraint row where springs are softest, and the stiffness there."""
        stiffness, x, direction = softest(values[self.springs], self.bench.levels, self.degree)
        return self.stiffness_row(x, direction), stiffness
