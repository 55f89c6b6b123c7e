"""Structure of a force balance: candidate terms, their parameters, and physical constraints.

Values are the linear coefficients of the block, in the order of `mckibben.blocks.coupled.balance_law`
from those of the first coordinate on, then its shape: what is not linear. What is free is fewer numbers,
of which the linear ones are an affine function: springs between two coordinates are one number, and
muscles share theirs, from which each may differ. One number sets the unit of force: the area of muscle 1
at rest is 1.
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

Places = NDArray[np.intp]
Item = TypeVar("Item")

LEAST_AREA = 1e-9
"""Smallest area at rest, relative to a muscle's typical area."""

LEAST_STIFF = 1e-3
"""Smallest stiffness, relative to the force at the highest pressure over the stroke."""

MOST_ASYMMETRIC, MOST_GRIP, MOST_WALL = 5.0, 4.0, 0.1
"""Bounds of the ratio of friction limits; of the friction offset, over the highest pressure; of the
wall's stretch at that pressure, over the stroke.
"""

LONGEST_AIR = 2.0
"""Largest time constant of the air in front [s]."""


@dataclass(frozen=True)
class Bench:
    """Set-up from the recordings.

    Parameters
    ----------
    driven, scheduled, loaded, given : tuple of Channel
        Coordinates, what schedules, loads, and pressures.
    directions : array, shape (n, m)
        Shortening of every muscle by coordinates.
    hull : array, shape (n, 2)
        Shortenings known [mm].
    lowest, travel : array, shape (m,)
        Lowest value and range of every coordinate.
    levels : array, shape (s, 2)
        What schedules, lowest and highest.
    highest, heaviest : float
        Pressure [bar]; load, 1 without one.
    preload : float
        Mean pressure [bar].
    tare : bool
        Whether coordinates count from rest at the start.
    lag_range : (float, float)
        Shortest and longest time constant identifiable from the recordings [s].
    step : float
        Shortest sample time [s]; 0 without time.
    of_force : bool
        Whether errors of the one load count, not those of coordinates: then it sets the unit of force.
    curved : bool
        Whether all that schedules has been at three levels or more.
    unmeasured : tuple of int
        Recordings under constant loads of their own, which are found too.
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
        """Whether muscles act along directions, not each on a separate coordinate."""
        n, m = self.directions.shape
        return n != m or not bool((self.directions == np.eye(n)).all())

    @property
    def unit(self) -> float:
        """Typical area of a muscle."""
        return self.heaviest / self.highest if self.of_force else 1.0

    @property
    def scale(self) -> float:
        """Largest known shortening [mm]."""
        return float(np.abs(self.hull).max())

    @property
    def stroke(self) -> float:
        """Largest known range of a shortening [mm]."""
        return float(np.ptp(self.hull, axis=1).max())

    @property
    def largest(self) -> Array:
        """Largest magnitude of scheduling inputs, 1 if that is 0."""
        most = np.abs(self.levels).max(axis=1)
        return np.where(most > 0, most, 1.0)

    def corners(self) -> list[Array]:
        """Return the scheduling inputs at all combinations of their ends."""
        low, high = self.levels.T
        return [low + np.array(s) * (high - low) for s in product((0.0, 0.5, 1.0), repeat=len(low))]


class Term(NamedTuple):
    """A free parameter: its kind, its index, and its muscle, if of one."""

    kind: str
    which: int = 0
    muscle: int | None = None


@dataclass(frozen=True)
class Structure:
    """Sizes of a balance, and its free terms.

    Parameters
    ----------
    bench : Bench
    n_elastic, n_area : int
        Elastic terms from the square on; terms of the area, the constant one included.
    limits, lags : tuple of float
        Travels at which stops break away [mm/bar]; time constants to begin with [s].
    obstacles : tuple of (int, float)
        Side, 1 or -1, and place along the range of every coordinate, from 0 to 1, to begin with.
    degree : int
        Highest power of what schedules.
    settled : bool
        Whether muscles had long been where every recording begins.
    """

    bench: Bench
    n_elastic: int
    n_area: int
    limits: tuple[float, ...]
    lags: tuple[float, ...]
    obstacles: tuple[tuple[int, float], ...] = ()
    degree: int = 1
    settled: bool = False

    # -- where things are ------------------------------------------------------------------------

    @property
    def n(self) -> int:
        """Number of muscles."""
        return len(self.bench.given)

    @property
    def m(self) -> int:
        """Number of coordinates."""
        return len(self.bench.driven)

    @property
    def n_stops(self) -> int:
        """Number of stops per muscle."""
        return len(self.limits)

    @property
    def n_lags(self) -> int:
        """Number of time constants."""
        return len(self.lags)

    @cached_property
    def _coordinate(self) -> dict[str, slice]:
        n_x = len(self.bench.scheduled)
        springs = (1 + n_x * self.degree) * (1 + self.m)
        loads = len(self.bench.loaded)
        return _slices({"springs": springs, "loads": loads, "met": len(self.obstacles) * (3 + n_x)})

    @cached_property
    def _muscle(self) -> dict[str, slice]:
        widths = {"own": OWN + self.m, "damping": 1, "line": 1, "mass": 1, "bladder": 1}
        widths |= {"elasticity": self.n_elastic, "areas": self.n_area}
        return _slices(widths | {"friction": len(self.limits), "relaxation": len(self.lags)})

    def on(self, name: str, j: int) -> Places:
        """Return the indices of a coordinate's coefficients."""
        part, width = self._coordinate[name], self._coordinate["met"].stop
        return np.arange(part.start, part.stop) + j * width

    def of(self, name: str, k: int) -> Places:
        """Return the indices of a muscle's coefficients."""
        part, width = self._muscle[name], self._muscle["relaxation"].stop
        return np.arange(part.start, part.stop) + k * width + self.m * self._coordinate["met"].stop

    @cached_property
    def n_linear(self) -> int:
        """Number of linear coefficients, including unused ones between."""
        return self.n * self._muscle["relaxation"].stop + self.m * self._coordinate["met"].stop

    def spring(self, q: int, j: int, i: int) -> int:
        """Return the index of the spring from coordinate j to i, or of its constant for i = -1."""
        return int(self.on("springs", j)[q * (1 + self.m) + 1 + i])

    @cached_property
    def shape(self) -> dict[str, slice]:
        """Index of the nonlinear parameters, after the linear coefficients.

        The friction offset [bar] and its slopes by scheduling inputs; the logarithms of the ratio of
        limits and of the lags; stretch of walls [mm/bar], forces at which muscles go slack, places of
        obstacles; time constant of the air in front while filling [s], the logarithm of the ratio to
        that while venting, the dead zone [bar], and the pressure over which one fades [bar].
        """
        n_x = len(self.bench.scheduled)
        widths = {"friction_offset": 1, "friction_slopes": n_x, "asymmetry": 1, "lags": self.n_lags}
        widths |= {"walls": 1, "pushes": self.n, "places": self.m * len(self.obstacles)}
        widths |= {"filling": 1, "venting": 1, "dead": 1, "contact": 1}
        return _slices(widths, self.n_linear)

    @property
    def size(self) -> int:
        """Number of values."""
        return self.shape["contact"].stop

    def shaped(self, values: Array, name: str) -> Array:
        """Return the nonlinear parameters of a kind."""
        found = values[self.shape[name]]
        return np.exp(found) if name in LOGARITHMIC else found

    # -- what is free ----------------------------------------------------------------------------

    @cached_property
    def _columns(self) -> list[tuple[Term, list[int]]]:
        """All linear parameters that may be free, and the indices of their coefficients."""
        found: list[tuple[Term, list[int]]] = []
        for q, j in product(range(1 + len(self.bench.scheduled) * self.degree), range(self.m)):
            if q or not self.bench.tare:  # coordinates from rest make a constant of their own
                found.append((Term("springs", q), [self.spring(q, j, -1)]))
            for i in range(j, self.m):
                found.append(
                    (Term("springs", q), sorted({self.spring(q, j, i), self.spring(q, i, j)}))
                )
        for j in range(self.m):
            if not self.bench.of_force:
                found += [(Term("loads", j), [place]) for place in self.on("loads", j).tolist()]
            table = self.on("met", j).reshape(len(self.obstacles), 3 + len(self.bench.scheduled))
            for number, stiffnesses in enumerate(table[:, 2:].tolist()):
                found += [(Term("obstacle", number), [place]) for place in stiffnesses]
        for kind in OF_MUSCLES:
            places = [self.of(kind, k).tolist() for k in range(self.n)]
            for which, same in enumerate(zip(*places, strict=True)):
                if kind != "areas" or which or self.bench.of_force:
                    found.append((Term(kind, which), list(same)))
                found += [(Term(kind, which, k), [same[k]]) for k in range(1, self.n)]
        return found

    @cached_property
    def terms(self) -> tuple[Term, ...]:
        """Candidate terms, linear first, then nonlinear."""
        shape = [
            Term(name, which) for name, p in self.shape.items() for which in range(p.stop - p.start)
        ]
        return (*(term for term, _ in self._columns), *shape)

    @cached_property
    def mix(self) -> Array:
        """Matrix from free parameters to linear coefficients, shape (linear, free)."""
        mix = np.zeros((self.n_linear, len(self._columns)))
        for number, (_, places) in enumerate(self._columns):
            mix[places, number] = 1.0
        return mix

    @cached_property
    def base(self) -> Array:
        """Linear coefficients with nothing free: areas at rest or the load 1, all others 0."""
        values = np.zeros(self.n_linear)
        if self.bench.of_force:
            values[self.on("loads", 0)] = 1.0
        for k in range(0 if self.bench.of_force else self.n):
            values[self.of("areas", k)[0]] = 1.0
        return values

    def free(self, name: str) -> slice:
        """Return the indices of a kind of nonlinear parameter among the free ones."""
        part, shift = self.shape[name], self.mix.shape[1] - self.n_linear
        return slice(part.start + shift, part.stop + shift)

    @cached_property
    def not_negative(self) -> NDArray[np.bool_]:
        """Which linear coefficients are non-negative."""
        found = np.zeros(self.n_linear, dtype=bool)
        for kind, k in product(NOT_NEGATIVE, range(self.n)):
            found[self.of(kind, k)] = True
        for j in range(self.m):
            found[self.on("met", j)] = True
        return found

    def expanded(self, free: Array) -> Array:
        """Return all values from the free ones."""
        n = self.mix.shape[1]
        return np.concatenate([self.base + self.mix @ free[:n], free[n:]])

    def begin(self, friction_offset: float) -> Array:
        """Return initial free parameters: without effect, except the friction offset."""
        free = np.zeros(len(self.terms))
        put: dict[str, ArrayLike] = {
            "friction_offset": friction_offset,
            "lags": np.log(self.lags),
            "pushes": NEVER,
        }
        low = self.bench.lowest[:, np.newaxis]
        put["places"] = (low + np.outer(self.bench.travel, [p for _, p in self.obstacles])).ravel()
        for name, numbers in put.items():
            free[self.free(name)] = np.asarray(numbers)
        return free

    def moved_to(self, other: Structure, free: Array, behind: Array | None = None) -> Array:
        """Return the free parameters in another structure, with ``behind`` where it has others."""
        found = other.begin(0.0) if behind is None else behind[: len(other.terms)].copy()
        named: dict[tuple[object, ...], list[float]] = {}
        for key, number in zip(self.keys, free.tolist(), strict=True):
            named.setdefault(key, []).append(number)
        for place, key in enumerate(other.keys):
            if named.get(key):
                found[place] = named[key].pop(0)
        return found

    @cached_property
    def keys(self) -> list[tuple[object, ...]]:
        """Names by which structures share parameters: limits, lags and obstacles by their own."""
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
            linear[self.on("springs", j)] = np.outer(powers, [force, *self.m * [stiff]]).ravel()
            linear[self.on("loads", j)] = force / bench.heaviest
        for k in range(self.n):
            linear[self.of("elasticity", k)] = force
            linear[self.of("areas", k)] = bench.unit
        return np.append(self.mix.T @ linear / self.mix.sum(axis=0), self.ends()[2])

    def ends(self) -> tuple[Array, Array, Array]:
        """Return bounds of the nonlinear parameters, and their scales."""
        bench = self.bench
        much = bench.scale / bench.highest
        per_x = bench.highest / bench.largest
        ratio, (shortest, longest) = np.log(MOST_ASYMMETRIC), np.log(bench.lag_range)
        ends: dict[str, tuple[ArrayLike, ArrayLike, ArrayLike]] = {
            "friction_offset": (0.0, MOST_GRIP * bench.highest, bench.highest),
            "friction_slopes": (0.0, MOST_GRIP * per_x, per_x),
            "asymmetry": (-ratio, ratio, 1.0),
            "lags": (shortest, longest, 1.0),
            "walls": (0.0, MOST_WALL * much, 0.2 * MOST_WALL * much),
            "pushes": (0.0, 1.1 * NEVER, bench.highest * bench.unit),
            "places": (-np.inf, np.inf, 0.2 * bench.travel.repeat(len(self.obstacles))),
            "filling": (0.0, LONGEST_AIR, max(4.0 * bench.step, 1e-9)),
            "venting": (-ratio, ratio, 1.0),
            "dead": (0.0, 0.5 * bench.highest, 0.1 * bench.highest),
            "contact": (0.0, 0.5 * bench.highest, 0.1 * bench.highest),
        }
        low, high, size = np.zeros((3, self.size - self.n_linear))
        for name, place in self.shape.items():
            own = slice(place.start - self.n_linear, place.stop - self.n_linear)
            low[own], high[own], size[own] = map(np.asarray, ends[name])
        return low, high, size

    # -- block -----------------------------------------------------------------------------------

    def block(self, values: Array, *, final: bool = False) -> Balance:
        """Return the balance of given values, without its front.

        In the ``final`` one springs of muscles' own are among those of coordinates, unless they can go
        slack with them, and what does nothing is left out.
        """
        bench, m, n = self.bench, self.m, self.n
        of = {name: np.array([values[self.of(name, k)] for k in range(n)]) for name in self._muscle}
        of |= {name: np.maximum(of[name], 0.0) for name in NOT_NEGATIVE}
        of["areas"][:, 0] = np.maximum(of["areas"][:, 0], LEAST_AREA * bench.unit)
        springs = np.array([values[self.on("springs", j)] for j in range(m)])
        bladders, pushes = of["bladder"][:, 0], self.shaped(values, "pushes")
        taut = bool((pushes >= NEVER).all())
        merged = final and taut and not bench.directed
        if merged:
            springs[np.arange(m), 1 + np.arange(m)] += bladders
        friction_slopes, ratio = (
            self.shaped(values, "friction_slopes"),
            float(self.shaped(values, "asymmetry")[0]),
        )
        sides = [[side] for side, _ in self.obstacles]
        met = [np.hstack([sides, self.met(values, j)]).ravel() for j in range(m if sides else 0)]
        heavy = not final or of["mass"].any()
        return Balance(
            springs=rows(springs),
            elasticity=rows(of["elasticity"]),
            areas=rows(of["areas"]),
            friction=rows(of["friction"]),
            relaxation=rows(of["relaxation"]),
            loads=rows(np.array([values[self.on("loads", j)] for j in range(m)])),
            damping=vector(of["damping"][:, 0]),
            lines=vector(of["line"][:, 0]) if not final or of["line"].any() else (),
            walls=vector(np.full(n, self.shaped(values, "walls")[0])),
            bladders=() if merged else vector(bladders),
            pushes=() if taut else vector(pushes),
            limits=self.limits,
            friction_offset=float(self.shaped(values, "friction_offset")[0]),
            friction_slopes=vector(friction_slopes) if not final or friction_slopes.any() else (),
            asymmetry=None if final and ratio == 1.0 else ratio,
            obstacles=rows(np.array(met)),
            lags=vector(self.shaped(values, "lags")),
            hull=rows(bench.hull),
            scale=bench.scale,
            degree=self.degree,
            driven=bench.driven,
            scheduled=(*bench.scheduled, *bench.loaded),
            given=bench.given,
            tare=bench.tare,
            settled=self.settled,
            mass=vector(of["mass"][:, 0]) if heavy and bench.step and taut else (),
            directions=rows(bench.directions) if bench.directed else (),
            preload=bench.preload if bench.directed else 0.0,
        )

    def met(self, values: Array, j: int) -> Array:
        """Return position and stiffnesses of obstacles, shape (obstacles, 2 + schedules)."""
        table = values[self.on("met", j)].reshape(-1, 3 + len(self.bench.scheduled))
        places = self.shaped(values, "places").reshape(self.m, len(table))[j]
        return np.column_stack([places, np.maximum(table[:, 2:], 0.0)])

    def coefficients(self, values: Array, sample_time: float) -> Array:
        """Return the coefficients of the block, including zero terms."""
        c = self.block(values).coefficients(sample_time)
        linear = c[c.size - self.n_linear :]
        least = 1e-12 * self.bench.unit * self.bench.highest / self.bench.scale
        for k in range(self.n):
            linear[self.of("line", k)] = np.maximum(values[self.of("line", k)], least)
        return c

    def needed(self, active: Collection[Term]) -> Structure:
        """Return the structure without inactive stops, lags, obstacles and powers."""
        kept = {(term.kind, term.which) for term in active}

        def chosen(kind: str, items: tuple[Item, ...]) -> tuple[Item, ...]:
            return tuple(item for i, item in enumerate(items) if (kind, i) in kept)

        def highest(kind: str, least: int) -> int:
            return 1 + max((which for name, which in kept if name == kind), default=least - 1)

        squares = any(kind == "springs" and q > 0 and q % 2 == 0 for kind, q in kept)
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

    def conditions(self, values: Array) -> tuple[Array, Array]:
        """Return the physical constraints of linear coefficients: sides @ coefficients >= least.

        Shapes (c, linear) and (c,). What friction takes of an area is taken with the shape as it is.
        """
        sides: list[Array] = []
        least: list[float] = []

        def ask(entries: dict[int, float], bound: float) -> None:
            sides.append(np.zeros(self.n_linear))
            sides[-1][list(entries)] = list(entries.values())
            least.append(bound)

        for place in np.flatnonzero(self.not_negative).tolist():
            ask({place: 1.0}, 0.0)
        ratio, wall = (float(self.shaped(values, name)[0]) for name in ("asymmetry", "walls"))
        taken = -(np.array(self.limits) * max(1.0, ratio) + wall)
        for k in range(self.n):
            areas, friction = self.of("areas", k).tolist(), self.of("friction", k).tolist()
            elastic, bladder = self.of("elasticity", k).tolist(), int(self.of("bladder", k)[0])
            ask({areas[0]: 1.0}, 0.1 * self.bench.unit)
            order, power = np.arange(1, self.n_area), np.arange(2, 2 + self.n_elastic)
            low, high = self.bench.hull[k].tolist()
            for u in np.linspace(low, high, GRID) / self.bench.scale:
                left = dict(zip(areas, (u ** np.arange(self.n_area)).tolist(), strict=True))
                left[areas[0]] -= LEAST_LEFT
                ask(left | dict(zip(friction, taken.tolist(), strict=True)), 0.0)
                stiff = power * u ** (power - 1) / self.bench.scale
                narrows = order * u ** (order - 1) / self.bench.scale
                for p in (0.0, self.bench.highest):
                    row = dict(zip(elastic, stiff.tolist(), strict=True)) | {bladder: 1.0}
                    row |= dict(zip(areas[1:], (-p * narrows).tolist(), strict=True))
                    ask(row, self.least_stiffness)
        for x, direction in product(self.bench.corners(), np.eye(self.m)):
            sides.append(self.spring_side(x, direction))
            least.append(self.least_stiffness)
        return np.array(sides), np.array(least)

    def powers(self, x: Array) -> Array:
        """Return the powers of scheduling inputs, shape (1 + powers, ...), that multiply springs."""
        powers = [v**d for v in x for d in range(1, self.degree + 1)]
        return np.array([np.ones(x.shape[1:]), *powers])

    def spring_side(self, x: Array, direction: Array) -> Array:
        """Return the constraint that springs are stiff along a direction."""
        row = np.zeros(self.n_linear)
        for q, power in enumerate(self.powers(x)):
            for j, i in product(range(self.m), repeat=2):
                row[self.spring(q, j, i)] += power * direction[j] * direction[i]
        return row

    def softest(self, values: Array) -> tuple[Array, float]:
        """Return where springs are softest: the constraint there, and the stiffness."""
        found: list[tuple[float, Array, Array]] = []
        springs = np.array([values[self.on("springs", j)] for j in range(self.m)])
        springs = springs.reshape(self.m, -1, 1 + self.m)[:, :, 1:]
        for x in self.bench.corners():
            matrix = np.tensordot(self.powers(x), springs, (0, 1))
            sizes, directions = np.linalg.eigh(0.5 * (matrix + matrix.T))
            found.append((float(sizes[0]), x, directions[:, 0]))
        stiffness, x, direction = min(found, key=lambda one: one[0])
        return self.spring_side(x, direction), stiffness


LOGARITHMIC = ("lags", "asymmetry", "venting")
"""Nonlinear parameters searched by their logarithm."""

OF_MUSCLES = ("damping", "line", "mass", "bladder", "elasticity", "areas", "friction", "relaxation")
"""Kinds of linear parameters of muscles."""

NOT_NEGATIVE = ("damping", "line", "mass", "bladder", "friction", "relaxation")
"""Those that are non-negative."""


def _slices(widths: dict[str, int], first: int = 0) -> dict[str, slice]:
    ends = np.cumsum([first, *widths.values()]).tolist()
    return {name: slice(a, b) for name, a, b in zip(widths, ends[:-1], ends[1:], strict=True)}
