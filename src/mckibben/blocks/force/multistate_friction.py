"""Multistate friction: elasto-plastic elements with different parameters per direction.

With the rate v of the length, every element has a deflection x_i and numbers k, sigma and F_c that
switch with the sign of v: x_i' = [sat(F_c, k x_i + sigma v) - k x_i] / sigma,  f = sum_i sat(F_c, k
x_i + sigma v).

Source: "A Multistate Friction Model for the Compensation of the Asymmetric Hysteresis in the
Mechanical Response of Pneumatic Artificial Muscles", Eqs. (4) and (5). Its model of eleven
parameters has one element in both directions with one stiffness, and two that act while the muscle
shortens; that of eighteen has three in both directions.

k / sigma is thousands per second, so nothing is stepped: over a sample v is constant, and while an
element sticks x grows with v, while it slips x tends to F_c / k as an exponential, and the time at
which one ends is in closed form. An element that acts in one direction only is unloaded by
motion in the other: its spring goes back with the length until it is slack, and its force with it. (The
paper leaves this open.) To the letter of Eq. (5) such an element has F_c = 0 there, so that Eq. (4) lets
its spring go at once and the force jumps at every reversal: that is "shortening-released".

Ours: friction may grow in proportion to pressure, f (1 + pressure_gain (p - reference));
pressure_gain 0 is the paper's model.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field, FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks import fields
from mckibben.blocks.base import Block
from mckibben.blocks.force.laws import ForceByLength
from mckibben.blocks.kernels import accumulate, kernel, step
from mckibben.blocks.parameters import one_per
from mckibben.blocks.sample_times import needs_sample_time
from mckibben.errors import ModelError

Direction = Literal["shared", "both", "lengthening", "shortening", "shortening-released"]
WAYS = ("lengthening", "shortening")
QUANTITIES = ("k [N/mm]", "sigma [N s/mm]", "F_c [N]")
"""Parameters of an element in one direction; lengthening first, then shortening."""

PARAMETER_POSITIONS: dict[Direction, tuple[int, ...]] = {
    "shared": (0, 1, 2, 4, 5),
    "both": (0, 1, 2, 3, 4, 5),
    "lengthening": (0, 1, 2),
    "shortening": (3, 4, 5),
    "shortening-released": (3, 4, 5),
}
"""Which of these six parameters an element has. A direction without its own takes k and sigma of
the other direction, and no F_c.
"""

LET_GO = 1e-30
"""F_c of a released element where it is inactive [N]: as good as none, where 0 marks unloaded ones."""

SIZES = {element: len(places) for element, places in PARAMETER_POSITIONS.items()}
ELEVEN: tuple[Direction, ...] = ("shared", "shortening", "shortening")
EACH_WAY: tuple[Direction, ...] = ("shared", "lengthening", "shortening")
RELEASED: tuple[Direction, ...] = ("shared", "shortening-released", "shortening-released")
EIGHTEEN: tuple[Direction, ...] = ("both", "both", "both")


@kernel
def deflected(x: float, v: float, time: float, k: float, sigma: float, limit: float) -> float:
    """Return the deflection after a time at a constant rate v >= 0."""
    if k * x + sigma * v < -limit:
        # slipping backwards: the spring relaxes to where it sticks
        excess = -(k * x + limit)
        if v == 0.0:
            return -limit / k - excess / k * math.exp(-k * time / sigma)
        needed = sigma / k * math.log(excess / (sigma * v))
        if needed >= time:
            return -limit / k - excess / k * math.exp(-k * time / sigma)
        time -= needed
        x = -(limit + sigma * v) / k
    if k * x + sigma * v <= limit:
        if v == 0.0:
            return x
        needed = ((limit - sigma * v) / k - x) / v
        if needed >= time:
            return x + v * time
        time -= needed
        x += v * needed
    return limit / k + (x - limit / k) * math.exp(-k * time / sigma)


@kernel
def sticking(x: float, v: float, k: float, sigma: float, limit: float) -> float:
    """Return the remaining sticking time of an element at a constant rate v >= 0."""
    if not -limit <= k * x + sigma * v <= limit:
        return 0.0
    return ((limit - sigma * v) / k - x) / v if v > 0.0 else math.inf


STEP, GAIN, REFERENCE, LENGTHENING, SHORTENING = 0, 1, 2, 3, 6
"""Places of the coefficients: sample time, pressure gain and reference, the first element's."""


@step
def multistate_friction_step(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
) -> None:
    """Run the elements; the state is [deflections, previous length].

    For every element coefficients are k, sigma and F_c lengthening, k, sigma and F_c shortening;
    F_c = 0 where it does not act.
    """
    n = state.size - 1
    step = coefficients[STEP]
    v = (inputs[0] - state[n]) / step
    state[n] = inputs[0]
    first = LENGTHENING if v >= 0.0 else SHORTENING
    other = SHORTENING if v >= 0.0 else LENGTHENING
    sign = 1.0 if v >= 0.0 else -1.0
    force = 0.0
    for i in range(n):
        place = first + 6 * i
        limit = coefficients[place + 2]
        if limit == 0.0:
            x = state[i] + v * step
            state[i] = min(x, 0.0) if sign > 0.0 else max(x, 0.0)
            force += coefficients[other + 6 * i] * state[i]
            continue
        k, sigma = coefficients[place], coefficients[place + 1]
        if sticking(sign * state[i], sign * v, k, sigma, limit) >= step:
            state[i] = accumulate(state[i], v * step, scratch, i)
        else:
            state[i] = sign * deflected(sign * state[i], sign * v, step, k, sigma, limit)
            scratch[i] = 0.0
        force += min(max(k * state[i] + sigma * v, -limit), limit)
    grown = 1.0 + coefficients[GAIN] * (inputs[1] - coefficients[REFERENCE])
    outputs[0] = force * grown


@kernel
def multistate_friction_start(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, virgin: bool
) -> None:
    """Start as if the length had only increased, or with zero deflections."""
    n = state.size - 1
    for i in range(n):
        k, limit = coefficients[3 + 6 * i], coefficients[5 + 6 * i]
        state[i] = 0.0 if virgin else limit / k
        scratch[i] = 0.0
    state[n] = inputs[0]


@dataclass(frozen=True, config=fields.STRICT)
class MultistateFriction(ForceByLength, Block):
    """Friction force by length, with elements that switch with the direction of motion.

    Parameters
    ----------
    elements : sequence of {"shared", "both", "lengthening", "shortening", "shortening-released"}
        What each element is: in both directions with one stiffness, in both with two, or in one
        only, unloaded by motion in the other or released at once.
    values : sequence of float
        For every element, in order, its positive numbers: k [N/mm], sigma [N s/mm] and F_c [N]
        lengthening, then shortening; "shared" leaves the second k out.
    pressure_gain : float
        Growth of friction with pressure [1/bar]; 0 as in the paper.
    reference_pressure : float
        Pressure at which the values hold [bar].
    initial : {"first_sample", "virgin"} or sequence of float
        Default memory before the first sample: as if the length had only grown, or nothing
        deflected.
    """

    kind = "multistate-friction"
    ports = ("input",), ("pressure",), ("output",)
    kernel = multistate_friction_step
    start_kernel = multistate_friction_start
    rate_dependent = True
    typical = (  # of eleven parameters, as the paper prints it
        ELEVEN,
        (
            *(18.214, 4.987e-3, 128.795, 3.982e-3, 103.096),
            *(34.738, 1.006e-3, 13.431, 1e-4, 0.988e-3, 1.256),
        ),
    )
    no_inverse = "has no inverse: while it slips, one force belongs to many lengths"
    instead = "compensate it by ForceFeedforward(law, friction), in closed form"
    n_states = one_per("elements", 1)  # deflections, and the previous length
    n_scratch = one_per("elements")  # what single precision loses of the deflections
    formulas = (
        r"f = \left(1 + g_p (p - p_r)\right) \sum_i \operatorname{sat}(F_{c,i},\, k_i x_i "
        r"+ \sigma_i \dot{l})",
        r"\dot{x}_i = \frac{\operatorname{sat}(F_{c,i},\, k_i x_i + \sigma_i \dot{l}) - "
        r"k_i x_i}{\sigma_i},\quad k_i, \sigma_i, F_{c,i} = \begin{cases} k_i^{+}, "
        r"\sigma_i^{+}, F_{c,i}^{+} & \dot{l} > 0 \\ k_i^{-}, \sigma_i^{-}, F_{c,i}^{-} & \dot{l} "
        r"\le 0 \end{cases}",
    )

    elements: Annotated[tuple[Direction, ...], BeforeValidator(fields.plain_sequence)]
    values: Annotated[fields.PositiveVector, "k_i"]
    pressure_gain: Annotated[FiniteFloat, "g_p [1/bar]"] = 0.0
    reference_pressure: Annotated[FiniteFloat, "p_r [bar]"] = 0.0
    initial: fields.StoredInitial = Field(default="first_sample", kw_only=True)

    def __post_init__(self) -> None:
        n_values = sum(SIZES[element] for element in self.elements)
        if not self.elements or len(self.values) != n_values:
            raise ModelError(
                f"{self.kind!r} with the elements {', '.join(self.elements) or 'none'} "
                f"has {len(self.values)} values",
                remedy=f"give {n_values} positive ones",
            )

    @property
    def parameters(self) -> tuple[str, ...]:  # type: ignore[override]
        """The values, and the pressure gain if there is one."""
        return ("values", "pressure_gain") if self.pressure_gain != 0 else ("values",)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Element, direction, quantity and unit of every value."""
        names = [
            f"element {number}{f', {WAYS[way]}' if way >= 0 else ''}: {QUANTITIES[place]}"
            for number, way, place in self._values()
        ]
        return (*names, "pressure gain [1/bar]") if self.pressure_gain != 0 else tuple(names)

    def symbol_of(self, field: str, index: tuple[int, ...]) -> str:
        """Return the symbol of a number: a value has its element, and its direction if it has one."""
        if field != "values":
            return super().symbol_of(field, index)
        number, way, place = self._values()[index[0]]
        letter = (f"k_{{{number}}}", rf"\sigma_{{{number}}}", f"F_{{c,{number}}}")[place]
        return letter + ("", "^{+}", "^{-}")[way + 1]

    def unit_of(self, field: str, index: tuple[int, ...]) -> str | None:
        """Return the unit of a number."""
        if field != "values":
            return super().unit_of(field, index)
        return QUANTITIES[self._values()[index[0]][2]].partition("[")[2].rstrip("]")

    def _values(self) -> list[tuple[int, int, int]]:
        """Return element, direction (-1 for both) and quantity of every value."""
        return [
            (number, -1 if element == "shared" and place == 0 else place // 3, place % 3)
            for number, element in enumerate(self.elements, start=1)
            for place in PARAMETER_POSITIONS[element]
        ]

    def table(self) -> Array:
        """Return k, sigma and F_c lengthening and shortening, shape (n, 6), F_c 0 where unloaded."""
        table, values = np.full((len(self.elements), 6), np.nan), iter(self.values)
        for row, element in zip(table, self.elements, strict=True):
            for place in PARAMETER_POSITIONS[element]:
                row[place] = next(values)
        other = np.roll(table, 3, axis=1)
        released = [element.endswith("released") for element in self.elements]
        other[:, [2, 5]] = np.where(released, LET_GO, 0.0)[:, np.newaxis]
        return np.where(np.isnan(table), other, table)

    def by_strength(self) -> tuple[Self, list[int]]:
        """Return the same friction with elements sorted by falling F_c, and the permutation of values.

        The order of such elements has no effect; so two fits can be compared value by value.
        """
        ends = np.cumsum([SIZES[element] for element in self.elements]).tolist()
        groups = [[*range(end - SIZES[e], end)] for e, end in zip(self.elements, ends, strict=True)]
        ranked = sorted(range(len(groups)), key=lambda place: -self.values[groups[place][-1]])
        by_kind = {kind: iter([p for p in ranked if self.elements[p] == kind]) for kind in SIZES}
        order = [value for kind in self.elements for value in groups[next(by_kind[kind])]]
        return replace(self, values=tuple(self.values[place] for place in order)), order

    def coefficients(self, sample_time: float | None) -> Array:
        """Return [sample time, pressure gain, reference pressure, table]."""
        step = needs_sample_time(self.kind, sample_time)
        return np.array([step, self.pressure_gain, self.reference_pressure, *self.table().ravel()])
