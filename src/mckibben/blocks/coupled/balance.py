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
from functools import cached_property
from itertools import pairwise
from typing import Annotated, ClassVar, NamedTuple, Self

import numpy as np
from annotated_types import Gt, Interval
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import SEVERAL, Block, Ports, Start
from mckibben.blocks.compose import Series
from mckibben.blocks.coupled.balance_adaptive import learnable_balance
from mckibben.blocks.coupled.balance_law import (
    AT_REST,
    FROM_REST,
    IN_TIME,
    NEARLY,
    NEVER,
    give_pressures,
    solve_equilibrium,
    start_at_rest,
    start_balance,
    update_state,
)
from mckibben.blocks.fields import STRICT, Channel, Channels, Rows, Vector
from mckibben.blocks.inverse import Inverse, Invertible
from mckibben.blocks.kernels import Step, kernel, step
from mckibben.blocks.learning import Learnable
from mckibben.blocks.ranges import unknown
from mckibben.blocks.sample_times import needs_sample_time
from mckibben.errors import ModelError, ModelWarning


@step
def balance_step(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
) -> None:
    """Compute pressures; the last state counts samples that are out of reach."""
    c = coefficients
    m, n_x = int(c[1]), int(c[2]) + int(c[4])
    way = give_pressures(c, state, scratch, inputs, outputs)
    update_state(c, state, way, scratch[:m], outputs, inputs[m : m + n_x])


@step
def balance_inverse_step(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
) -> None:
    """Compute coordinates; the last state counts samples that were not solved."""
    c = coefficients
    n, m, n_x = int(c[0]), int(c[1]), int(c[2]) + int(c[4])
    q, p, x = scratch[:m], inputs[:n], inputs[n : n + n_x]
    for j in range(m):
        q[j] = state[j]
    way = FROM_REST if state[state.size - 2] != 0.0 else IN_TIME
    left = solve_equilibrium(c, state, way, q, x, p, scratch[m:])
    update_state(c, state, way, q, p, x)
    for j in range(m):
        outputs[j] = q[j] - state[state.size - 2 - m + j]
    if not left < NEARLY:
        state[state.size - 1] += 1.0


@kernel
def balance_inverse_start(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, virgin: bool
) -> None:
    """Start muscles at rest without pressure, or in equilibrium with the first pressures."""
    c = coefficients
    n, m, n_x = int(c[0]), int(c[1]), int(c[2]) + int(c[4])
    p, x, q = inputs[:n], inputs[n : n + n_x], scratch[:m]
    start_at_rest(c, state, x, q, scratch[m : m + n], scratch[m + n :])
    if virgin:
        solve_equilibrium(c, state, AT_REST, q, x, p, scratch[m + n :])
        update_state(c, state, AT_REST, q, p, x)


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
        Travel at which every stop breaks away, of the pressure that friction is proportional to
        [mm/bar], increasing.
    friction_offset : float
        p_0: friction vanishes at the pressure -p_0 [bar]; stops break away at ``limits (p + p_0)``.
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
        Force at which each goes slack [N], not negative. Default none does.
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
        Friction offset per scheduling input, in addition to pressure; not negative [bar by its unit].
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
    ports: ClassVar[Ports] = SEVERAL
    kernel: ClassVar[Step] = balance_step
    start_kernel: ClassVar[Start] = start_balance
    inverse_kernel: ClassVar[Step] = balance_inverse_step
    inverse_start_kernel: ClassVar[Start] = balance_inverse_start
    inverse_path_dependent: ClassVar[bool] = True
    complex_step: ClassVar[bool] = False
    increasing = ("limits",)
    renamed: ClassVar[Mapping[str, str]] = {"grip": "friction_offset", "grips": "friction_slopes"}
    parameters: ClassVar[tuple[str, ...]] = (
        *("springs", "elasticity", "areas", "friction", "relaxation", "loads"),
        *("damping", "lines", "walls", "friction_offset", "bladders", "pushes", "mass"),
        *("asymmetry", "friction_slopes", "obstacles"),
    )
    formulas = (
        r"A_k(y) = \sum_i a_{ki} (y / L)^i,\quad E_k(y) = b_k y + \sum_{i \ge 2} e_{ki} "
        "(y / L)^i",
    )

    springs: Annotated[Rows, "S_{ki}"]
    elasticity: Annotated[Rows, "e_{ki} from 2 [N]"]
    areas: Annotated[Rows, "a_{ki} from 0 [N/bar]"]
    friction: Annotated[Rows, "h_{km} [N/mm]"]
    relaxation: Annotated[Rows, r"\kappa_{kl} [N/mm]"]
    loads: Annotated[Rows, "C_{kl}"]
    damping: Annotated[Vector, "d_k [N s/mm]"]
    walls: Annotated[Vector, "w_k [mm/bar]"]
    limits: Annotated[Vector, "r_m [mm/bar]"]
    friction_offset: Annotated[FiniteFloat, "p_0 [bar]"]
    lags: Annotated[Vector, r"\tau_l [s]"]
    hull: Rows
    scale: Annotated[FiniteFloat, Gt(0), "L [mm]"]
    degree: Annotated[int, Interval(ge=1, le=4)]
    driven: Annotated[Channels, "y_i"]
    scheduled: Channels
    given: Annotated[Channels, "p_i"]
    lines: Annotated[Vector, "l_k [N s/mm]"] = ()
    bladders: Annotated[Vector, "b_k [N/mm]"] = ()
    pushes: Annotated[Vector, "P_k [N]"] = ()
    tare: bool = False
    settled: bool = False
    pressure_range: tuple[FiniteFloat, FiniteFloat] | None = None
    mass: Annotated[Vector, "m_k [N s^2/mm]"] = ()
    known: Rows = ()
    asymmetry: Annotated[Annotated[FiniteFloat, Gt(0)] | None, r"\rho"] = None
    friction_slopes: Annotated[Vector, "g_i"] = ()
    obstacles: Annotated[Rows, "o_{ki}"] = ()
    directions: Annotated[Rows, "W_{ki}"] = ()
    preload: Annotated[FiniteFloat, "p_s [bar]"] = 0.0
    drive: Annotated[Rows, "D_{ki} [bar]"] = ()
    held: bool = False

    def __post_init__(self) -> None:
        self.check_channels()
        self._check_sizes()
        self._check_physics()

    def _check_sizes(self) -> None:
        """Raise an error for fields of inconsistent sizes."""
        n, m, n_x = len(self.given), len(self.driven), self.n_schedules
        if n_x < 0:
            raise ModelError(
                f"{self.kind!r} has {self.n_loads} loads, and {len(self.scheduled)} "
                "channels that schedule or load it",
                remedy="give every load a channel, behind what schedules",
            )
        if m > n or (m < n and not self.directions):
            raise ModelError(
                f"given of {self.kind!r} are {n} pressures of {m} coordinates",
                remedy="give a pressure for every coordinate, or, of more muscles, their "
                "directions",
            )
        if self.drive and m == n:
            raise ModelError(
                f"{self.kind!r} has a drive, and no more muscles than coordinates",
                remedy="leave it out: their pressures follow from the coordinates",
            )
        widths = {
            "springs": (m, (1 + n_x * self.degree) * (1 + m)),
            "elasticity": (n, len(self.elasticity[0]) if self.elasticity else 0),
            "areas": (n, max(len(self.areas[0]) if self.areas else 0, 1)),
            "friction": (n, len(self.limits)),
            "relaxation": (n, len(self.lags)),
            "loads": (m, self.n_loads),
            "hull": (n, 2),
        }
        if self.obstacles:
            widths["obstacles"] = (m, self.n_obstacles * (3 + n_x))
        if self.directions:
            widths["directions"] = (n, m)
        if self.drive:
            widths["drive"] = (n, max(len(self.drive[0]), 1 + m))
        if self.known:
            widths["known"] = (len(self.scheduled), 2)
        for name, (count, width) in widths.items():
            table = getattr(self, name)
            if len(table) != count or any(len(row) != width for row in table):
                raise ModelError(
                    f"{name} of {self.kind!r} has rows of {[len(row) for row in table]}",
                    remedy=f"give {count} rows of {width}",
                )
        optional = ("lines", "bladders", "pushes", "mass")
        lengths = dict.fromkeys(("damping", "walls", *optional), n) | {"friction_slopes": n_x}
        for name, count in lengths.items():
            values = getattr(self, name)
            if len(values) != count and (values or name in ("damping", "walls")):
                raise ModelError(
                    f"{name} of {self.kind!r} has {len(values)} entries", remedy=f"give {count}"
                )

    def _check_physics(self) -> None:
        """Raise an error for numbers that would generate energy or have no meaning."""
        if self.pressure_range is not None and not self.pressure_range[0] < self.pressure_range[1]:
            raise ModelError(
                f"pressure_range of {self.kind!r} is {self.pressure_range}",
                remedy="the lower end first",
            )
        at_rest = [row[0] for row in self.areas]
        positive = {"limits": self.limits, "lags": self.lags, "areas at rest": at_rest}
        for name, values in positive.items():
            rises = name != "limits" or all(a < b for a, b in pairwise(values))
            if any(not value > 0 for value in values) or not rises:
                raise ModelError(
                    f"{name} of {self.kind!r} are {values}",
                    remedy=f"give positive ones{', in increasing order' if name == 'limits' else ''}",
                )
        stiffnesses = np.reshape(self.obstacles, (-1, 3 + self.n_schedules))[:, 2:]
        named = {name: getattr(self, name) for name in NOT_NEGATIVE} | {"obstacles": stiffnesses}
        for name, values in named.items():
            if any(value < 0 for value in np.ravel(values)):
                raise ModelError(
                    f"{name} of {self.kind!r} has a number below 0, which would generate energy",
                    remedy="give none below 0",
                )
        if self.mass and self.pushes:
            raise ModelError(
                f"{self.kind!r} has mass and muscles that go slack",
                remedy="give one of mass and pushes",
            )
        if self.held and self.tare:
            raise ModelError(
                f"{self.kind!r} has a tare and starts held",
                remedy="give one of tare and held",
            )
        if any(not low < high for low, high in self.hull):
            raise ModelError(f"hull of {self.kind!r} is {self.hull}", remedy="lower ends first")

    def equations(self) -> tuple[str, ...]:
        """Return the force balance with the terms of this model, then area and elasticity."""
        schedules, y = self.n_schedules > 0, "q" if self.directions else "y"
        springs = rf"\sum_j S_{{kj}} {y}_j"
        if schedules:
            springs = rf"\sum_q x^q \left(S_{{kq0}} + \sum_j S_{{kqj}} {y}_j\right)"
        on_coordinates = {
            r"\sum_l C_{kl} F_l": any(map(any, self.loads)),
            springs if schedules else rf"S_{{k0}} + {springs}": True,
            rf"\sum_i o_{{ki3}} \left[{y}_k - o_{{ki2}}\right]_{{o_{{ki1}}}}": bool(self.obstacles),
        }
        of_muscles = {
            "E_k(y_k)": True,
            r"\sum_m h_{km} s_{km}": any(map(any, self.friction)),
            r"\sum_l \kappa_{kl} q_{kl}": any(map(any, self.relaxation)),
            r"d_k \dot{y}_k": any(self.damping),
            r"l_k \left(\frac{A_k}{a_{k0}}\right)^2 \dot{y}_k": any(self.lines),
            r"m_k \ddot{y}_k": any(self.mass),
        }
        outer, inner = (
            " + ".join(term for term, there in terms.items() if there)
            for terms in (on_coordinates, of_muscles)
        )
        balance: tuple[str, ...] = (f"p_k A_k(y_k) = {outer} + {inner}",)
        if self.directions:
            pulls = (
                rf"\sum_k W_{{kj}} \left(p_k A_k(y_k) - R_k\right) = {outer.replace('_k', '_j')}"
            )
            balance = (pulls, rf"R_k = {inner},\quad y_k = \sum_j W_{{kj}} q_j")
        limit = "r_m (p_k + p_0" + (r" + \sum_i g_i x_i)" if any(self.friction_slopes) else ")")
        ends = (
            rf"\pm {limit}"
            if self.asymmetry is None
            else rf"{limit}, \text{{down to }} -\rho {limit}"
        )
        memory = {
            rf"s_{{km}} \text{{ follows }} y_k + w_k p_k \text{{ up to }} {ends}": self.limits,
            r"\dot{q}_{kl} = \dot{y}_k - q_{kl} / \tau_l": self.lags,
        }
        remembered = r",\quad ".join(line for line, numbers in memory.items() if numbers)
        return tuple(line for line in (*balance, *self.formulas, remembered) if line)

    @property
    def n_loads(self) -> int:
        """Number of loads: the last scheduling inputs."""
        return len(self.loads[0]) if self.loads else 0

    @property
    def n_schedules(self) -> int:
        """Number of inputs that schedule springs: the first ones."""
        return len(self.scheduled) - self.n_loads

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
    def n_obstacles(self) -> int:
        """Number of obstacles per coordinate."""
        return len(self.obstacles[0]) // (3 + self.n_schedules) if self.obstacles else 0

    @property
    def rate_dependent(self) -> bool:  # type: ignore[override]
        """Whether there is relaxation, damping or mass."""
        return bool(self.lags) or any(self.damping) or any(self.lines) or any(self.mass)

    @property
    def n_states(self) -> int:
        """States: coordinates, tare; stretch, stops, lags, moves of muscles; start, failed samples."""
        own = 1 + len(self.limits) + len(self.lags) + (2 if self.mass else 0)
        return len(self.given) * own + 2 * len(self.driven) + 2

    @property
    def n_scratch(self) -> int:
        """Scratch: coordinates, pressures, four vectors and a matrix, terms and shares of a muscle."""
        n, m, row = len(self.given), len(self.driven), (self.elasticity, self.areas)
        terms = 4 + sum(len(table[0]) for table in row) + len(self.limits) + len(self.lags)
        return 3 * n + 5 * m + m * m + 2 * terms + (n * n + n * m + m if self.drive else 0)

    def coefficients(self, sample_time: float | None) -> Array:
        """Return the coefficients described in `mckibben.blocks.coupled.balance_law`.

        Raises
        ------
        ModelError
            Of a model that depends on rate, without a sample time.
        """
        step = needs_sample_time(self.kind, sample_time) if self.rate_dependent else np.inf
        n, m, n_x = len(self.given), len(self.driven), self.n_schedules
        low, high = self.pressure_range or (-np.inf, np.inf)
        middle, ways = np.split(np.reshape(self.drive, (n, -1)), [1], axis=1)
        head = [
            *(n, m, n_x, self.degree, self.n_loads, len(self.limits), len(self.lags)),
            *(len(self.elasticity[0]), len(self.areas[0]), self.n_obstacles, self.scale),
            *(
                self.friction_offset,
                self.asymmetry or 1.0,
                low,
                high,
                1.0 / step,
                self.tare,
                not self.settled,
            ),
            *(bool(self.mass), self.preload, bool(self.directions), ways.shape[1], self.held),
        ]
        lags = np.array(self.lags)
        gains = lags / step * -np.expm1(-step / lags)
        shared = (
            head,
            self.limits,
            np.exp(-step / lags),
            gains,
            self.friction_slopes or n_x * (0.0,),
            *((middle.ravel(), (ways @ ways.T).ravel()) if self.drive else ()),
        )
        obstacles = self.obstacles or m * ((),)
        tables = zip(self.springs, self.loads, obstacles, strict=True)
        none = n * (0.0,)
        columns = (self.walls, self.pushes or n * (NEVER,))
        dynamic = (self.damping, self.lines or none, self.mass or none, self.bladders or none)
        own = (
            *(self.hull, np.transpose(columns), self.moves, np.transpose(dynamic)),
            *(self.elasticity, self.areas, self.friction, self.relaxation),
        )
        flat = np.hstack([np.reshape(table, (n, -1)) for table in own])
        return np.concatenate([*shared, *(np.concatenate(row) for row in tables), flat.ravel()])

    @cached_property
    def known_inputs(self) -> Array:
        """Ranges of coordinates, and of what schedules and loads."""
        scheduled = np.reshape(self.known, (-1, 2)) if self.known else unknown(len(self.scheduled))
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
        return learnable_balance(self)

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
        moved, driving = self.driven[0].unit, self.given[0].unit
        force = driving if self.areas[0][0] == 1.0 else "N"
        if field in ("springs", "obstacles"):
            width, degree = (1 + len(self.driven), self.degree) if field == "springs" else (1, 1)
            place = index[-1] if field == "springs" else index[-1] % (3 + self.n_schedules) - 2
            if place < 0:
                return moved if place == -1 else ""
            power, to = divmod(place, width)
            below = moved * (to > 0 or field == "obstacles")
            if power > 0:
                by, order = divmod(power - 1, degree)
                raised = f"{self.scheduled[by].unit}^{order + 1}".replace("^1", "")
                below += f"{' ' if below else ''}{raised}"
            return f"{force}/{below}" if below else force
        if field == "loads":
            return f"{force}/{self.scheduled[index[-1] - self.n_loads].unit}"
        if field == "friction_slopes":
            return f"{driving}/{self.scheduled[index[-1]].unit}"
        units = {"N": force, "mm": moved, "bar": driving}
        declared = super().unit_of(field, index) or ""
        return re.sub(r"\b(N|mm|bar)\b", lambda unit: units[unit[0]], declared)

    def name_of(self, field: str, index: tuple[int, ...]) -> str:
        """Return the label of a parameter: its muscle, channel, and scheduling input."""
        if field in ("friction_offset", "asymmetry"):
            return field.replace("_", " ")
        on = self.driven if field in ("springs", "loads", "obstacles") else self.given
        whose = "coordinate" if self.directions and on is self.driven else "muscle"
        of = f" of {whose} {index[0] + 1}" if len(on) > 1 else ""
        if field in ONE_EACH:
            return f"{ONE_EACH[field]}{of}"
        place = index[-1]
        if field == "friction_slopes":
            return f"friction offset by {self.scheduled[place].name}"
        if field == "springs":
            power, to = divmod(place, 1 + len(on))
            name = f"{'constant force' if to == 0 else 'spring'}{of}"
            name += f" to {whose} {to}" if to not in (0, index[0] + 1) else ""
            if power == 0:
                return name
            of_scheduled, degree = divmod(power - 1, self.degree)
            return (
                f"{name} by {self.scheduled[of_scheduled].name}{f'^{degree + 1}' if degree else ''}"
            )
        if field == "loads":
            return f"share{of} of {self.scheduled[place - self.n_loads].name}"
        if field == "obstacles":
            number, place = divmod(place, 3 + self.n_schedules)
            by = f" by {self.scheduled[place - 3].name}" if place > 2 else ""
            what = ("side", "place", "stiffness")[min(place, 2)]
            return f"{what} of obstacle {number + 1}{of}{by}"
        if field in ("friction", "relaxation"):
            return f"{'stop' if field == 'friction' else field} {place + 1}{of}"
        if field == "areas" and place == 0:
            return f"area{of} at rest"
        raised = f"^{place + 2 * (field == 'elasticity')}".replace("^1", "")
        return f"{'area' if field == 'areas' else field}{of} by displacement{raised}"

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
            limits=(0.5, 2.0),
            friction_offset=0.5,
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


NOT_NEGATIVE = (
    *(
        "friction",
        "relaxation",
        "damping",
        "walls",
        "lines",
        "friction_offset",
        "bladders",
        "pushes",
        "mass",
    ),
    "friction_slopes",
)
"""Fields of non-negative numbers."""

ONE_EACH = {
    "damping": "damping",
    "lines": "resistance of the line",
    "walls": "stretch of the wall",
    "bladders": "spring of the bladder",
    "pushes": "force of slackening",
    "mass": "mass",
}
"""Fields with one number per muscle, and their labels."""


class Placed(NamedTuple):
    """A balance, its direction in the model, and the parts before and after it."""

    balance: Balance
    solved: bool
    before: tuple[Block, ...]
    behind: tuple[Block, ...]


def balance_in(model: Block) -> Placed | None:
    """Return the balance of a model, compensator or inverse; None if it has none."""
    parts = model.parts if isinstance(model, Series) else (model,)
    for place, part in enumerate(parts):
        solved = isinstance(part, Inverse)
        balance = part.forward if isinstance(part, Inverse) else part
        if isinstance(balance, Balance):
            return Placed(balance, solved, parts[:place], parts[place + 1 :])
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
