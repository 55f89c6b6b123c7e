"""Muscles in parallel under load as a balance of forces that is the minimum of a convex energy.

What a muscle's pressure gives over its effective area holds its load, springs (its own and those that
couple muscles, which stiffen with whatever schedules them), its rubber's elasticity, friction of the
braid, relaxation, damping and inertia; what has to push harder than it can goes slack. The equation is
that of `mckibben.blocks.coupled.balance_law`. A load enters once. Springs are symmetric, what rubs and
relaxes is not negative, areas outweigh friction, and stiffness what areas lose, as identification sees
to: then pressures hold muscles in one place only, which is found, and friction never makes energy.

This block gives pressures for displacements, explicitly: the compensator. Its inverse gives
displacements for pressures. `mckibben.blocks.coupled.load_estimate` gives loads for both.

The form is this package's own. Friction that breaks away after a travel follows "A Multistate Friction
Model for the Compensation of the Asymmetric Hysteresis in the Mechanical Response of Pneumatic
Artificial Muscles"; areas and springs that couple follow what muscles in parallel do (paper A).
"""

from __future__ import annotations

import re
from typing import Annotated, ClassVar, Self

import numpy as np
from annotated_types import Gt, Interval
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import SEVERAL, Cost, Ports, Start, needs_sample_time
from mckibben.blocks.coupled.balance_fields import check_fields, number_name, tell_clipped
from mckibben.blocks.coupled.balance_law import (
    NEARLY,
    NEVER,
    begin,
    keep,
    press,
    settle,
    start_balance,
)
from mckibben.blocks.coupled.balance_learning import learnable_balance
from mckibben.blocks.coupled.balance_terms import AT_REST, FROM_REST, IN_TIME
from mckibben.blocks.fields import STRICT, Channel, Channels, Rows, Vector
from mckibben.blocks.inverse import Invertible
from mckibben.blocks.kernels import Step, kernel, step
from mckibben.blocks.learning import Learnable
from mckibben.blocks.notation import Notation
from mckibben.blocks.solving import newton_cost


@step
def balance_step(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
) -> None:
    """Give pressures; the last state counts samples that muscles cannot reach."""
    press(coefficients, state, scratch, inputs, outputs)


@step
def balance_inverse_step(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
) -> None:
    """Give displacements; the last state counts samples that were not solved."""
    c = coefficients
    n, n_x = int(c[0]), int(c[1]) + int(c[3])
    y, tare = scratch[:n], state[state.size - 2 - n :]
    p, x = inputs[:n], inputs[n : n + n_x]
    for k in range(n):
        y[k] = state[k]
    way = FROM_REST if state[state.size - 2] != 0.0 else IN_TIME
    left = settle(c, state, way, y, x, p, scratch[2 * n :])
    keep(c, state, way, y, p)
    state[state.size - 2] = 0.0
    for k in range(n):
        outputs[k] = y[k] - tare[k]
    if not left < NEARLY:
        state[state.size - 1] += 1.0


@kernel
def balance_inverse_start(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, virgin: bool
) -> None:
    """Start muscles at rest without pressure, or where the first pressures hold them."""
    c = coefficients
    n, n_x = int(c[0]), int(c[1]) + int(c[3])
    p, x = inputs[:n], inputs[n : n + n_x]
    begin(c, state, x, scratch[:n], scratch[n:])
    if virgin:
        y = scratch[:n]
        for k in range(n):
            y[k] = state[k]
        settle(c, state, AT_REST, y, x, p, scratch[2 * n :])
        keep(c, state, AT_REST, y, p)
        state[state.size - 2] = 0.0


@dataclass(frozen=True, config=STRICT)
class Balance(Invertible):
    """From displacements of n muscles, and what schedules and loads them, to their pressures.

    Forces are in N, or, of a model that knows no force, in bar on muscle 1's area at rest.

    Parameters
    ----------
    springs : sequence of n sequences of float
        A constant force [N], then springs to all displacements [N/mm], of every muscle and for
        every power of what schedules.
    elasticity : sequence of n sequences of float
        Coefficients of (y / scale)^2 and up [N].
    areas : sequence of n sequences of float
        Coefficients of (y / scale)^0 and up [N/bar]; the first is positive.
    friction : sequence of n sequences of float
        Stiffness of the stops of every muscle [N/mm], not negative.
    relaxation : sequence of n sequences of float
        Stiffness of what relaxes, of every muscle [N/mm], not negative.
    loads : sequence of n sequences of float
        How much of every load pulls at a muscle, usually 1.
    damping : sequence of n float
        Force by velocity [N s/mm], not negative.
    lines : sequence of n float, optional
        The same by the resistance of the line to what flows into a muscle: at rest, and elsewhere with
        the square of its area. Default none.
    walls : sequence of n float
        Stretch of the wall by pressure, which friction feels at held length too [mm/bar].
    limits : sequence of m float
        Travel at which every stop breaks away, of pressure above that at which it holds nothing
        [mm/bar], increasing.
    grip : float
        Pressure below zero at which stops hold nothing [bar]; they break away at ``limits (p + grip)``.
    lags : sequence of float
        Time constants of what relaxes [s].
    hull : sequence of n pairs of float
        Displacements known [mm]; beyond, elasticity and area go on straight.
    scale : float
        Of polynomials [mm].
    degree : int
        Highest power of what schedules.
    driven, scheduled, given : sequence of Channel
        Displacements; what schedules, then the loads; pressures.
    bladders : sequence of n float
        Of every muscle that can go slack, the spring of its own [N/mm], not negative; none for muscles
        that cannot, whose own springs are among ``springs``.
    pushes : sequence of n float
        Force at which each goes slack [N], not negative.
    tare : bool
        Whether displacements count from where the muscles rested, without pressure, at the start.
    settled : bool
        Whether the muscles have long been where the first sample finds them, so that nothing relaxes
        any more; else they have come there just now.
    pressure_range : (float, float), optional
        Pressures are clipped to it, and said so.
    mass : sequence of n float, optional
        Force by acceleration [N s^2/mm], not negative; none by default.
    known : sequence of pairs of float
        Lowest and highest of all that scheduled and loaded it where it was identified, if known.
    """

    kind: ClassVar[str] = "balance"
    ports: ClassVar[Ports] = SEVERAL
    kernel: ClassVar[Step] = balance_step
    start_kernel: ClassVar[Start] = start_balance
    inverse_kernel: ClassVar[Step] = balance_inverse_step
    inverse_start_kernel: ClassVar[Start] = balance_inverse_start
    inverse_path_dependent: ClassVar[bool] = True
    increasing = ("limits",)
    parameters: ClassVar[tuple[str, ...]] = (
        *("springs", "elasticity", "areas", "friction", "relaxation", "loads"),
        *("damping", "lines", "walls", "grip", "bladders", "pushes", "mass"),
    )
    notation: ClassVar[Notation] = Notation(
        r"A_k(y) = \sum_i a_{ki} (y / L)^i,\quad E_k(y) = b_k y + \sum_{i \ge 2} e_{ki} "
        "(y / L)^i",
        springs="S_{ki}",
        elasticity="e_{ki} from 2 [N]",
        areas="a_{ki} from 0 [N/bar]",
        friction="h_{km} [N/mm]",
        relaxation=r"\kappa_{kl} [N/mm]",
        loads="C_{kl}",
        damping="d_k [N s/mm]",
        lines="l_k [N s/mm]",
        walls="w_k [mm/bar]",
        limits="r_m [mm/bar]",
        grip="p_0 [bar]",
        lags=r"\tau_l [s]",
        scale="L [mm]",
        bladders="b_k [N/mm]",
        pushes="P_k [N]",
        mass="m_k [N s^2/mm]",
        driven="y_i",
        given="p_i",
    )

    springs: Rows
    elasticity: Rows
    areas: Rows
    friction: Rows
    relaxation: Rows
    loads: Rows
    damping: Vector
    walls: Vector
    limits: Vector
    grip: FiniteFloat
    lags: Vector
    hull: Rows
    scale: Annotated[FiniteFloat, Gt(0)]
    degree: Annotated[int, Interval(ge=1, le=4)]
    driven: Channels
    scheduled: Channels
    given: Channels
    lines: Vector = ()
    bladders: Vector = ()
    pushes: Vector = ()
    tare: bool = False
    settled: bool = False
    pressure_range: tuple[FiniteFloat, FiniteFloat] | None = None
    mass: Vector = ()
    known: Rows = ()

    def __post_init__(self) -> None:
        self.check_channels()
        check_fields(self)

    def equations(self) -> tuple[str, ...]:
        """Return the balance of forces, without what this one lacks; then area and elasticity."""
        springs = r"S_{k0} + \sum_j S_{kj} y_j"
        if len(self.scheduled) > self.n_loads:
            springs = r"\sum_q x^q \left(S_{kq0} + \sum_j S_{kqj} y_j\right)"
        terms = {
            r"\sum_l C_{kl} F_l": any(map(any, self.loads)),
            springs: True,
            "E_k(y_k)": True,
            r"\sum_m h_{km} s_{km}": any(map(any, self.friction)),
            r"\sum_l \kappa_{kl} q_{kl}": any(map(any, self.relaxation)),
            r"d_k \dot{y}_k": any(self.damping),
            r"l_k \left(\frac{A_k}{a_{k0}}\right)^2 \dot{y}_k": any(self.lines),
            r"m_k \ddot{y}_k": any(self.mass),
        }
        memory = {
            r"s_{km} \text{ follows } y_k + w_k p_k \text{ up to } \pm r_m (p_k + p_0)": self.limits,
            r"\dot{q}_{kl} = \dot{y}_k - q_{kl} / \tau_l": self.lags,
        }
        remembered = r",\quad ".join(line for line, numbers in memory.items() if numbers)
        forces = " + ".join(term for term, there in terms.items() if there)
        lines = (f"p_k A_k(y_k) = {forces}", *self.notation.equations, remembered)
        return tuple(line for line in lines if line)

    @property
    def n_loads(self) -> int:
        """How many of the scheduling inputs are loads: the last ones."""
        return len(self.loads[0])

    @property
    def rate_dependent(self) -> bool:  # type: ignore[override]
        """Whether anything relaxes, damps or is heavy."""
        return bool(self.lags) or any(self.damping) or any(self.lines) or any(self.mass)

    @property
    def n_states(self) -> int:
        """Displacements, stretches, stops, lags, moves and tare of muscles; a start, samples amiss."""
        own = 3 + len(self.limits) + len(self.lags) + (2 if self.mass else 0)
        return len(self.driven) * own + 2

    @property
    def n_scratch(self) -> int:
        """Displacements, pressures, four vectors and a matrix."""
        n = len(self.driven)
        return n * (n + 6)

    def coefficients(self, sample_time: float | None) -> Array:
        """Return what `mckibben.blocks.coupled.balance_law` says.

        Raises
        ------
        ModelError
            Of a model that depends on rate, without a sample time.
        """
        step = needs_sample_time(self.kind, sample_time) if self.rate_dependent else np.inf
        low, high = self.pressure_range or (-np.inf, np.inf)
        head = [
            *(len(self.driven), len(self.scheduled) - self.n_loads, self.degree, self.n_loads),
            *(len(self.limits), len(self.lags), len(self.elasticity[0]), len(self.areas[0])),
            *(self.scale, self.grip, low, high, 1.0 / step),
            *(self.tare, not self.settled, bool(self.mass)),
        ]
        lags = np.array(self.lags)
        decays = np.exp(-step / lags)
        gains = lags / step * -np.expm1(-step / lags)
        tables = [self.springs, self.elasticity, self.areas]
        tables += [self.friction, self.relaxation, self.loads]
        n = len(self.driven)
        never, none = n * (NEVER,), n * (0.0,)
        single = [self.walls, self.pushes or never, self.damping]
        single += [self.lines or none, self.bladders or none, self.mass or none]
        own = [
            np.concatenate([self.hull[k], [t[k] for t in single], *(t[k] for t in tables)])
            for k in range(n)
        ]
        return np.concatenate([head, self.limits, decays, gains, *own])

    def report(self, state: Array) -> None:
        """Warn of references that would need pressures out of range, or muscles that push."""
        pushing = " or muscles to push harder than they can," if self.pushes else ""
        tell_clipped(state[-1], self.given, self.pressure_range, pushing)

    def n_clipped(self, state: Array) -> int:
        """Return how many samples needed pressures out of range."""
        return int(state[-1]) if state[-1] > 0 else 0

    solved: ClassVar[bool] = True

    @property
    def learnable(self) -> Learnable:
        """Forces and factors of every muscle."""
        return learnable_balance(self)

    @property
    def n_inverse_states(self) -> int:
        """As many as this block's, which count already."""
        return self.n_states

    def inverse_complaint(self, state: Array) -> str:
        """Tell of pressures for which no equilibrium was found."""
        return (
            f"{self.kind!r} found no equilibrium in {int(state[-1])} samples: the model was not made "
            "for such pressures"
        )

    def cost(self, sample_time: float | None) -> Cost:
        """Return about six operations a number, for friction is looked at again for its root."""
        operations = 6 * self.coefficients(sample_time).size
        return Cost(operations, 20 * operations)

    def inverse_cost(self, sample_time: float | None) -> Cost:
        """Return what steps of Newton's method cost."""
        return newton_cost(4 * self.coefficients(sample_time).size + len(self.driven) ** 3)

    def unit_of(self, field: str, index: tuple[int, ...]) -> str | None:
        """Return the unit of a number: forces are in N, or, of relative areas, in the input's."""
        moved, driving = self.driven[0].unit, self.given[0].unit
        force = driving if self.areas[0][0] == 1.0 else "N"
        if field == "springs":
            power, place = divmod(index[-1], 1 + len(self.driven))
            by, degree = divmod(power - 1, self.degree)
            below = moved * (place > 0)
            if power > 0:
                below += f"{' ' if below else ''}{self.scheduled[by].unit}^{degree + 1}"
            return f"{force}/{below.replace('^1', '')}" if below else force
        if field == "loads":
            return f"{force}/{self.scheduled[index[-1] - self.n_loads].unit}"
        units = {"N": force, "mm": moved, "bar": driving}
        declared = super().unit_of(field, index) or ""
        return re.sub(r"\b(N|mm|bar)\b", lambda unit: units[unit[0]], declared)

    def name_of(self, field: str, index: tuple[int, ...]) -> str:
        """Return what a number is called: by its muscle, what it acts on, and what schedules it."""
        return number_name(self, field, index)

    @classmethod
    def example(cls) -> Self:
        """Return two muscles beside an extensor, one of them under a load."""
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
            grip=0.5,
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
