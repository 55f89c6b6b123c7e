"""What of a balance of forces is fixed, what is free, and what physics asks of it.

Coefficients are those of the block, muscle by muscle, then the grip and the lags' logarithms, then what
recordings and runs have of their own (`mckibben.estimators.coupled.balance_own`). What is
free is fewer numbers, of which they are an affine function: springs between two muscles are one number.
Every muscle has a spring of its own, which makes up for elasticity and area that soften; of muscles that
do not go slack nothing tells it from the others, to which it is added in the end.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.coupled.balance_law import NEVER
from mckibben.blocks.fields import Channel, rows, vector
from mckibben.estimators.coupled.balance_own import Own

GRID = 21
"""Places along what is known of every muscle's displacement where conditions are asked for."""

LEAST_LEFT = 0.05
"""Area that friction has to leave, relative to that at rest."""

MOST_LONGER, APART = 0.5, 0.7
"""Logarithms by which a lag may become longer or shorter at once, and by which lags differ."""

LEAST_PULL = 1e-3
"""Pull of the heaviest load, over that of the highest pressure on the area at rest, that is none."""

LEAST_STIFF = 1e-3
"""Stiffness that has to be left, relative to the force of the highest pressure over the stroke."""


@dataclass(frozen=True)
class Structure:
    """Sizes and settings of a balance.

    Parameters
    ----------
    driven, scheduled, loaded, given : tuple of Channel
        Displacements, what schedules, loads, and pressures.
    degree, n_elastic, n_area : int
        Highest power of what schedules; elastic terms; area's terms.
    limits, lags : arrays
        [mm/bar], [s].
    hull : array, shape (n, 2)
        Displacements known [mm].
    scheduled_hull : array, shape (s, 2)
        What schedules, lowest and highest.
    highest : float
        Pressure [bar].
    heaviest : float
        Largest load; 1 without one.
    tare : bool
        Whether displacements count from rest at the start.
    slack : bool
        Whether muscles can go slack.
    lag_range : (float, float)
        Shortest and longest time constant that the recordings can tell [s].
    settled : bool
        Whether muscles had long been where every recording begins.
    mass : bool
        Whether what moves is heavy.
    unmeasured : tuple of int
        Recordings that hung under constant loads of their own, which are found too.
    n_starts : int
        Runs whose memories at the start are found too: all, or none.
    """

    driven: tuple[Channel, ...]
    scheduled: tuple[Channel, ...]
    loaded: tuple[Channel, ...]
    given: tuple[Channel, ...]
    degree: int
    n_elastic: int
    n_area: int
    limits: Array
    lags: Array
    hull: Array
    scheduled_hull: Array
    highest: float
    heaviest: float
    tare: bool
    slack: bool
    lag_range: tuple[float, float]
    settled: bool = False
    mass: bool = False
    unmeasured: tuple[int, ...] = ()
    n_starts: int = 0

    @property
    def n(self) -> int:
        """Muscles."""
        return len(self.driven)

    @property
    def scale(self) -> float:
        """Largest displacement known [mm]."""
        return float(np.abs(self.hull).max())

    @cached_property
    def slices(self) -> dict[str, slice]:
        """Where the coefficients of a muscle are."""
        widths = {
            "hull": 2,
            "wall": 1,
            "push": 1,
            "damping": 1,
            "line": 1,
            "bladder": 1,
            "mass": 1,
            "springs": (1 + len(self.scheduled) * self.degree) * (1 + self.n),
            "elasticity": self.n_elastic,
            "areas": self.n_area,
            "friction": self.limits.size,
            "relaxation": self.lags.size,
            "loads": len(self.loaded),
        }
        ends = np.cumsum([0, *widths.values()]).tolist()
        return {
            name: slice(first, last)
            for name, first, last in zip(widths, ends[:-1], ends[1:], strict=True)
        }

    @property
    def width(self) -> int:
        """Coefficients of a muscle."""
        return self.slices["loads"].stop

    def places(self, name: str, k: int) -> NDArray[np.intp]:
        """Return where coefficients of a muscle are among all."""
        part = self.slices[name]
        return np.arange(part.start, part.stop) + k * self.width

    @property
    def grip(self) -> int:
        """Place of the grip among coefficients; those of the lags follow."""
        return self.n * self.width

    @property
    def timing(self) -> slice:
        """Places of the lags' logarithms."""
        return slice(self.grip + 1, self.grip + 1 + self.lags.size)

    @cached_property
    def own(self) -> Own:
        """Places of what recordings and runs have of their own."""
        n_lags, first = self.lags.size, self.timing.stop
        return Own(first, self.n, n_lags, self.limits, self.unmeasured, self.n_starts)

    @property
    def size(self) -> int:
        """How many coefficients there are."""
        return self.own.stop

    @property
    def constants(self) -> NDArray[np.intp]:
        """Places of the muscles' constant forces."""
        return np.array([self._spring(0, k, -1) for k in range(self.n)])

    @property
    def start(self) -> Array:
        """Coefficients that are not found by least squares: areas at rest or loads 1, all others 0."""
        values = np.zeros(self.size)
        values[self.timing] = np.log(self.lags)
        for k in range(self.n):
            values[self.places("push", k)] = NEVER
            values[self.places("hull", k)] = self.hull[k]
            values[self.places("areas", k)[0]] = 1.0
            values[self.places("loads", k)] = 1.0
        return values

    def block(self, values: Array, pressure_range: tuple[float, float] | None = None) -> Balance:
        """Return the balance of some coefficients."""
        table = values[: self.grip].reshape(self.n, self.width)
        part = {name: table[:, place] for name, place in self.slices.items()}
        springs, bladders = part["springs"].copy(), np.maximum(part["bladder"][:, 0], 0.0)
        if not self.slack:
            for k in range(self.n):
                springs[k, 1 + k] += bladders[k]
        return Balance(
            springs=rows(springs),
            elasticity=rows(part["elasticity"]),
            areas=rows(part["areas"]),
            friction=rows(np.maximum(part["friction"], 0.0)),
            relaxation=rows(np.maximum(part["relaxation"], 0.0)),
            loads=rows(part["loads"]),
            damping=vector(np.maximum(part["damping"][:, 0], 0.0)),
            lines=vector(np.maximum(part["line"][:, 0], 0.0)),
            walls=vector(np.maximum(part["wall"][:, 0], 0.0)),
            bladders=vector(bladders) if self.slack else (),
            pushes=vector(np.maximum(part["push"][:, 0], 0.0)) if self.slack else (),
            limits=vector(self.limits),
            grip=float(max(values[self.grip], 0.0)),
            lags=vector(np.clip(np.exp(values[self.timing]), *self.lag_range)),
            hull=rows(part["hull"]),
            scale=self.scale,
            degree=self.degree,
            driven=self.driven,
            scheduled=(*self.scheduled, *self.loaded),
            given=self.given,
            tare=self.tare,
            settled=self.settled,
            pressure_range=pressure_range,
            mass=vector(np.maximum(part["mass"][:, 0], 0.0)) if self.mass else (),
        )

    def values(self, block: Balance, own: Array) -> Array:
        """Return the coefficients of a balance of this structure, behind them what runs have alone."""
        none, never = self.n * (0.0,), self.n * (NEVER,)
        single = [block.walls, block.pushes or never, block.damping]
        single += [block.lines or none, block.bladders or none, block.mass or none]
        tables = [block.hull, np.transpose(single)]
        tables += [block.springs, block.elasticity, block.areas]
        tables += [block.friction, block.relaxation, block.loads]
        table = np.hstack([np.asarray(part, dtype=np.float64) for part in tables])
        return np.concatenate([table.ravel(), [block.grip], np.log(block.lags), own])

    def packed(self) -> NDArray[np.intp]:
        """Return, for every parameter that a balance packs, its place among coefficients."""
        tables = ("springs", "elasticity", "areas", "friction", "relaxation", "loads")
        slack = ("bladder", "push") if self.slack else ()
        heavy = ("mass",) if self.mass else ()
        groups = ((*tables, "damping", "line", "wall"), (*slack, *heavy))
        first, last = (
            [place for name in names for k in range(self.n) for place in self.places(name, k)]
            for names in groups
        )
        return np.array([*first, self.grip, *last], dtype=np.intp)

    @property
    def in_newtons(self) -> bool:
        """Whether forces are in newtons: those of a muscle alone under one load."""
        return self.n == len(self.loaded) == 1

    @property
    def least_pull(self) -> float:
        """Least pull of a load's unit, on an area at rest of 1."""
        return LEAST_PULL * self.highest / self.heaviest

    def sizes(self, values: Array) -> Array:
        """Return the sizes of coefficients, in their units, beside areas at rest as they are now."""
        area = float(np.max([values[self.places("areas", k)[0]] for k in range(self.n)]))
        force = area * self.highest
        stiff = force / self.scale
        x = np.abs(self.scheduled_hull).max(axis=1)
        powers = 1.0 / self.powers(np.where(x > 0, x, 1.0))
        sizes = np.full(self.size, stiff)  # of damping and mass, too, by seconds
        for k in range(self.n):
            sizes[self.places("hull", k)] = self.scale
            sizes[self.places("wall", k)] = self.scale / self.highest
            sizes[self.places("push", k)] = force
            sizes[self.places("springs", k)] = np.outer(powers, [force, *self.n * [stiff]]).ravel()
            sizes[self.places("elasticity", k)] = force
            sizes[self.places("areas", k)] = area
            sizes[self.places("loads", k)] = force / self.heaviest
        sizes[self.grip], sizes[self.timing] = self.highest, 1.0
        sizes[self.own.first : self.own.starts] = force
        lags = np.full((self.n_starts, self.n, 1 + self.lags.size), self.scale)
        lags[:, :, 0] = 1.0
        sizes[self.own.starts :] = lags.ravel()
        return sizes

    def free(self, *, moving: bool, plain: bool = False, first: bool = False) -> Array:
        """Return how coefficients follow from what is free, shape (coefficients, free).

        ``moving`` frees walls, grip, lags, pushes, and areas at rest too. One number sets the unit of
        force: of a muscle alone its load's, while moving; else the first area at rest. ``plain``: areas
        stay what they are at rest. ``first``: walls and lags stay, which else make up for slack that is
        not there yet, and do not come back.
        """
        n_all = self.size
        columns: list[list[int]] = []
        for k in range(self.n):
            for name in ("bladder", "elasticity", "friction", "relaxation", "damping"):
                columns += [[place] for place in self.places(name, k).tolist()]
            areas = self.places("areas", k).tolist()
            newtons = moving and self.in_newtons
            free_areas = areas if moving and (newtons or k) else areas[1:]
            columns += [[place] for place in ([] if plain else free_areas)]
            columns += [[place] for place in self.places("loads", k).tolist() if not newtons]
            for name, is_free in (
                ("wall", not first),
                ("line", True),
                ("push", self.slack),
                ("mass", self.mass),
            ):
                columns += [
                    [place] for place in self.places(name, k).tolist() if moving and is_free
                ]
        for q in range(1 + len(self.scheduled) * self.degree):
            for k in range(self.n):
                if q or not self.tare:  # displacements from rest make a constant of their own
                    columns.append([self._spring(q, k, -1)])
                columns += [
                    sorted({self._spring(q, k, j), self._spring(q, j, k)}) for j in range(k, self.n)
                ]
        if moving:
            stop = self.grip + 1 if first else self.timing.stop
            columns += [[place] for place in range(self.grip, stop)]
        columns += [[place] for place in range(self.own.first, self.size)]
        mix = np.zeros((n_all, len(columns)))
        for number, places in enumerate(columns):
            mix[places, number] = 1.0
        return mix

    def _spring(self, q: int, k: int, j: int) -> int:
        """Return the place of a spring between two muscles, or, of j = -1, of muscle k's constant."""
        return int(self.places("springs", k)[q * (1 + self.n) + 1 + j])

    def conditions(self, values: Array) -> tuple[Array, Array]:
        """Return what is asked of coefficients, as sides and least.

        Shapes (m, coefficients) and (m,): sides @ coefficients >= least. What friction
        at held length takes of an area is taken where the walls are now.
        """
        n_all = self.size
        sides: list[Array] = []
        least: list[float] = []
        unit = float(np.max([values[self.places("areas", k)[0]] for k in range(self.n)]))
        stiff = LEAST_STIFF * unit * self.highest / self.scale

        def ask(entries: dict[int, float], bound: float) -> None:
            row = np.zeros(n_all)
            row[list(entries)] = list(entries.values())
            sides.append(row)
            least.append(bound)

        ask({self.grip: 1.0}, 0.0)
        ask({self.grip: -1.0}, -4.0 * self.highest)
        shortest, longest = np.log(self.lag_range).tolist()
        for place in range(self.timing.start, self.timing.stop):
            now = float(values[place])
            ask({place: 1.0}, max(shortest, now - MOST_LONGER))
            ask({place: -1.0}, -min(longest, now + MOST_LONGER))
            if place > self.timing.start:
                ask({place: 1.0, place - 1: -1.0}, APART)
        for place in range(self.n_starts):
            for k, places in enumerate(self.own.start(place).tolist()):
                far = float(np.ptp(self.hull[k]))
                for number, most in zip(places, [1.0, *self.lags.size * [far]], strict=True):
                    ask({number: 1.0}, -most)
                    ask({number: -1.0}, -most)
        for k in range(self.n):
            for name in (
                *("bladder", "push", "friction", "relaxation", "damping", "line", "wall", "mass"),
            ):
                for place in self.places(name, k).tolist():
                    ask({place: 1.0}, 0.0)
            for place in self.places("loads", k).tolist():
                ask({place: 1.0}, self.least_pull * unit if self.in_newtons else 0.0)
            ask({int(self.places("wall", k)[0]): -1.0}, -0.1 * self.scale / self.highest)
            areas, friction = self.places("areas", k), self.places("friction", k)
            ask({int(areas[0]): 1.0}, 0.1 * unit)
            wall = float(values[self.places("wall", k)[0]])
            taken = dict(zip(friction.tolist(), (-(self.limits + wall)).tolist(), strict=True))
            for u in np.linspace(self.hull[k, 0], self.hull[k, 1], GRID) / self.scale:
                area = dict(
                    zip(areas.tolist(), (u ** np.arange(self.n_area)).tolist(), strict=True)
                )
                area[int(areas[0])] -= LEAST_LEFT
                ask(area | taken, 0.0)
                powers = np.arange(2, 2 + self.n_elastic)
                stiffness = powers * u ** (powers - 1) / self.scale
                places = self.places("elasticity", k).tolist()
                elastic = dict(zip(places, stiffness.tolist(), strict=True))
                order = np.arange(1, self.n_area)
                softening = order * u ** (order - 1) / self.scale
                for p in (0.0, self.highest):
                    lost = dict(zip(areas[1:].tolist(), (-p * softening).tolist(), strict=True))
                    ask(elastic | lost | {int(self.places("bladder", k)[0]): 1.0}, stiff)
            for j in range(k):  # a first idea of what makes springs positive
                for sign in (1.0, -1.0):
                    direction = np.zeros(self.n)
                    direction[[k, j]] = 1.0, sign
                    for x in self.levels():
                        row, bound = self.spring_condition(x, direction, stiff)
                        sides.append(row)
                        least.append(bound)
            for x in self.levels():
                row, bound = self.spring_condition(x, np.eye(self.n)[k], stiff)
                sides.append(row)
                least.append(bound)
        return np.array(sides), np.array(least)

    def levels(self) -> list[Array]:
        """Return what schedules, at all its ends, and between where its powers bend."""
        share = (0.0, 1.0) if self.degree == 1 else (0.0, 0.25, 0.5, 0.75, 1.0)
        low, high = self.scheduled_hull.T if len(self.scheduled) else (np.zeros(0), np.zeros(0))
        return [low + np.array(s) * (high - low) for s in product(share, repeat=len(low))]

    def powers(self, x: Array) -> Array:
        """Return the powers of what schedules, shape (s, ...), as springs are multiplied by."""
        powers = [v**d for v in x for d in range(1, self.degree + 1)]
        return np.array([np.ones(x.shape[1:]), *powers])

    def spring_condition(self, x: Array, direction: Array, stiff: float) -> tuple[Array, float]:
        """Return that springs are stiff along a direction: a side and its least."""
        row = np.zeros(self.size)
        for q, power in enumerate(self.powers(x)):
            for k in range(self.n):
                for j in range(self.n):
                    row[self._spring(q, k, j)] += power * direction[k] * direction[j]
        return row, stiff * float(direction @ direction)

    def softest(self, values: Array) -> tuple[Array, Array, float]:
        """Return where springs are softest: level, direction and stiffness."""
        found: list[tuple[float, Array, Array]] = []
        for x in self.levels():
            matrix = np.zeros((self.n, self.n))
            for q, power in enumerate(self.powers(x)):
                for k in range(self.n):
                    for j in range(self.n):
                        matrix[k, j] += power * values[self._spring(q, k, j)]
            sizes, directions = np.linalg.eigh(0.5 * (matrix + matrix.T))
            found.append((float(sizes[0]), x, directions[:, 0]))
        stiffness, x, direction = min(found, key=lambda one: one[0])
        return x, direction, stiffness
