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
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array, Mask
from mckibben.blocks.coupled import balance_terms as at
from mckibben.blocks.coupled.balance import Balance, fields_of
from mckibben.blocks.coupled.balance_bounds import GRID, LEAST_LEFT, corners, powers_of, softest
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
from mckibben.blocks.memoryless import Affine

Item = TypeVar("Item")

POSITIVE_AREA = 1e-9
"""Smallest area at rest, relative to a muscle's typical area."""

LEAST_LINE = 1e-12
"""Smallest resistance of a line during identification, relative to its natural size."""

LEAST_AT_REST = 0.1
"""Smallest area at rest, relative to a muscle's typical area."""

LEAST_STIFF = 1e-3
"""Smallest stiffness, relative to the force at the highest pressure over the stroke."""

DIFFERENCE = 0.1
"""How far muscles differ, relative to the scales of terms."""

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
    sensors : tuple of Affine
        From coordinates to what is measured.
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
    some_held : bool
        Whether muscles are held in some recording.
    unmeasured : tuple of int
        Recordings whose unmeasured constant loads are estimated.
    """

    driven: tuple[Channel, ...]
    scheduled: tuple[Channel, ...]
    loaded: tuple[Channel, ...]
    given: tuple[Channel, ...]
    sensors: tuple[Affine, ...]
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
    some_held: bool = False
    unmeasured: tuple[int, ...] = ()

    @cached_property
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

    @cached_property
    def scale(self) -> float:
        """Largest shortening [mm]."""
        return float(np.abs(self.hull).max())

    @cached_property
    def stroke(self) -> float:
        """Largest range of a shortening [mm]."""
        return float(np.ptp(self.hull, axis=1).max())

    @cached_property
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
        Break-away travels of the stops at the highest pressure [mm]; initial time constants [s].
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

    @cached_property
    def sizes(self) -> Sizes:
        """The numbers of all that the balance has."""
        return Sizes(
            muscles=self.n,
            coordinates=self.m,
            schedules=len(self.bench.scheduled),
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
        indices = {name: index - first for name, index in places.at.items()}
        end = places.size - first
        for name in NONLINEAR:
            kind = TABLE[name]
            count = 1 if kind.alike else self.sizes.of(kind.of)
            indices[name] = end + np.arange(count * self.sizes.number(kind.width))
            end += indices[name].size
        return indices

    @cached_property
    def springs(self) -> Indices:
        """Indices of springs, shape (m, powers, 1 + m): a constant, then to every coordinate."""
        return self.at["springs"].reshape(self.m, -1, 1 + self.m)

    @cached_property
    def met(self) -> Indices:
        """Indices of obstacles, shape (m, obstacles, numbers)."""
        return self.at["obstacles"].reshape(self.m, -1, self.sizes.obstacle)

    @cached_property
    def n_linear(self) -> int:
        """Number of linear coefficients, including unused ones."""
        return int(self.at[NONLINEAR[0]][0])

    @property
    def size(self) -> int:
        """Number of values."""
        return int(self.at[NONLINEAR[-1]][-1]) + 1

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
                columns_of_pair = {int(self.springs[j, q, 1 + i]), int(self.springs[i, q, 1 + j])}
                columns.append((Term("springs", q), sorted(columns_of_pair)))
        for j in range(self.m):
            if not self.bench.of_force:
                columns += [(Term("loads", j), [index]) for index in self.at["loads"][j].tolist()]
            for number, indices in enumerate(self.met[j, :, at.STIFFNESS :].tolist()):
                columns += [(Term("obstacles", number), [index]) for index in indices]
        for kind in LINEAR["muscle"]:
            for which, shared in enumerate(self.at[kind].T.tolist()):
                if kind != "areas" or which or self.bench.of_force:
                    columns.append((Term(kind, which), shared))
                columns += [(Term(kind, which, k), [shared[k]]) for k in range(1, self.n)]
        return columns

    @cached_property
    def terms(self) -> tuple[Term, ...]:
        """Candidate terms, linear first, then nonlinear."""
        nonlinear = [Term(name, k) for name in NONLINEAR for k in range(self.at[name].size)]
        return (*(term for term, _ in self._columns), *nonlinear)

    @cached_property
    def kinds(self) -> NDArray[np.str_]:
        """Kinds of the terms."""
        return np.array([term.kind for term in self.terms])

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

    def positions(self, name: str) -> slice:
        """Return the positions of a kind of nonlinear parameter among the free ones."""
        shift = self.mix.shape[1] - self.n_linear
        size = self.at[name].size
        first = int(self.at[name][0]) + shift if size else 0
        return slice(first, first + size)

    @cached_property
    def bounded(self) -> Mask:
        """Which terms are not negative."""
        return np.array([TABLE[kind].least == 0.0 and k is None for kind, _, k in self.terms])

    def expanded(self, free: Array) -> Array:
        """Return all values from the free ones, which loads of recordings may follow."""
        n = self.mix.shape[1]
        return np.append(self.base + self.mix @ free[:n], free[n : len(self.terms)])

    def initial(self, friction_growth: float, stretch: float = 0.0) -> Array:
        """Return initial free parameters: all terms without effect, except the growth of friction.

        ``stretch`` of the wall is relative to the largest.
        """
        low = self.bench.lowest[:, np.newaxis]
        positions = low + np.outer(self.bench.travel, [position for _, position in self.obstacles])
        free = np.zeros(len(self.terms))
        free[self.positions("friction_growth")] = friction_growth
        free[self.positions("walls")] = stretch * self.bench.most_stretch
        free[self.positions("lags")] = np.log(self.lags)
        free[self.positions("pushes")] = NEVER
        free[self.positions("places")] = positions.ravel()
        return free

    def transferred(self, other: Structure, free: Array, default: Array | None = None) -> Array:
        """Return free parameters as those of another structure, ``default`` for its further ones."""
        result = other.none.copy() if default is None else default[: len(other.terms)].copy()
        by_key: dict[tuple[object, ...], list[float]] = {}
        for key, value in zip(self.keys, free.tolist(), strict=True):
            by_key.setdefault(key, []).append(value)
        for index, key in enumerate(other.keys):
            if by_key.get(key):
                result[index] = by_key[key].pop(0)
        return result

    @cached_property
    def keys(self) -> list[tuple[str, object, int | None]]:
        """Keys of the terms across structures: limits, lags and obstacles by their initial values."""
        schedules, degrees = range(len(self.bench.scheduled)), range(1, self.degree + 1)
        initial: dict[str, Sequence[object]] = {
            "friction": self.limits,
            "relaxation": self.lags,
            "lags": self.lags,
            "obstacles": self.obstacles,
            "places": self.m * self.obstacles,
            "springs": [(0, 0), *product(schedules, degrees)],
        }
        return [
            (kind, initial[kind][number] if kind in initial else number, muscle)
            for kind, number, muscle in self.terms
        ]

    @cached_property
    def _ranges(self) -> Array:
        """Lower and upper bounds of all values, and their scales, shape (3, values)."""
        bench, natural = self.bench, self._natural_sizes()
        ranges = np.zeros((3, self.size))
        lower, upper, scales = ranges
        lower[:] = -np.inf
        for kind in TABLE.values():
            for row, share in zip(ranges, (kind.least, kind.most, kind.scale), strict=True):
                row[self.at[kind.name]] = share * natural[kind.name]

        if self.lags:  # each within its part of the range, so that none takes another's place
            between = np.sqrt(np.multiply(self.lags[1:], self.lags[:-1]))
            shortest, longest = bench.lag_range
            lower[self.at["lags"]] = np.log([shortest, *between])
            upper[self.at["lags"]] = np.log([*between, longest])
        scales[self.at["filling"]] = max(4.0 * bench.step, 1e-9)
        return ranges

    def _natural_sizes(self) -> dict[str, Any]:
        """Return the natural sizes of all kinds of terms: numbers, or arrays as of `at`."""
        bench = self.bench
        springs = [bench.natural(unit) for unit in TABLE["springs"].units(self.sizes)]
        powers = 1.0 / powers_of(bench.largest, self.degree)
        return {name: bench.natural(kind.unit) for name, kind in TABLE.items()} | {
            "loads": bench.natural("N") / bench.heaviest,
            "springs": powers.repeat(1 + self.m) * springs,
            "friction_slopes": 1.0 / bench.largest,
            "places": bench.travel.repeat(len(self.obstacles)),
            # of the force at which a stop breaks away
            "friction": bench.natural("N") / np.array(self.limits),
        }

    @property
    def nonlinear_ranges(self) -> Array:
        """Lower and upper bounds of the nonlinear parameters, and their scales, shape (3, k)."""
        return self._ranges[:, self.n_linear :]

    def scales(self) -> Array:
        """Return the scales of all free parameters, relative to an area at rest of 1."""
        linear, shape = np.split(self._ranges[2], [self.n_linear])
        return np.append(self.mix.T @ linear / self.mix.sum(axis=0), shape)

    @cached_property
    def none(self) -> Array:
        """Free parameters of a balance in which no term has an effect."""
        return self.initial(0.0)

    def doubts(self, *, known: bool) -> Array:
        """Return how much less likely terms are, the further from none, relative to their scales.

        Those that a balance always has, and, where a data sheet is ``known``, those that it determines,
        may be anything.
        """
        doubts = 1.0 / self.scales()
        for index, term in enumerate(self.terms):
            kind = TABLE[term.kind]
            always = term.which == 0 and kind.name in ("springs", "areas")
            if term.muscle is not None:
                doubts[index] /= DIFFERENCE
            elif always or (known and kind.prior) or not kind.doubtful:
                doubts[index] = 0.0
        return doubts

    # -- block -----------------------------------------------------------------------------------

    def block(self, values: Array, *, final: bool = False) -> Balance:
        """Return the balance with these values, without the air and dead zone in front of it.

        The ``final`` one has no terms without effect, and the springs of muscles that cannot go slack
        are added to those of their coordinates; others are not checked.
        """
        bench, n = self.bench, self.n
        shape = {name: self.nonlinear_values(values, name) for name in NONLINEAR}
        for name in (
            term_name for term_name in NONLINEAR if TABLE[term_name].least == 0.0
        ):  # but for rounding
            shape[name] = np.maximum(shape[name], 0.0)
        never_slack = bool((shape["pushes"] >= NEVER).all())
        ratio, slopes = float(shape["asymmetry"][0]), shape["friction_slopes"]
        make = Balance if final else Balance.unchecked
        return make(
            **self._linear_fields(values, final=final, never_slack=never_slack),
            walls=vector(np.full(n, shape["walls"][0])),
            pushes=() if never_slack else vector(shape["pushes"]),
            limits=self.limits,
            friction_growth=float(shape["friction_growth"][0]),
            highest_pressure=bench.highest,
            friction_slopes=vector(slopes) if not final or slopes.any() else (),
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

    def _linear_fields(
        self, values: Array, *, final: bool, never_slack: bool
    ) -> dict[str, tuple[Any, ...]]:
        """Return the fields of a `Balance` in which forces are linear, within their signs."""
        bench = self.bench
        tables = {name: values[self.at[name]] for name in (*LINEAR["muscle"], "springs", "loads")}
        for name in LINEAR["muscle"]:
            if TABLE[name].least == 0.0:
                tables[name] = np.maximum(tables[name], 0.0)
        tables["areas"][:, 0] = np.maximum(tables["areas"][:, 0], POSITIVE_AREA * bench.unit)
        if bench.step and not final:  # so that a line has an effect, whose derivative is found
            tables["lines"] = np.maximum(tables["lines"], LEAST_LINE * bench.natural("N s/mm"))

        merged = final and never_slack and not bench.directed
        if merged:
            muscles = np.arange(self.m)
            tables["springs"][muscles, 1 + muscles] += tables["bladders"][:, 0]

        without_mass = (final and not tables["mass"].any()) or not bench.step or not never_slack
        left_out = {
            "lines": final and not tables["lines"].any(),
            "mass": without_mass,
            "bladders": merged,
        }
        return fields_of(tables) | {name: () for name, out in left_out.items() if out}

    def _obstacles(self, values: Array) -> Array:
        """Return side, position and stiffnesses of the obstacles, a row a coordinate."""
        table = values[self.met]
        table[..., at.SIDE] = [side for side, _ in self.obstacles]
        table[..., at.PLACE] = self.nonlinear_values(values, "places").reshape(self.m, -1)
        table[..., at.STIFFNESS :] = np.maximum(table[..., at.STIFFNESS :], 0.0)
        return table.reshape(self.m, -1)

    def reduced(self, active: Collection[Term]) -> Structure:
        """Return the structure without inactive stops, lags, obstacles and powers."""
        present = {(term.kind, term.which) for term in active}

        def chosen(kind: str, items: tuple[Item, ...]) -> tuple[Item, ...]:
            return tuple(item for i, item in enumerate(items) if (kind, i) in present)

        def highest(kind: str, least: int) -> int:
            return 1 + max((number for name, number in present if name == kind), default=least - 1)

        squares = any(kind == "springs" and q > 0 and q % 2 == 0 for kind, q in present)
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
        ratio, wall, growth = (
            float(self.nonlinear_values(values, name)[0])
            for name in ("asymmetry", "walls", "friction_growth")
        )
        rise = growth / self.bench.highest
        (matrix, lower), area_left = self._physics
        matrix = matrix.copy()
        friction = -(np.array(self.limits) * rise * max(1.0, ratio) + wall)
        matrix[area_left[..., np.newaxis], self.at["friction"][:, np.newaxis]] = friction
        return matrix, lower

    @cached_property
    def _physics(self) -> tuple[tuple[Array, Array], Indices]:
        """Constraints without friction, and their rows of the areas it reduces, shape (n, GRID)."""
        signs = np.eye(self.n_linear)[self._ranges[0, : self.n_linear] == 0.0]
        sides, bounds = [signs], [np.zeros(len(signs))]
        for k in range(self.n):
            side, bound = self._muscle_constraints(k)
            sides.append(side)
            bounds.append(bound)
        for x, direction in product(corners(self.bench.levels), np.eye(self.m)):
            sides.append(self.stiffness_row(x, direction)[np.newaxis])
            bounds.append(np.array([self.least_stiffness]))

        first = len(signs) + 1 + (1 + 3 * GRID) * np.arange(self.n)
        stacked = np.concatenate(sides), np.concatenate(bounds)
        return stacked, first[:, np.newaxis] + 3 * np.arange(GRID)

    def _muscle_constraints(self, k: int) -> tuple[Array, Array]:
        """Return the constraints of muscle k: of the area at rest, then three at every grid point.

        They are the area that is left; stiffness without pressure; and at the highest pressure.
        """
        bench = self.bench
        areas, elastic, bladder = (self.at[kind][k] for kind in ("areas", "elasticity", "bladders"))
        low, high = bench.hull[k].tolist()
        u = np.linspace(low, high, GRID)[:, np.newaxis] / bench.scale
        order, power = np.arange(self.n_area), np.arange(2, 2 + self.n_elastic)

        grid = np.zeros((GRID, 3, self.n_linear))
        grid[:, 0, areas] = u**order
        grid[:, 0, areas[0]] -= LEAST_LEFT
        grid[:, 1:, elastic] = (power * u ** (power - 1) / bench.scale)[:, np.newaxis]
        grid[:, 1:, bladder] = 1.0
        narrowing = order[1:] * u ** (order[1:] - 1) / bench.scale
        grid[:, 2, areas[1:]] = -bench.highest * narrowing

        at_rest = np.eye(self.n_linear)[areas[:1]]
        stiff = self.least_stiffness
        bounds = np.append(LEAST_AT_REST * bench.unit, np.tile([0.0, stiff, stiff], GRID))
        return np.concatenate([at_rest, grid.reshape(-1, self.n_linear)]), bounds

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
