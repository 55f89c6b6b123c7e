"""Muscles in parallel as a balance of forces: the pressures that hold an arm where it is.

Every muscle pulls with its pressure times an effective area that falls with its shortening; what
resists are springs that couple the muscles and stiffen with whatever schedules them (an extensor's
pressure, a load), and dry friction in its own braid. Divided by the area, that gives the pressure of
muscle k directly from where the arm is and has been; see its notation, with stop operators s_m,
elastic-plastic friction elements that break away after a travel r_m. This direction, the compensator,
is explicit. The other, from pressures to where the arm goes, is solved by Newton's method in every
sample (its inverse).

The form is this package's own. No estimator gives it any more, `mckibben.blocks.coupled.balance`, which
names the sources, does its work: it is here for files.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, ClassVar, Self

import numpy as np
from annotated_types import Gt, Interval
from numpy.typing import ArrayLike
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import SEVERAL, Cost, Ports, Start
from mckibben.blocks.coupled.balance import tell_clipped
from mckibben.blocks.fields import STRICT, Channel, Channels, Rows, Vector, rows, vector
from mckibben.blocks.inverse import Invertible
from mckibben.blocks.kernels import Step, kernel, step
from mckibben.blocks.notation import Notation
from mckibben.blocks.parameters import parameter_vector
from mckibben.blocks.solving import eliminate, newton_cost
from mckibben.errors import ModelError

ELASTIC, AREA = 3, 3
"""Own elastic terms, y^2 to y^4; terms of the area, y to y^3."""

HEAD = 7
"""Coefficients before the thresholds: n, schedules, degree, thresholds, scale, lowest, highest."""

MOST_STEPS = 60
"""Of Newton's method."""

BALANCED, NEARLY = 4e-16, 1e-13
"""Residual that is an equilibrium, and that is one though not to the last digit."""

HAIR = 1e-9
"""Relative difference of pressures that is rounding."""

SINGLE = {"BALANCED": 1e-6, "NEARLY": 1e-5, "HAIR": 1e-6}

PATH = 40
"""Steps from rest to the first pressures."""


@kernel
def balance(
    c: Array,
    stops: Array,
    y: Array,
    x: Array,
    k: int,
    gradient: Array,
    slopes: Array,
) -> tuple[float, float, float]:
    """Return numerator, denominator and the denominator's slope by y_k, and fill a gradient.

    ``y`` is relative to the scale, ``stops`` of shape (n, m) are every muscle's at y, ``slopes``
    theirs by y; ``gradient`` becomes that of the numerator.
    """
    n, n_x, degree, m = int(c[0]), int(c[1]), int(c[2]), int(c[3])
    n_p = 1 + n_x * degree
    width = n_p * (1 + n) + ELASTIC + m * n_p
    own = HEAD + m + k * (width + AREA + m)
    top, bottom, bottom_slope = 0.0, 1.0, 0.0
    for j in range(n):
        gradient[j] = 0.0
    place = own
    for q in range(n_p):
        power = 1.0
        if q > 0:
            for _ in range((q - 1) % degree + 1):
                power *= x[(q - 1) // degree]
        top += power * c[place]
        for j in range(n):
            gain = power * c[place + 1 + j]
            top += gain * y[j]
            gradient[j] += gain
        place += 1 + n
        friction = own + n_p * (1 + n) + ELASTIC + m * q
        for i in range(m):
            f = power * c[friction + i]
            top += f * stops[k, i]
            gradient[k] += f * slopes[k, i]
    power = y[k]
    for i in range(ELASTIC):
        gradient[k] += (i + 2) * c[place + i] * power
        power *= y[k]
        top += c[place + i] * power
    place = own + width
    power = 1.0
    for i in range(AREA):
        bottom_slope += (i + 1) * c[place + i] * power
        power *= y[k]
        bottom += c[place + i] * power
    for i in range(m):
        bottom += c[place + AREA + i] * stops[k, i]
        bottom_slope += c[place + AREA + i] * slopes[k, i]
    return top, bottom, bottom_slope


@kernel
def strain(c: Array, before: Array, last: Array, y: Array, stops: Array, slopes: Array) -> None:
    """Move the stops from where the arm was, ``last``, to where it is; they are relative to r."""
    n, m = int(c[0]), int(c[3])
    for k in range(n):
        moved = y[k] - last[k]
        for i in range(m):
            r = c[HEAD + i]
            value = before[k * m + i] + moved / r
            slopes[k, i] = 1.0 / r if -1.0 < value < 1.0 else 0.0
            stops[k, i] = min(max(value, -1.0), 1.0)


@step
def force_balance_step(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
) -> None:
    """Give pressures; the state is [last y, stops, samples clipped]."""
    c = coefficients
    n, n_x, m, scale = int(c[0]), int(c[1]), int(c[3]), c[4]
    stops, slopes = scratch[: n * m].reshape((n, m)), scratch[n * m : 2 * n * m].reshape((n, m))
    rest = scratch[2 * n * m :]
    y, gradient = rest[:n], rest[n : 2 * n]
    for j in range(n):
        y[j] = inputs[j] / scale
    strain(c, state[n : n + n * m], state[:n], y, stops, slopes)
    clipped = False
    for k in range(n):
        top, bottom, _ = balance(c, stops, y, inputs[n : n + n_x], k, gradient, slopes)
        p = top / bottom
        limited = min(max(p, c[5]), c[6])
        clipped = clipped or abs(limited - p) > HAIR * (1.0 + abs(p))
        outputs[k] = limited
    for j in range(n):
        state[j] = y[j]
    for k in range(n * m):
        state[n + k] = scratch[k]
    if clipped:
        state[n + n * m] += 1.0


@step
def force_balance_inverse_step(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
) -> None:
    """Solve for where the arm is; the last state counts samples where Newton's method gave up."""
    c = coefficients
    n, n_x, m, scale = int(c[0]), int(c[1]), int(c[3]), c[4]
    stops, slopes = scratch[: n * m].reshape((n, m)), scratch[n * m : 2 * n * m].reshape((n, m))
    rest = scratch[2 * n * m :]
    vectors = rest[: 4 * n].reshape((4, n))
    y, gradient, residual, trial = vectors[0], vectors[1], vectors[2], vectors[3]
    matrix = rest[4 * n : n * (n + 4)].reshape((n, n))
    x = inputs[n : n + n_x]
    for j in range(n):
        y[j] = state[j]
    solved = False
    before = np.inf
    for round_ in range(MOST_STEPS):
        strain(c, state[n : n + n * m], state[:n], y, stops, slopes)
        worst = 0.0
        for k in range(n):
            top, bottom, slope = balance(c, stops, y, x, k, gradient, slopes)
            residual[k] = top - inputs[k] * bottom
            worst = max(worst, abs(residual[k]))
            for j in range(n):
                matrix[k, j] = gradient[j]
            matrix[k, k] -= inputs[k] * slope
        if worst <= BALANCED * (1.0 + abs(inputs[0])) or (worst >= before and worst < NEARLY):
            solved = True
            break
        before = worst
        for k in range(n):
            trial[k] = -residual[k]
        eliminate(matrix, trial)
        far = 0.0
        for k in range(n):
            far = max(far, abs(trial[k]))
        # small steps keep to the branch that the arm is on; halved ones break ties at kinks
        share = min(1.0, 0.1 / far) if far > 0.0 else 1.0
        if round_ > 20:
            share *= 0.5
        for k in range(n):
            y[k] += share * trial[k]
    # halved steps may leave a residual that is still falling, and next to nothing
    if not solved and before >= NEARLY:
        state[n + n * m] += 1.0
    strain(c, state[n : n + n * m], state[:n], y, stops, slopes)
    for j in range(n):
        state[j] = y[j]
        outputs[j] = scale * y[j]
    for k in range(n * m):
        state[n + k] = scratch[k]


@kernel
def force_balance_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start at the first displacements, with friction as if the arm had come from 0, or unloaded."""
    n, m, scale = int(coefficients[0]), int(coefficients[3]), coefficients[4]
    for k in range(n):
        state[k] = inputs[k] / scale
        for i in range(m):
            stretched = state[k] / coefficients[HEAD + i]
            state[n + k * m + i] = 0.0 if virgin else min(max(stretched, -1.0), 1.0)
    state[n + n * m] = 0.0


@kernel
def force_balance_inverse_start(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, virgin: bool
) -> None:
    """Start where an arm is that went in small steps from its rest to the first pressures."""
    n, n_in = int(coefficients[0]), inputs.size
    given, outputs, rest = scratch[:n_in], scratch[n_in : n_in + n], scratch[n_in + n :]
    state[:] = 0.0
    for i in range(n_in):
        given[i] = inputs[i]
    for i in range(PATH + 1):
        for k in range(n):
            given[k] = (i * (1.0 / PATH)) * inputs[k]
        force_balance_inverse_step(coefficients, state, rest, given, outputs)
    if virgin:
        state[n:] = 0.0
    state[state.size - 1] = 0.0


@dataclass(frozen=True, config=STRICT)
class ForceBalance(Invertible):
    """From displacements of n muscles to their pressures.

    Parameters
    ----------
    forces : sequence of n sequences of float
        For every muscle its numerator: for every power of what schedules, the constant and the n
        springs; three elastic coefficients of y_k^2 to y_k^4; for every power the friction, one a
        threshold. Displacements count relative to ``scale``.
    areas : sequence of n sequences of float
        For every muscle three coefficients of y_k to y_k^3, and one a threshold.
    thresholds : sequence of float
        Travels at which friction elements break away [mm], positive.
    scale : float
        Of displacements [mm], positive.
    degree : int
        Highest power of what schedules.
    pressure_range : (float, float), optional
        Pressures are clipped to it, and said so.
    driven, scheduled, given : sequence of Channel
        Displacements, what schedules, and pressures.
    """

    kind: ClassVar[str] = "force-balance"
    ports: ClassVar[Ports] = SEVERAL
    kernel: ClassVar[Step] = force_balance_step
    start_kernel: ClassVar[Start] = force_balance_start
    inverse_kernel: ClassVar[Step] = force_balance_inverse_step
    inverse_start_kernel: ClassVar[Start] = force_balance_inverse_start
    inverse_path_dependent: ClassVar[bool] = True
    increasing = ("thresholds",)
    notation: ClassVar[Notation] = Notation(
        r"p_k = \frac{\sum_q x^q (c_{kq} + \sum_j S_{kqj} y_j) + e_k(y_k) + \sum_m x^q "
        r"f_{kqm} s_m[y_k]}{1 + a_k(y_k) + \sum_m h_{km} s_m[y_k]}",
        thresholds="r_m [mm]",
        scale="L [mm]",
        driven="y_i",
        given="p_i",
    )

    forces: Rows
    areas: Rows
    thresholds: Vector
    scale: Annotated[FiniteFloat, Gt(0)]
    degree: Annotated[int, Interval(ge=1, le=4)]
    driven: Channels
    scheduled: Channels
    given: Channels
    pressure_range: tuple[FiniteFloat, FiniteFloat] | None = None

    def __post_init__(self) -> None:
        self.check_channels()
        n, m = len(self.driven), len(self.thresholds)
        if any(not r > 0 for r in self.thresholds):
            raise ModelError(
                f"thresholds of {self.kind!r} are {self.thresholds}. Remedy: give positive ones."
            )
        width, area = numerator_width(n, len(self.scheduled), self.degree, m), AREA + m
        for name, table, length in (("forces", self.forces, width), ("areas", self.areas, area)):
            if len(table) != n or any(len(row) != length for row in table):
                raise ModelError(
                    f"{name} of {self.kind!r} has rows of {[len(row) for row in table]}. "
                    f"Remedy: give {n} rows of {length}."
                )
        if len(self.given) != n:
            raise ModelError(
                f"{self.kind!r} of {n} muscles gives {len(self.given)} pressures. Remedy: give {n}."
            )

    @property
    def n_states(self) -> int:
        """Last displacements, stops of every muscle, and samples clipped."""
        n = len(self.driven)
        return n + n * len(self.thresholds) + 1

    @property
    def n_scratch(self) -> int:
        """Stops and their slopes, displacements and a gradient."""
        return 2 * len(self.driven) * (len(self.thresholds) + 1)

    @property
    def n_parameters(self) -> int:
        """All forces and areas."""
        return sum(map(len, (*self.forces, *self.areas)))

    def pack(self) -> Array:
        """Return forces and areas, muscle by muscle."""
        pairs = zip(self.forces, self.areas, strict=True)
        return np.concatenate([np.array([*force, *area]) for force, area in pairs])

    def unpack(self, parameters: ArrayLike) -> Self:
        """Return a balance of the same structure with other parameters."""
        table = parameter_vector(self, parameters).reshape(len(self.driven), -1)
        width = len(self.forces[0])
        return replace(self, forces=rows(table[:, :width]), areas=rows(table[:, width:]))

    def coefficients(self, sample_time: float | None) -> Array:
        """Return sizes, scale, limits and thresholds, then forces and area of every muscle."""
        del sample_time
        low, high = self.pressure_range or (-np.inf, np.inf)
        head = [len(self.driven), len(self.scheduled), self.degree, len(self.thresholds)]
        r = np.array(self.thresholds) / self.scale
        return np.concatenate([[*head, self.scale, low, high], r, self.pack()])

    def report(self, state: Array) -> None:
        """Warn of references that would need pressures out of range."""
        tell_clipped(state[-1], self.given, self.pressure_range)

    def n_clipped(self, state: Array) -> int:
        """Return how many samples needed pressures out of range."""
        return int(state[-1]) if state[-1] > 0 else 0

    def cost(self, sample_time: float | None) -> Cost:
        """Return about four operations a number, for those of stops come again."""
        operations = 4 * self.coefficients(sample_time).size
        return Cost(operations, operations)

    def inverse_cost(self, sample_time: float | None) -> Cost:
        """Return what steps of Newton's method cost."""
        return newton_cost(self.cost(sample_time).usual + len(self.driven) ** 3)

    @property
    def n_inverse_scratch(self) -> int:
        """As forward, two vectors and a matrix, and inputs and outputs on the way to the first."""
        n = len(self.driven)
        return self.n_scratch + 3 * n + n * n + len(self.inputs)

    solved: ClassVar[bool] = True

    @property
    def n_inverse_states(self) -> int:
        """As many as this block's, which count already."""
        return self.n_states

    def inverse_complaint(self, state: Array) -> str:
        """Tell of pressures for which no equilibrium was found."""
        return (
            f"no equilibrium was found in {int(state[-1])} samples: the model was not made for such "
            "pressures"
        )

    @classmethod
    def example(cls) -> Self:
        """Return two muscles beside an extensor."""
        first = [0.0, 1.4, -0.2, 0.02, 0.1, 0.02, 0.3, 0.2, 0.1, 0.06, 0.05, 0.0, 0.0]
        second = [0.0, -0.25, 1.6, 0.01, 0.03, 0.1, 0.2, 0.3, 0.1, 0.05, 0.06, 0.0, 0.0]
        area = [-0.15, -0.1, 0.0, -0.02, -0.01]
        return cls(
            (vector(first), vector(second)),
            (vector(area), vector(area)),
            (2.0, 8.0),
            50.0,
            1,
            tuple(Channel(f"displacement_{k}", "mm") for k in (1, 2)),
            (Channel("pressure_extensor", "bar"),),
            tuple(Channel(f"pressure_{k}", "bar") for k in (1, 2)),
        )


def numerator_width(n: int, n_scheduled: int, degree: int, n_thresholds: int) -> int:
    """Return how many coefficients the numerator of a muscle has."""
    n_powers = 1 + n_scheduled * degree
    return n_powers * (1 + n) + ELASTIC + n_thresholds * n_powers
