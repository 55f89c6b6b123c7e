"""Structure of a force balance: candidate terms, their parameters, and physical constraints.

Two vectors describe a balance:

values
    All parameters: the linear coefficients, in the order of `mckibben.blocks.coupled.balance_law` from
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
from numpy.typing import ArrayLike, NDArray

from mckibben.arrays import Array
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.coupled.balance_adaptive import GRID, LEAST_LEFT
from mckibben.blocks.coupled.balance_law import NEVER, OWN
from mckibben.blocks.fields import Channel, rows, vector

Indices = NDArray[np.intp]
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

LOGARITHMIC = ("lags", "asymmetry", "venting")
"""Nonlinear parameters that are stored as logarithms."""

OF_MUSCLES = ("damping", "line", "mass", "bladder", "elasticity", "areas", "friction", "relaxation")
"""Kinds of linear coefficients of muscles."""

NOT_NEGATIVE = ("damping", "line", "mass", "bladder", "friction", "relaxation")
"""Kinds of linear coefficients of muscles that are non-negative."""


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

    def corners(self) -> list[Array]:
        """Return all combinations of the ends and middles of the scheduling inputs."""
        low, high = self.levels.T
        return [low + np.array(s) * (high - low) for s in product((0.0, 0.5, 1.0), repeat=len(low))]


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
    def _coordinate(self) -> dict[str, slice]:
        widths = {"springs": (1 + self.n_x * self.degree) * (1 + self.m)}
        widths |= {
            "loads": len(self.bench.loaded),
            "obstacles": len(self.obstacles) * (3 + self.n_x),
        }
        return _slices(widths)

    @cached_property
    def _muscle(self) -> dict[str, slice]:
        widths = {"own": OWN + self.m, "damping": 1, "line": 1, "mass": 1, "bladder": 1}
        widths |= {"elasticity": self.n_elastic, "areas": self.n_area}
        return _slices(widths | {"friction": len(self.limits), "relaxation": len(self.lags)})

    def of_coordinate(self, name: str, j: int) -> Indices:
        """Return the indices of a coordinate's coefficients of a kind."""
        part, width = self._coordinate[name], self._coordinate["obstacles"].stop
        return np.arange(part.start, part.stop) + j * width

    def of_muscle(self, name: str, k: int) -> Indices:
        """Return the indices of a muscle's coefficients of a kind."""
        part, width = self._muscle[name], self._muscle["relaxation"].stop
        first = self.m * self._coordinate["obstacles"].stop + k * width
        return np.arange(part.start, part.stop) + first

    @cached_property
    def n_linear(self) -> int:
        """Number of linear coefficients, including unused ones."""
        return (
            self.m * self._coordinate["obstacles"].stop + self.n * self._muscle["relaxation"].stop
        )

    def spring(self, q: int, j: int, i: int) -> int:
        """Return the index of the spring from coordinate j to i, or of its constant for i = -1."""
        return int(self.of_coordinate("springs", j)[q * (1 + self.m) + 1 + i])

    @cached_property
    def nonlinear(self) -> dict[str, slice]:
        """Positions of the nonlinear parameters in the values.

        Friction offset [bar], and its slopes by scheduling inputs; logarithms
        of the ratio of friction limits and of the lags; stretch of walls [mm/bar]; forces at which
        muscles go slack (pushes); positions of obstacles (places); time constant of filling [s],
        logarithm of the ratio of venting to filling, dead zone [bar], and the pressure over which
        contact builds up [bar].
        """
        widths = {
            "friction_offset": 1,
            "friction_slopes": self.n_x,
            "asymmetry": 1,
            "lags": len(self.lags),
        }
        widths |= {"walls": 1, "pushes": self.n, "places": self.m * len(self.obstacles)}
        widths |= {"filling": 1, "venting": 1, "dead": 1, "contact": 1}
        return _slices(widths, self.n_linear)

    @property
    def size(self) -> int:
        """Number of values."""
        return self.nonlinear["contact"].stop

    def nonlinear_values(self, values: Array, name: str) -> Array:
        """Return the nonlinear parameters of a kind."""
        part = values[self.nonlinear[name]]
        return np.exp(part) if name in LOGARITHMIC else part

    # -- free parameters -------------------------------------------------------------------------

    @cached_property
    def _columns(self) -> list[tuple[Term, list[int]]]:
        """All linear terms, and the indices of their coefficients."""
        columns: list[tuple[Term, list[int]]] = []
        for q, j in product(range(1 + self.n_x * self.degree), range(self.m)):
            if q or not self.bench.tare:  # relative coordinates have no constant force
                columns.append((Term("springs", q), [self.spring(q, j, -1)]))
            for i in range(j, self.m):
                both = {self.spring(q, j, i), self.spring(q, i, j)}
                columns.append((Term("springs", q), sorted(both)))
        for j in range(self.m):
            if not self.bench.of_force:
                loads = self.of_coordinate("loads", j).tolist()
                columns += [(Term("loads", j), [index]) for index in loads]
            table = self.of_coordinate("obstacles", j).reshape(-1, 3 + self.n_x)
            for number, stiffnesses in enumerate(table[:, 2:].tolist()):
                columns += [(Term("obstacle", number), [index]) for index in stiffnesses]
        for kind in OF_MUSCLES:
            indices = [self.of_muscle(kind, k).tolist() for k in range(self.n)]
            for which, shared in enumerate(zip(*indices, strict=True)):
                if kind != "areas" or which or self.bench.of_force:
                    columns.append((Term(kind, which), list(shared)))
                columns += [(Term(kind, which, k), [shared[k]]) for k in range(1, self.n)]
        return columns

    @cached_property
    def terms(self) -> tuple[Term, ...]:
        """Candidate terms, linear first, then nonlinear."""
        nonlinear = [
            Term(name, which)
            for name, part in self.nonlinear.items()
            for which in range(part.stop - part.start)
        ]
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
            values[self.of_coordinate("loads", 0)] = 1.0
        for k in range(0 if self.bench.of_force else self.n):
            values[self.of_muscle("areas", k)[0]] = 1.0
        return values

    def free(self, name: str) -> slice:
        """Return the positions of a kind of nonlinear parameter among the free ones."""
        part, shift = self.nonlinear[name], self.mix.shape[1] - self.n_linear
        return slice(part.start + shift, part.stop + shift)

    @cached_property
    def not_negative(self) -> NDArray[np.bool_]:
        """Mask of the non-negative linear coefficients."""
        mask = np.zeros(self.n_linear, dtype=bool)
        for kind, k in product(NOT_NEGATIVE, range(self.n)):
            mask[self.of_muscle(kind, k)] = True
        for j in range(self.m):
            mask[self.of_coordinate("obstacles", j)] = True
        return mask

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
        by |= {"lags": self.lags, "obstacle": self.obstacles, "places": self.m * self.obstacles}
        return [
            (kind, by[kind][which] if kind in by else which, muscle)
            for kind, which, muscle in self.terms
        ]

    def scales(self) -> Array:
        """Return the scales of all free parameters, relative to an area at rest of 1."""
        bench = self.bench
        force = bench.highest * bench.unit
        stiff = force / bench.scale
        linear = np.full(self.n_linear, stiff)
        powers = 1.0 / self.powers(bench.largest)
        for j in range(self.m):
            springs = np.outer(powers, [force, *self.m * [stiff]])
            linear[self.of_coordinate("springs", j)] = springs.ravel()
            linear[self.of_coordinate("loads", j)] = force / bench.heaviest
        for k in range(self.n):
            linear[self.of_muscle("elasticity", k)] = force
            linear[self.of_muscle("areas", k)] = bench.unit
        return np.append(self.mix.T @ linear / self.mix.sum(axis=0), self.nonlinear_bounds()[2])

    def nonlinear_bounds(self) -> tuple[Array, Array, Array]:
        """Return lower and upper bounds of the nonlinear parameters, and their scales."""
        bench = self.bench
        per_x = bench.highest / bench.largest
        (shortest, longest), log_ratio = np.log(bench.lag_range), np.log(5.0)
        bounds: dict[str, tuple[ArrayLike, ArrayLike, ArrayLike]] = {
            "friction_offset": (0.0, 4.0 * bench.highest, bench.highest),
            "friction_slopes": (0.0, 4.0 * per_x, per_x),
            "asymmetry": (-log_ratio, log_ratio, 1.0),
            "lags": (shortest, longest, 1.0),
            "walls": (0.0, bench.most_stretch, 0.2 * bench.most_stretch),
            "pushes": (0.0, 1.1 * NEVER, bench.highest * bench.unit),
            "places": (-np.inf, np.inf, 0.2 * bench.travel.repeat(len(self.obstacles))),
            "filling": (0.0, 2.0, max(4.0 * bench.step, 1e-9)),
            "venting": (-log_ratio, log_ratio, 1.0),
            "dead": (0.0, 0.5 * bench.highest, 0.1 * bench.highest),
            "contact": (0.0, 0.5 * bench.highest, 0.1 * bench.highest),
        }
        lower, upper, scales = np.zeros((3, self.size - self.n_linear))
        for name, part in self.nonlinear.items():
            here = slice(part.start - self.n_linear, part.stop - self.n_linear)
            lower[here], upper[here], scales[here] = map(np.asarray, bounds[name])
        return lower, upper, scales

    # -- block -----------------------------------------------------------------------------------

    def block(self, values: Array, *, final: bool = False) -> Balance:
        """Return the balance with these values, without the air and dead zone in front of it.

        The ``final`` one has no terms without effect, and the springs of muscles that cannot go slack
        are added to those of their coordinates.
        """
        bench, m, n = self.bench, self.m, self.n
        muscles = {
            name: np.array([values[self.of_muscle(name, k)] for k in range(n)])
            for name in self._muscle
        }
        muscles |= {name: np.maximum(muscles[name], 0.0) for name in NOT_NEGATIVE}
        muscles["areas"][:, 0] = np.maximum(muscles["areas"][:, 0], LEAST_AREA * bench.unit)
        springs = np.array([values[self.of_coordinate("springs", j)] for j in range(m)])
        bladders, pushes = muscles["bladder"][:, 0], self.nonlinear_values(values, "pushes")
        taut = bool((pushes >= NEVER).all())
        merged = final and taut and not bench.directed
        if merged:
            springs[np.arange(m), 1 + np.arange(m)] += bladders
        friction_slopes = self.nonlinear_values(values, "friction_slopes")
        ratio = float(self.nonlinear_values(values, "asymmetry")[0])
        sides = [[side] for side, _ in self.obstacles]
        obstacles = [
            np.hstack([sides, self.obstacle_values(values, j)]).ravel()
            for j in range(m if sides else 0)
        ]
        heavy = not final or muscles["mass"].any()
        return Balance(
            springs=rows(springs),
            elasticity=rows(muscles["elasticity"]),
            areas=rows(muscles["areas"]),
            friction=rows(muscles["friction"]),
            relaxation=rows(muscles["relaxation"]),
            loads=rows(np.array([values[self.of_coordinate("loads", j)] for j in range(m)])),
            damping=vector(muscles["damping"][:, 0]),
            lines=vector(muscles["line"][:, 0]) if not final or muscles["line"].any() else (),
            walls=vector(np.full(n, self.nonlinear_values(values, "walls")[0])),
            bladders=() if merged else vector(bladders),
            pushes=() if taut else vector(pushes),
            limits=self.limits,
            friction_offset=float(self.nonlinear_values(values, "friction_offset")[0]),
            friction_slopes=vector(friction_slopes) if not final or friction_slopes.any() else (),
            asymmetry=None if final and ratio == 1.0 else ratio,
            obstacles=rows(np.array(obstacles)),
            lags=vector(self.nonlinear_values(values, "lags")),
            hull=rows(bench.hull),
            scale=bench.scale,
            degree=self.degree,
            driven=bench.driven,
            scheduled=(*bench.scheduled, *bench.loaded),
            given=bench.given,
            tare=bench.tare,
            settled=self.settled,
            mass=vector(muscles["mass"][:, 0]) if heavy and bench.step and taut else (),
            directions=rows(bench.directions) if bench.directed else (),
            preload=bench.preload if bench.directed else 0.0,
            held=bench.of_force,
        )

    def obstacle_values(self, values: Array, j: int) -> Array:
        """Return the position and stiffnesses of each obstacle of a coordinate, shape (k, 2 + s)."""
        table = values[self.of_coordinate("obstacles", j)].reshape(-1, 3 + self.n_x)
        positions = self.nonlinear_values(values, "places").reshape(self.m, len(table))[j]
        return np.column_stack([positions, np.maximum(table[:, 2:], 0.0)])

    def coefficients(self, values: Array, sample_time: float | None) -> Array:
        """Return the coefficients of the block, those of inactive terms included."""
        c = self.block(values).coefficients(sample_time)
        linear = c[c.size - self.n_linear :]
        least = 1e-12 * self.bench.unit * self.bench.highest / self.bench.scale
        for k in range(self.n):
            line = self.of_muscle("line", k)
            linear[line] = np.maximum(values[line], least)
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
            obstacles=chosen("obstacle", self.obstacles),
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
                self.of_muscle(kind, k).tolist() for kind in ("areas", "friction", "elasticity")
            )
            bladder = int(self.of_muscle("bladder", k)[0])
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
        for x, direction in product(self.bench.corners(), np.eye(self.m)):
            matrix.append(self.stiffness_row(x, direction))
            lower.append(self.least_stiffness)
        return np.array(matrix), np.array(lower)

    def powers(self, x: Array) -> Array:
        """Return the powers of scheduling inputs, shape (1 + powers, ...), that multiply springs."""
        powers = [v**d for v in x for d in range(1, self.degree + 1)]
        return np.array([np.ones(x.shape[1:]), *powers])

    def stiffness_row(self, x: Array, direction: Array) -> Array:
        """Return the constraint row of the stiffness of springs along a direction."""
        row = np.zeros(self.n_linear)
        for q, power in enumerate(self.powers(x)):
            for j, i in product(range(self.m), repeat=2):
                row[self.spring(q, j, i)] += power * direction[j] * direction[i]
        return row

    def softest(self, values: Array) -> tuple[Array, float]:
        """Return the constraint row where springs are softest, and the stiffness there."""
        softest: list[tuple[float, Array, Array]] = []
        springs = np.array([values[self.of_coordinate("springs", j)] for j in range(self.m)])
        springs = springs.reshape(self.m, -1, 1 + self.m)[:, :, 1:]
        for x in self.bench.corners():
            matrix = np.tensordot(self.powers(x), springs, (0, 1))
            stiffnesses, directions = np.linalg.eigh(0.5 * (matrix + matrix.T))
            softest.append((float(stiffnesses[0]), x, directions[:, 0]))
        stiffness, x, direction = min(softest, key=lambda candidate: candidate[0])
        return self.stiffness_row(x, direction), stiffness


def _slices(widths: dict[str, int], first: int = 0) -> dict[str, slice]:
    """Return consecutive slices of these widths."""
    ends = np.cumsum([first, *widths.values()]).tolist()
    return {name: slice(a, b) for name, a, b in zip(widths, ends[:-1], ends[1:], strict=True)}
