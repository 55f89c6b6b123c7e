"""Force balance of muscles in parallel under load, as the minimum of a convex energy.

Pressure times effective area balances the load, springs (the muscle's own and those that couple
muscles, which depend on the scheduling inputs), elasticity of the rubber, friction of the braid,
relaxation, damping, inertia and obstacles; a muscle that would have to push harder than it can goes
slack. The equation is that of `mckibben.blocks.coupled.balance_law`. A load enters once. Identification
ensures that springs are symmetric, friction and relaxation are not negative, areas exceed friction, and
stiffness exceeds the loss of area: then the equilibrium is unique and is always found, and friction
never generates energy.

This block computes pressures from coordinates, explicitly: it is the compensator. Its inverse computes
coordinates from pressures, and `mckibben.blocks.coupled.load_estimate` loads from both.

The form is this package's own. Friction that breaks away after a travel follows "A Multistate Friction
Model for the Compensation of the Asymmetric Hysteresis in the Mechanical Response of Pneumatic
Artificial Muscles"; areas and springs that couple follow what muscles in parallel do (paper A).
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Any, ClassVar, NamedTuple, Self

import numpy as np
from annotated_types import Gt, Interval
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import SEVERAL, Block, Ports, Start
from mckibben.blocks.compose import Series
from mckibben.blocks.coupled import balance_terms as at
from mckibben.blocks.coupled.balance_adaptive import learnable_balance
from mckibben.blocks.coupled.balance_law import AT_REST, FROM_REST, IN_TIME, update_state
from mckibben.blocks.coupled.balance_solving import (
    NEARLY,
    give_pressures,
    solve_equilibrium,
    start_at_rest,
    start_balance,
)
from mckibben.blocks.coupled.balance_terms import NEVER, TABLE, Layout, Sizes, layout
from mckibben.blocks.fields import STRICT, Channel, Channels, Rows, Vector, rows, vector
from mckibben.blocks.inverse import Inverse, Invertible
from mckibben.blocks.kernels import Step, fill, kernel, step
from mckibben.blocks.learning import Learnable
from mckibben.blocks.ranges import unknown_ranges
from mckibben.blocks.sample_times import needs_sample_time
from mckibben.errors import ModelError, ModelWarning


@step
def balance_step(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
) -> None:
    """Compute pressures; the last state counts samples that are out of reach."""
    c = coefficients
    m, n_x = int(c[at.N_COORDINATES]), int(c[at.N_SCHEDULES]) + int(c[at.N_LOADS])
    way = give_pressures(c, state, scratch, inputs, outputs)
    update_state(c, state, way, scratch[:m], outputs, inputs[m : m + n_x])


@step
def balance_inverse_step(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
) -> None:
    """Compute coordinates; the last state counts samples that were not solved."""
    c = coefficients
    n, m = int(c[at.N_MUSCLES]), int(c[at.N_COORDINATES])
    n_x = int(c[at.N_SCHEDULES]) + int(c[at.N_LOADS])
    q, p, x = scratch[:m], inputs[:n], inputs[n : n + n_x]
    fill(q, state)
    way = FROM_REST if state[at.FRESH] != 0.0 else IN_TIME
    left = solve_equilibrium(c, state, way, q, x, p, scratch[m:])
    update_state(c, state, way, q, p, x)
    for j in range(m):
        outputs[j] = q[j] - state[int(c[at.TARE]) + j]
    if not left < NEARLY:
        state[at.FAILED] += 1.0


@kernel
def balance_inverse_start(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, virgin: bool
) -> None:
    """Start muscles at rest without pressure, or in equilibrium with the first pressures."""
    c = coefficients
    n, m = int(c[at.N_MUSCLES]), int(c[at.N_COORDINATES])
    n_x = int(c[at.N_SCHEDULES]) + int(c[at.N_LOADS])
    p, x, q = inputs[:n], inputs[n : n + n_x], scratch[:m]
    start_at_rest(c, state, x, q, scratch[m : m + n], scratch[m + n :])
    if virgin:
        solve_equilibrium(c, state, AT_REST, q, x, p, scratch[m + n :])
        update_state(c, state, AT_REST, q, p, x)


USUAL_TOP = 10.0
"""Highest pressure of an older file without a range of pressures [bar]."""

NEEDED = ("springs", "elasticity", "areas", "friction", "relaxation", "loads", "damping", "walls")
"""Fields that are not optional."""


@dataclass(frozen=True, config=STRICT)
class Balance(Invertible):
    """Force balance: from coordinates of n muscles, scheduling inputs and loads to pressures.

    Forces are in N, or, of a model without measured force, in bar on muscle 1's area at rest.
    Coordinates are the displacements of the muscles, or fewer: then each shortens along its direction,
    and loads and springs act on coordinates.

    Parameters
    ----------
    springs : sequence of m sequences of float
        A constant force [N], then springs to all coordinates [N/mm], of every coordinate and for every
        power of what schedules.
    elasticity : sequence of n sequences of float
        Coefficients of (y / scale)^2 and up [N].
    areas : sequence of n sequences of float
        Coefficients of (y / scale)^0 and up [N/bar]; the first is positive.
    friction : sequence of n sequences of float
        Stiffness of the stops of every muscle [N/mm], not negative.
    relaxation : sequence of n sequences of float
        Stiffness of what relaxes, of every muscle [N/mm], not negative.
    loads : sequence of m sequences of float
        How much of every load pulls at a coordinate, usually 1.
    damping : sequence of n float
        Force by velocity [N s/mm], not negative.
    walls : sequence of n float
        Stretch of the wall by pressure, which acts on friction at constant length too [mm/bar].
    limits : sequence of float
        Travel at which every stop breaks away at the highest pressure [mm], increasing.
    friction_growth : float
        Share of that travel which grows with pressure: 0 for constant friction, 1 for friction
        proportional to pressure; not negative. Stops break away at ``limits (1 - friction_growth +
        friction_growth p / highest_pressure)``, which is never below 0.
    highest_pressure : float
        Highest of the recorded pressures [bar], positive.
    lags : sequence of float
        Time constants of what relaxes [s].
    hull : sequence of n pairs of float
        Shortenings known [mm]; beyond, elasticity and area go on straight.
    scale : float
        Of polynomials [mm].
    degree : int
        Highest power of what schedules.
    driven, scheduled, given : sequence of Channel
        Coordinates; what schedules, then the loads; pressures.
    lines : sequence of n float, optional
        Force by velocity of the line's resistance to what flows into a muscle, at rest; elsewhere with
        the square of its area [N s/mm]. Default none.
    bladders : sequence of n float
        Spring of every muscle's own, which goes slack with it [N/mm], not negative. Default none.
    pushes : sequence of n float
        Resistance at which each goes slack [N], negative where it pulls by itself without pressure.
        Default none does.
    tare : bool
        Whether coordinates count from where the muscles rested, without pressure, at the start.
    settled : bool
        Whether the muscles have long been where the first sample finds them, so that nothing relaxes
        any more; else they have come there just now.
    pressure_range : (float, float), optional
        Pressures are clipped to it, and said so.
    mass : sequence of n float, optional
        Force by acceleration [N s^2/mm], not negative; none by default.
    known : sequence of pairs of float
        Lowest and highest of all that scheduled and loaded it where it was identified, if known.
    asymmetry : float, optional
        Ratio of the travel at which stops break away while muscles lengthen to that while they shorten;
        positive. Default 1.
    friction_slopes : sequence of float
        Share of that travel which scheduling inputs add, by their units; not negative.
        Default none.
    obstacles : sequence of m sequences of float
        What every coordinate meets, one after another: 1 on the way up or -1 on the way down, where
        [mm], and its stiffness [N/mm]: a constant, and by each that schedules. Default none.
    directions : sequence of n sequences of m float
        Shortening of every muscle by coordinates. Default the identity.
    preload : float
        Pressure that muscles share where they are more than coordinates [bar]; the compensator departs
        from it as little as it can.
    drive : sequence of n sequences of 1 + r float
        How muscles that are more than coordinates were driven: the middle of their pressures, then how
        far these went along each of r directions, m or more; standard deviations [bar]. The compensator
        departs from that middle along those directions alone, in proportion to how far they went.
        Default none: any pressures, about the ``preload``.
    held : bool
        Whether a machine holds the muscles where the first sample finds them before their pressure
        rises; else they rest, without pressure, where their loads let them.
    """

    kind: ClassVar[str] = "balance"
    added: ClassVar[Mapping[str, int]] = dict.fromkeys(
        (
            *("lines", "bladders", "pushes", "tare", "settled", "pressure_range", "mass", "known"),
            *(
                "asymmetry",
                "friction_slopes",
                "obstacles",
                "directions",
                "preload",
                "drive",
                "held",
            ),
        ),
        2,
    )
    ports: ClassVar[Ports] = SEVERAL
    kernel: ClassVar[Step] = balance_step
    start_kernel: ClassVar[Start] = start_balance
    inverse_kernel: ClassVar[Step] = balance_inverse_step
    inverse_start_kernel: ClassVar[Start] = balance_inverse_start
    inverse_path_dependent: ClassVar[bool] = True
    complex_step: ClassVar[bool] = False
    settable: ClassVar[Mapping[str, str | None]] = {"preload": "pressure_range"}
    increasing = ("limits",)
    parameters: ClassVar[tuple[str, ...]] = (
        *("springs", "elasticity", "areas", "friction", "relaxation", "loads"),
        *("damping", "lines", "walls", "friction_growth", "bladders", "pushes", "mass"),
        *("asymmetry", "friction_slopes", "obstacles"),
    )
    formulas = (r"A_k(y) = \sum_i a_{ki} (y / L)^i",)

    springs: Annotated[Rows, TABLE["springs"].notation]
    elasticity: Annotated[Rows, TABLE["elasticity"].notation]
    areas: Annotated[Rows, TABLE["areas"].notation]
    friction: Annotated[Rows, TABLE["friction"].notation]
    relaxation: Annotated[Rows, TABLE["relaxation"].notation]
    loads: Annotated[Rows, TABLE["loads"].notation]
    damping: Annotated[Vector, TABLE["damping"].notation]
    walls: Annotated[Vector, TABLE["walls"].notation]
    limits: Annotated[Vector, "r_m [mm]"]
    friction_growth: Annotated[FiniteFloat, TABLE["friction_growth"].notation]
    highest_pressure: Annotated[FiniteFloat, Gt(0), "P [bar]"]
    lags: Annotated[Vector, r"\tau_l [s]"]
    hull: Rows
    scale: Annotated[FiniteFloat, Gt(0), "L [mm]"]
    degree: Annotated[int, Interval(ge=1, le=4)]
    driven: Annotated[Channels, "y_i"]
    scheduled: Channels
    given: Annotated[Channels, "p_i"]
    lines: Annotated[Vector, TABLE["lines"].notation] = ()
    bladders: Annotated[Vector, TABLE["bladders"].notation] = ()
    pushes: Annotated[Vector, TABLE["pushes"].notation] = ()
    tare: bool = False
    settled: bool = False
    pressure_range: tuple[FiniteFloat, FiniteFloat] | None = None
    mass: Annotated[Vector, TABLE["mass"].notation] = ()
    known: Rows = ()
    asymmetry: Annotated[Annotated[FiniteFloat, Gt(0)] | None, TABLE["asymmetry"].notation] = None
    friction_slopes: Annotated[Vector, TABLE["friction_slopes"].notation] = ()
    obstacles: Annotated[Rows, TABLE["obstacles"].notation] = ()
    directions: Annotated[Rows, "W_{ki}"] = ()
    preload: Annotated[FiniteFloat, "p_s [bar]"] = 0.0
    drive: Annotated[Rows, "D_{ki} [bar]"] = ()
    held: bool = False

    @staticmethod
    def converted(fields: dict[str, Any]) -> dict[str, Any]:
        """Return fields as of today: stops of older files break away at ``limits (p + p_0 + g x)``."""
        older = {"grip": "friction_offset", "grips": "friction_slopes"}
        fields = {older.get(name, name): value for name, value in fields.items()}
        if "friction_offset" not in fields or "friction_growth" in fields:
            return fields
        offset = fields.pop("friction_offset")
        top = max(map(abs, fields.get("pressure_range") or (USUAL_TOP,)))
        full = top + offset
        return fields | {
            "limits": vector(full * np.array(fields["limits"])),
            "friction_growth": top / full,
            "highest_pressure": top,
            "friction_slopes": vector(np.array(fields.get("friction_slopes", ())) / full),
        }

    @classmethod
    def unchecked(cls, **fields: Any) -> Self:
        """Return a balance without its checks: identification makes thousands that are only run."""
        made = object.__new__(cls)
        vars(made).update(fields)
        return made

    def __post_init__(self) -> None:
        self.check_channels()
        self._check_sizes()
        self._check_physics()

    def _check_sizes(self) -> None:
        """Raise an error for fields of inconsistent sizes."""
        n, m, n_x = len(self.given), len(self.driven), self.n_schedules
        self._refuse(
            n_x < 0,
            f"has {self.n_loads} loads, and {len(self.scheduled)} channels that schedule or load it",
            "give every load a channel, behind what schedules",
        )
        self._refuse(
            m > n or (m < n and not self.directions),
            f"has {n} pressures of {m} coordinates",
            "give a pressure for every coordinate, or, of more muscles, their directions",
        )
        self._refuse(
            bool(self.drive) and m == n,
            "has a drive, and no more muscles than coordinates",
            "leave it out: their pressures follow from the coordinates",
        )
        shapes: dict[str, tuple[int, ...]] = {"hull": (n, 2)}
        for name in self.parameters:
            count, width = self.sizes.of(TABLE[name].of), self.sizes.number(TABLE[name].width)
            if isinstance(value := getattr(self, name), tuple) and (value or name in NEEDED):
                of_rows = TABLE[name].of != "all" and TABLE[name].width != "one"
                shapes[name] = (count, width) if of_rows else (count * width,)
        shapes |= {"directions": (n, m)} if self.directions else {}
        shapes |= {"drive": (n, max(len(self.drive[0]), 1 + m))} if self.drive else {}
        shapes |= {"known": (len(self.scheduled), 2)} if self.known else {}
        for name, (count, *widths) in shapes.items():
            value = getattr(self, name)
            each = [len(row) for row in value if widths]
            self._refuse(
                len(value) != count or each != count * widths,
                f"has {len(value)}{f' rows of {each}' * bool(widths)}",
                f"give {count}{''.join(f' rows of {width}' for width in widths)}",
                name,
            )

    def _check_physics(self) -> None:
        """Raise an error for numbers that would generate energy or have no meaning."""
        low, high = self.pressure_range or (-np.inf, np.inf)
        ends = {"hull": self.hull, "pressure_range": ((low, high),)}
        positive = {"lags": self.lags, "areas": [row[0] for row in self.areas]}
        for name, pairs in ends.items():
            wrong = any(not lower < upper for lower, upper in pairs)
            has = f"has {getattr(self, name)}"
            self._refuse(wrong, has, "give the lower end first", name)
        for name, values in positive.items():
            wrong = any(not value > 0 for value in values)
            self._refuse(wrong, f"has {values}", "give positive ones", name)
        rises = all(a < b for a, b in pairwise((0.0, *self.limits)))
        remedy = "give positive ones, in increasing order"
        self._refuse(not rises, f"has {self.limits}", remedy, "limits")
        for name in self.parameters:
            numbers = np.array(getattr(self, name) or 0.0, ndmin=2)
            if name == "obstacles" and self.obstacles:
                numbers = numbers.reshape(-1, self.sizes.obstacle)[:, at.STIFFNESS :]
            wrong = TABLE[name].least == 0.0 and bool((numbers < 0).any())
            self._refuse(
                wrong, "has some below 0, which would generate energy", "give none below 0", name
            )
        pushes_mass = bool(self.mass and self.pushes)
        only = "give one of mass and pushes"
        self._refuse(pushes_mass, "has it, and muscles that go slack", only, "mass")
        pushes_mass = self.held and self.tare
        self._refuse(pushes_mass, "has it, and starts held", "give one of tare and held", "tare")

    def _refuse(self, wrong: bool, what: str, remedy: str, field: str | None = None) -> None:
        if wrong:
            raise ModelError(f"{self.kind!r} {what}", parameter=field, remedy=remedy)

    def equations(self) -> tuple[str, ...]:
        """Return the force balance with the terms of this model, then area and elasticity."""
        has = {name: bool(np.any(getattr(self, name) or 0.0)) for name in self.parameters}
        has["elasticity"] |= has["bladders"]
        written = {name: TABLE[name].equation for name in self.parameters if has[name]}
        written["springs"] = r"S_{k0} + \sum_j S_{kj} y_j"
        powers = [rf"x{i}{p}" for i in self._numbered() for p in self._powers()]
        if powers:
            written["springs"] = r"\sum_q X_q \left(S_{kq0} + \sum_j S_{kqj} y_j\right)"
        if powers and has["obstacles"]:
            stiffness = "".join(rf" + o_{{kn{i + 1}}} x{x}" for i, x in enumerate(self._numbered()))
            written["obstacles"] = written["obstacles"].replace(
                "o_{kn}", rf"(o_{{kn0}}{stiffness})"
            )
        outer, inner = (
            " + ".join(
                written[name]
                for name, term in TABLE.items()
                if term.of == owner and written.get(name)
            )
            for owner in ("coordinate", "muscle")
        )
        balance: tuple[str, ...] = (rf"p_k A_k(y_k) = {outer}{' + ' * bool(inner)}{inner}",)
        if self.directions:
            outer = outer.replace("_{k", "_{i").replace("y_k", "y_i").replace("y_", "q_")
            pulls = rf"\sum_k W_{{ki}} \left(p_k A_k(y_k) - R_k\right) = {outer}"
            balance = (pulls, rf"R_k = {inner or 0},\quad y_k = \sum_i W_{{ki}} q_i")
            near = r"D_{k1} + \sum_{i \ge 2} D_{ki} v_i" if self.drive else "p_s"
            balance += (rf"p_k \text{{: of all solutions that nearest to }} {near}",)
        if powers:
            listed = r",\; ".join(["1", *powers])
            balance += (rf"(X_0,\; \ldots) = ({listed})",)
        elastic = [r"b_k y"] * has["bladders"] + [r"\sum_{i \ge 2} e_{ki} (y / L)^i"] * any(
            map(any, self.elasticity)
        )
        parts = [*self.formulas, *([f"E_k(y) = {' + '.join(elastic)}"] if elastic else [])]
        growth = r"1 - \lambda + \lambda p_k / P"
        if has["friction_slopes"]:
            growth += "".join(rf" + g_{i + 1} x{x}" for i, x in enumerate(self._numbered()))
        limit = f"r_m ({growth})"
        ends = rf"\pm {limit}"
        if self.asymmetry is not None:
            ends = rf"{limit}, \text{{ down to }} -\rho {limit}"
        stretch = "y_k + w_k p_k" if has["walls"] else "y_k"
        memory = {
            rf"s_{{km}} \text{{ follows }} {stretch} \text{{ up to }} {ends}": self.limits,
            r"\dot{z}_{kl} = \dot{y}_k - z_{kl} / \tau_l": self.lags,
            r"\text{muscle } k \text{ is slack where it would push with more than } Q_k": self.pushes,
        }
        remembered = r",\quad ".join(line for line, numbers in memory.items() if numbers)
        return tuple(line for line in (*balance, r",\quad ".join(parts), remembered) if line)

    def _numbered(self) -> list[str]:
        """Return the indices of what schedules: none of a single one."""
        n = self.n_schedules
        return [""] if n == 1 else [f"_{i + 1}" for i in range(n)]

    def _powers(self) -> list[str]:
        """Return the exponents of what schedules."""
        return [f"^{power}" if power > 1 else "" for power in range(1, self.degree + 1)]

    def symbol_of(self, field: str, index: tuple[int, ...]) -> str:
        """Return the symbol of a number: its muscle or coordinate, then what schedules, then where."""
        if field == "springs":
            power, to = divmod(index[-1], 1 + len(self.driven))
            places = [index[0] + 1, *([power] if self.n_schedules > 0 else []), to]
            return f"S_{{{','.join(map(str, places))}}}"
        if field == "obstacles":
            number, place = divmod(index[-1], self.sizes.obstacle)
            letter = (r"\sigma", r"\xi", "o")[min(place, at.STIFFNESS)]
            places = [index[0] + 1, number + 1]
            if place >= at.STIFFNESS and self.n_schedules > 0:
                places.append(place - at.STIFFNESS)
            return f"{letter}_{{{','.join(map(str, places))}}}"
        return super().symbol_of(field, index)

    def letter_of(self, field: str, k: int) -> str:
        """Return the letter of a channel: loads are behind what schedules."""
        if field == "scheduled":
            return "x_i" if k < self.n_schedules else "F_l"
        return "q_i" if field == "driven" and self.directions else super().letter_of(field, k)

    @property
    def n_loads(self) -> int:
        """Number of loads: the last scheduling inputs."""
        return len(self.loads[0]) if self.loads else 0

    @property
    def n_schedules(self) -> int:
        """Number of inputs that schedule springs: the first ones."""
        return len(self.scheduled) - self.n_loads

    @cached_property
    def sizes(self) -> Sizes:
        """The numbers of muscles, coordinates, and of all else that a balance has."""
        width = at.STIFFNESS + 1 + self.n_schedules
        return Sizes(
            muscles=len(self.given),
            coordinates=len(self.driven),
            schedules=self.n_schedules,
            degree=self.degree,
            loads=self.n_loads,
            stops=len(self.limits),
            lags=len(self.lags),
            elastic=len(self.elasticity[0]) if self.elasticity else 0,
            area=max(len(self.areas[0]) if self.areas else 0, 1),
            obstacles=len(self.obstacles[0]) // width if self.obstacles else 0,
            driven=len(self.drive[0]) - 1 if self.drive else 0,
            moves=2 if any((*self.damping, *self.lines, *self.mass)) else 0,
        )

    @property
    def places(self) -> Layout:
        """Where the numbers are among coefficients and states."""
        return layout(self.sizes)

    @property
    def free_fields(self) -> Mapping[str, str | None]:
        """Fields to set: the preload where muscles are more than coordinates, and not driven as one."""
        return self.settable if self.directions and not self.drive else {}

    @property
    def moves(self) -> Array:
        """Shortening of every muscle per coordinate, shape (n, m)."""
        return np.array(self.directions) if self.directions else np.eye(len(self.given))

    @property
    def known_coordinates(self) -> Array:
        """Lowest and highest coordinates of the identified range of shortening, shape (m, 2)."""
        ends = np.linalg.pinv(self.moves)[:, :, np.newaxis] * np.array(self.hull)
        return np.stack([ends.min(axis=2).sum(axis=1), ends.max(axis=2).sum(axis=1)], axis=1)

    @property
    def rate_dependent(self) -> bool:  # type: ignore[override]
        """Whether there is relaxation, damping or mass."""
        return bool(self.lags) or any(self.damping) or any(self.lines) or any(self.mass)

    @property
    def n_states(self) -> int:
        """States: coordinates, tare; stretch, stops, lags, moves of muscles; start, failed samples."""
        return self.places.n_states

    @property
    def n_scratch(self) -> int:
        """Scratch: coordinates, three numbers a muscle, what equilibrium needs, and a drive."""
        n, m = len(self.given), len(self.driven)
        return 3 * n + m + self.places.head[at.WORK] + (n * n + n * m + m if self.drive else 0)

    def coefficients(self, sample_time: float | None) -> Array:
        """Return the coefficients, in the places of `mckibben.blocks.coupled.balance_terms`.

        Raises
        ------
        ModelError
            Of a model that depends on rate, without a sample time.
        """
        step = needs_sample_time(self.kind, sample_time) if self.rate_dependent else np.inf
        low, high = self.pressure_range or (-np.inf, np.inf)
        middle, ways = np.split(np.reshape(self.drive, (len(self.given), -1)), [1], axis=1)
        lags = np.array(self.lags)
        values: dict[str, object] = {
            "decays": np.exp(-step / lags),
            "gains": lags / step * -np.expm1(-step / lags),
            "drive": np.append(middle, ways @ ways.T) if self.drive else (),
            "pushes": self.pushes or len(self.given) * (NEVER,),
            "directions": self.moves,
        }
        c = np.zeros(self.places.size)
        c[: at.SCALE] = self.places.head
        c[at.SCALE : at.LIMITS] = (
            *(self.scale, self.friction_growth, self.highest_pressure, self.asymmetry or 1.0),
            *(low, high, 1.0 / step, self.tare, not self.settled),
            *(self.preload, bool(self.directions), self.held),
        )
        for name, places in self.places.at.items():
            value = np.asarray(values[name] if name in values else getattr(self, name))
            if value.size:  # optional ones that are left out are 0
                c[places] = value.reshape(places.shape)
        return c

    @cached_property
    def known_inputs(self) -> Array:
        """Ranges of coordinates, and of what schedules and loads."""
        scheduled = (
            np.reshape(self.known, (-1, 2)) if self.known else unknown_ranges(len(self.scheduled))
        )
        return np.vstack([self.known_coordinates, scheduled])

    @cached_property
    def known_outputs(self) -> Array:
        """Ranges of pressures."""
        return np.stack(self.reachable(), axis=1)

    def reachable(self) -> tuple[Array, Array]:
        """Return the lowest and highest pressures."""
        if self.pressure_range is None:
            return super().reachable()
        low, high = self.pressure_range
        return np.full(len(self.given), low), np.full(len(self.given), high)

    def report(self, state: Array) -> None:
        """Warn of references that need pressures out of range, or pushing muscles."""
        if not state[-1] > 0:
            return
        low, high = self.pressure_range or (-np.inf, np.inf)
        # what a sensor is off at rest is no end
        low = 0.0 if abs(low) < 1e-3 * (high - low) else low
        names = " or ".join(channel.name for channel in self.given)
        pushing = " or muscles to push harder than they can," if self.pushes else ""
        warnings.warn(
            f"{int(state[-1])} samples need {names} beyond {low:.4g} to {high:.4g} "
            f"{self.given[0].unit} (behind a dead zone, if there is one){pushing} and were clipped "
            "there by the compensator",
            ModelWarning,
            stacklevel=4,
        )

    @property
    def clip_counts(self) -> tuple[int, ...]:
        """Place of the count of samples that needed pressures out of range."""
        return (self.n_states - 1,)

    solved: ClassVar[bool] = True

    @property
    def learnable(self) -> Learnable:
        """Forces and factors of every muscle."""
        scheduled = self.known[: self.n_schedules] or self.n_schedules * ((0.0, 0.0),)
        return learnable_balance(
            self.coefficients,
            lambda c: Inverse(self._with_coefficients(c)),
            known=self.known_coordinates,
            scheduled=np.reshape(scheduled, (-1, 2)),
        )

    def _with_coefficients(self, c: Array) -> Self:
        """Return the balance with other springs and force terms."""
        names = ("springs", "elasticity", "areas", "friction", "relaxation", "bladders")
        numbers = {name: c[self.places.at[name]] for name in names if getattr(self, name)}
        return replace(self, **fields_of(numbers))

    @property
    def n_inverse_states(self) -> int:
        """Number of states of the inverse: as many as this block's."""
        return self.n_states

    def inverse_complaint(self, state: Array) -> str:
        """Return a warning about pressures without equilibrium."""
        return (
            f"{self.kind!r} found no equilibrium in {int(state[-1])} samples: the model was not made "
            "for such pressures"
        )

    def unit_of(self, field: str, index: tuple[int, ...]) -> str | None:
        """Return the unit of a parameter: forces in N, or in the input's unit for relative areas."""
        _, unit, by = self._entry(field, index)
        driving = self.given[0].unit
        force = driving if self.areas[0][0] == 1.0 else "N"
        units = {"N": force, "mm": self.driven[0].unit, "bar": driving}
        unit = re.sub(r"\b(N|mm|bar)\b", lambda match: units[match[0]], unit).rstrip("/")
        return f"{unit or 1}{' ' if '/' in unit else '/'}{by}" if by else unit

    def is_convention(self, field: str, index: tuple[int, ...]) -> bool:
        """Return whether a parameter is a side, or sets the unit of force."""
        unit = "loads" if np.shape(self.loads) == (1, 1) else "areas"
        side = field == "obstacles" and index[-1] % self.sizes.obstacle == at.SIDE
        return side or (field == unit and not any(index))

    def name_of(self, field: str, index: tuple[int, ...]) -> str:
        """Return the label of a parameter: its muscle, channel, and scheduling input."""
        return self._entry(field, index)[0]

    def _entry(self, field: str, index: tuple[int, ...]) -> tuple[str, str, str]:
        """Return a number's label, unit, and by how much of what schedules that is."""
        if field not in TABLE:
            return super().name_of(field, index), super().unit_of(field, index) or "", ""
        term, place, power = TABLE[field], index[-1] if index else 0, 0
        whose = "coordinate" if self.directions and term.of == "coordinate" else "muscle"
        of = f" of {whose} {index[0] + 1}" if self.sizes.of(term.of) > 1 else ""
        units = term.units(self.sizes)
        name, unit = f"{term.label}{of}", units[place % len(units)]
        if field == "springs":
            power, to = divmod(place, 1 + len(self.driven))
            name = name if to else f"constant force{of}"
            name += f" to {whose} {to}" if to not in (0, index[0] + 1) else ""
        elif field == "obstacles":
            number, place = divmod(place, self.sizes.obstacle)
            power = max(place - at.STIFFNESS, 0)
            what = ("side", "place", "stiffness")[place - power]
            name = f"{what} of obstacle {number + 1}{of}"
        elif field == "loads":
            load = self.scheduled[place - self.n_loads]
            return f"{name} of {load.name}", unit, load.unit
        elif field == "friction_slopes":
            power = 1 + place * self.degree
        elif field in ("friction", "relaxation"):
            name = f"{term.label} {place + 1}{of}"
        elif field in ("elasticity", "areas"):
            order = place + 2 * (field == "elasticity")
            raised = f" by displacement^{order}".removesuffix("^1")
            name += raised if order else " at rest"
        if not power:
            return name, unit, ""
        by, order = divmod(power - 1, 1 if field == "obstacles" else self.degree)
        channel, raised = self.scheduled[by], f"^{order + 1}" if order else ""
        return f"{name} by {channel.name}{raised}", unit, f"{channel.unit}{raised}"

    @classmethod
    def example(cls) -> Self:
        """Return two muscles with an extensor, one of them under a load."""
        return cls(
            springs=((0.0, 10.0, -2.0, -3.0, 1.0, 0.4), (0.0, -2.0, 11.0, -3.0, 0.4, 1.2)),
            elasticity=((6.0, 4.0), (3.0, 8.0)),
            areas=((60.0, -25.0, -6.0), (66.0, -20.0, -8.0)),
            friction=((3.0, 1.5), (2.5, 2.0)),
            relaxation=((1.0, 0.6), (0.8, 0.5)),
            loads=((1.0,), (0.0,)),
            damping=(0.1, 0.05),
            lines=(0.06, 0.04),
            walls=(0.05, 0.1),
            limits=(5.0, 20.0),
            friction_growth=0.95,
            highest_pressure=9.5,
            lags=(0.8, 12.0),
            hull=((-20.0, 50.0), (-20.0, 50.0)),
            bladders=(4.0, 5.0),
            pushes=(150.0, 120.0),
            scale=50.0,
            degree=1,
            driven=tuple(Channel(f"displacement_{k}", "mm") for k in (1, 2)),
            scheduled=(Channel("pressure_extensor", "bar"), Channel("force", "N")),
            given=tuple(Channel(f"pressure_{k}", "bar") for k in (1, 2)),
        )


def fields_of(numbers: Mapping[str, Array]) -> dict[str, Any]:
    """Return fields of a balance from their coefficients, a row a coordinate or muscle."""
    return {
        name: vector(table[:, 0]) if TABLE[name].width == "one" else rows(table)
        for name, table in numbers.items()
    }


class Placed(NamedTuple):
    """A balance, its direction in the model, and the parts before and after it."""

    balance: Balance
    solved: bool
    before: tuple[Block, ...]
    behind: tuple[Block, ...]


def balance_in(model: Block) -> Placed | None:
    """Return the balance of a model, compensator or inverse; None if it has none."""
    parts = model.parts if isinstance(model, Series) else (model,)
    for k, part in enumerate(parts):
        solved = isinstance(part, Inverse)
        balance = part.forward if isinstance(part, Inverse) else part
        if isinstance(balance, Balance):
            return Placed(balance, solved, parts[:k], parts[k + 1 :])
    return None


def drive_of(model: Block) -> tuple[Array, Array] | None:
    """Return the middle of the pressures at which a model was driven, (n,), and ways from there, (n, r).

    None if all pressures were driven freely, or the model does not begin with them.
    """
    placed = balance_in(model)
    if placed is None or not placed.solved or not placed.balance.drive:
        return None
    drive = np.array(placed.balance.drive)
    return drive[:, 0], drive[:, 1:]
