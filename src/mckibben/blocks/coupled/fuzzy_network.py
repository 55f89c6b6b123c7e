"""First-order Takagi-Sugeno fuzzy network, and its inverse.

Every input has Gaussian sets; a rule is one set of each input, fires by their product, and answers
with a linear function of all inputs; answers are weighted by normalised firing. Since there is a rule
for every combination, the normalised firing of a rule is the product of memberships normalised input
by input, which are computed in the log domain, where nothing underflows far from all centres.

For the inverse, known scheduling inputs are contracted away once a sample: what is left are rules of the
driven inputs alone, each the mean of those it replaces, weighted by their firing. Slopes are exact:
with mu_s the normalised memberships of an input x_i, of Gaussian sets at c_s of width w_s,

    d ln mu_s / d x_i = sum_r mu_r (x_i - c_r) / w_r^2 - (x_i - c_s) / w_s^2.

Source: "Modeling and Compensation of Stiffness-Dependent Hysteresis Coupling Behavior for Parallel
Pneumatic Artificial Muscle-Driven Soft Manipulator", Eqs. (9) to (13).
"""

from __future__ import annotations

import math
from itertools import product
from typing import Annotated, Self

import numpy as np
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import SEVERAL
from mckibben.blocks.fields import STRICT, Channel, Channels, PositiveRows, Rows, Vector
from mckibben.blocks.inverse import Invertible
from mckibben.blocks.kernels import DERIVED, NOTHING, SLACK, fill, kernel, step
from mckibben.blocks.parameters import one_per
from mckibben.blocks.solving import eliminate
from mckibben.errors import ModelError

MOST_STEPS = 40
"""Maximum number of Newton steps per sample."""

SOLVED = 1e-11
"""Residual, relative to the outputs, that is rounding."""

SINGLE = {"SOLVED": 1e-5}

STARTS = 5
"""Number of initial guesses for the first sample, from the lowest to the highest inputs."""


N_INPUTS, N_OUTPUTS, N_SETS, CONSTANT, MOST_SETS, SETS = range(6)
"""Places of the coefficients: numbers of inputs, outputs and all sets, whether consequents have a
constant, the most sets of an input, and the first number of sets.
"""


@kernel
def fill_memberships(x: float, centres: Array, widths: Array, memberships: Array) -> None:
    """Fill an input's normalised memberships, computed in logarithms to avoid underflow."""
    largest, total = -np.inf, 0.0
    for s in range(centres.size):
        z = (x - centres[s]) / widths[s]
        memberships[s] = -0.5 * z * z
        largest = max(largest, memberships[s])
    for s in range(centres.size):
        memberships[s] = math.exp(memberships[s] - largest)
        total += memberships[s]
    for s in range(centres.size):
        memberships[s] /= total


@kernel
def fill_between(c: Array, first: int, last: int, x: Array, memberships: Array) -> int:
    """Fill the memberships of inputs ``first`` to ``last``; return the number of their combinations.

    ``c`` is what `contract` reads; ``x`` begins at the first of these inputs.
    """
    n, n_sets, most = int(c[N_INPUTS]), int(c[N_SETS]), int(c[MOST_SETS])
    at, combinations = SETS + n, 1
    for i in range(first):
        at += int(c[SETS + i])
    for i in range(first, last):
        sets = int(c[SETS + i])
        fill_memberships(
            x[i - first],
            c[at : at + sets],
            c[at + n_sets : at + n_sets + sets],
            memberships[i * most : i * most + sets],
        )
        combinations *= sets
        at += sets
    return combinations


@kernel
def contract(c: Array, m: int, known: Array, memberships: Array, left: Array) -> None:
    """Contract the rules over known inputs, for the remaining first m inputs.

    ``c`` from `SETS` on is the sets of every input, centres, widths and consequents. A rule's
    consequents are one row an output: a coefficient for every input, and the constant if there are
    constants. ``left`` has, rule after rule, one row an output: m coefficients and a constant; of no
    inputs, the outputs themselves.
    """
    n, n_out, constant, most = (
        int(c[N_INPUTS]),
        int(c[N_OUTPUTS]),
        int(c[CONSTANT]),
        int(c[MOST_SETS]),
    )
    n_known = fill_between(c, m, n, known, memberships)
    rows, width = c[SETS + n + 2 * int(c[N_SETS]) :], n + constant
    for i in range(left.size):
        left[i] = 0.0
    for k in range(n_known):
        firing, rest = 1.0, k
        for i in range(n - 1, m - 1, -1):
            sets = int(c[SETS + i])
            firing *= memberships[i * most + rest % sets]
            rest //= sets
        if firing > NOTHING:
            for rule in range(left.size // (n_out * (m + 1))):
                at, place = (rule * n_known + k) * n_out * width, rule * n_out * (m + 1)
                for _ in range(n_out):
                    total = rows[at + n] if constant else 0.0
                    for i in range(m, n):
                        total += rows[at + i] * known[i - m]
                    for i in range(m):
                        left[place + i] += firing * rows[at + i]
                    left[place + m] += firing * total
                    at += width
                    place += m + 1


@kernel
def sloped_answer(
    c: Array, left: Array, x: Array, memberships: Array, tilts: Array, y: Array, slopes: Array
) -> None:
    """Fill the outputs at driven inputs, and the slope of every output (row) by each of these.

    ``left`` is what `contract` fills; scratch are the memberships, and their relative
    slopes, with one more for each driven input.
    """
    m, n, n_sets, most = x.size, int(c[N_INPUTS]), int(c[N_SETS]), int(c[MOST_SETS])
    n_out = y.size
    n_rules = fill_between(c, 0, m, x, memberships)
    tilt = tilts[m * most :]
    at = SETS + n
    for i in range(m):
        mean = 0.0
        for s in range(int(c[SETS + i])):
            width = c[at + n_sets + s]
            tilts[i * most + s] = (x[i] - c[at + s]) / (width * width)
            mean += memberships[i * most + s] * tilts[i * most + s]
        for s in range(int(c[SETS + i])):
            tilts[i * most + s] = mean - tilts[i * most + s]
        at += int(c[SETS + i])
    for j in range(n_out):
        y[j] = 0.0
        for i in range(m):
            slopes[j, i] = 0.0
    at = 0
    for rule in range(n_rules):
        firing, rest = 1.0, rule
        for i in range(m - 1, -1, -1):
            sets = int(c[SETS + i])
            place = i * most + rest % sets
            firing *= memberships[place]
            tilt[i] = tilts[place]
            rest //= sets
        if firing > NOTHING:
            for j in range(n_out):
                total = left[at + m]
                for i in range(m):
                    total += left[at + i] * x[i]
                y[j] += firing * total
                for i in range(m):
                    slopes[j, i] += firing * (left[at + i] + tilt[i] * total)
                at += m + 1
        else:
            at += n_out * (m + 1)


@step
def fuzzy_network_step(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
) -> None:
    """Evaluate a sample; scratch holds the memberships."""
    contract(coefficients, 0, inputs, scratch, outputs)


@kernel
def solve_driven(
    coefficients: Array, start: Array, scratch: Array, inputs: Array, best: Array
) -> float:
    """Solve for the driven inputs within their limits by Newton's method from a start.

    Coefficients are the limits, lowest then highest, then the network's. Returns the largest error by
    the size of the outputs.
    """
    m = start.size
    low, high, c = coefficients[:m], coefficients[m : 2 * m], coefficients[2 * m :]
    n, most, n_rules = int(c[N_INPUTS]), int(c[MOST_SETS]), 1
    for i in range(m):
        n_rules *= int(c[SETS + i])
    n_left = n_rules * m * (m + 1)
    memberships, tilts = scratch[: n * most], scratch[n * most : n * most + m * most + m]
    left = scratch[n * most + m * most + m : n * most + m * most + m + n_left]
    rest = scratch[n * most + m * most + m + n_left :]
    x, y, change = rest[:m], rest[m : 2 * m], rest[2 * m : 3 * m]
    slopes = rest[3 * m : m * (m + 3)].reshape((m, m))
    contract(c, m, inputs[m:], memberships, left)
    size = 1.0
    for j in range(m):
        x[j] = start[j]
        size = max(size, abs(inputs[j]))
    least, share = np.inf, 1.0
    for _ in range(MOST_STEPS):
        sloped_answer(c, left, x, memberships, tilts, y, slopes)
        worst = 0.0
        for j in range(m):
            y[j] -= inputs[j]
            worst = max(worst, abs(y[j]))
        if worst < least:
            # once at rounding, a step that gains nothing ends the search
            stuck = worst > 0.5 * least and worst < SOLVED * size
            least = worst
            for i in range(m):
                best[i] = x[i]
                change[i] = y[i]
            if stuck or worst == 0.0:
                break
            eliminate(slopes, change)
            share = 1.0
        elif least < SOLVED * size:
            break
        else:
            # a shorter step from the best
            share *= 0.5
            if share < 1e-3:
                break
        for i in range(m):
            x[i] = min(max(best[i] - share * change[i], low[i]), high[i])
    if DERIVED:
        sloped_answer(c, left, best, memberships, tilts, y, slopes)
        for j in range(m):
            y[j] -= inputs[j]
        eliminate(slopes, y)
        for i in range(m):
            if low[i] < best[i] < high[i]:
                best[i] -= y[i]
    return least / size


@step
def fuzzy_network_inverse_step(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
) -> None:
    """Solve for the driven inputs from the last ones; the state is these, and the clip count."""
    m = state.size - 1
    error = solve_driven(coefficients, state[:m], scratch, inputs, outputs)
    if error > SLACK:
        state[m] += 1.0
    fill(state[:m], outputs)


@kernel
def fuzzy_network_inverse_start(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, virgin: bool
) -> None:
    """Start at the best solution for the first sample from several initial guesses."""
    m = state.size - 1
    low, high = coefficients[:m], coefficients[m : 2 * m]
    trial, driven = scratch[:m], scratch[m : 2 * m]
    least = np.inf
    state[m] = 0.0
    for k in range(STARTS):
        share = min(max(k / (STARTS - 1), 0.02), 0.98)
        for i in range(m):
            trial[i] = low[i] + share * (high[i] - low[i])
        error = solve_driven(coefficients, trial, scratch[2 * m :], inputs, driven)
        if error < least or k == 0:
            least = error
            fill(state[:m], driven)


@dataclass(frozen=True, config=STRICT)
class FuzzyNetwork(Invertible):
    """Takagi-Sugeno network with a rule for every combination of sets.

    Parameters
    ----------
    centres, widths : sequence of sequence of float
        Of the Gaussian sets of every input; widths are positive.
    consequents : sequence of float
        Rule after rule (the last input's set running fastest), output after output: one coefficient
        for every input, then the constant if there is one.
    constants : bool
        Whether consequents have a constant term.
    driven, scheduled, given : sequence of Channel
        Inputs driven, those that schedule, and outputs.
    limits : sequence of (float, float), optional
        Lowest and highest value of every driven input; needed for an inverse.
    """

    kind = "fuzzy-network"
    ports = SEVERAL
    kernel = fuzzy_network_step
    inverse_kernel = fuzzy_network_inverse_step
    inverse_start_kernel = fuzzy_network_inverse_start
    inverse_path_dependent = True
    n_inverse_states = one_per("driven", 1)  # the last solution, and the clip count
    solved = True
    of_local_rules = True
    parameters = ("centres", "widths", "consequents")
    formulas = (
        r"y_k = \frac{\sum_r \omega_r\, (\sum_i P_{rki} x_i + c_{rk})}{\sum_r \omega_r},\quad "
        r"\omega_r = \prod_i \exp\left(-\frac{(x_i - m_{ij})^2}{2 \sigma_{ij}^2}\right)",
        r"j \text{: the set of } x_i \text{ in rule } r",
    )

    centres: Annotated[Rows, "m_{ij} [{in0}]"]
    widths: Annotated[PositiveRows, r"\sigma_{ij} [{in0}]"]
    consequents: Annotated[Vector, "P_{rki}"]
    driven: Annotated[Channels, "x_i"]
    given: Annotated[Channels, "y_k"]
    scheduled: Annotated[Channels, "x_i"] = ()
    constants: bool = False
    limits: Rows | None = None

    def equations(self) -> tuple[str, ...]:
        """Return the equations, with the constants of consequents if there are any."""
        first, *rest = self.formulas
        return (first if self.constants else first.replace(" + c_{rk}", ""), *rest)

    def symbol_of(self, field: str, index: tuple[int, ...]) -> str:
        """Return the symbol of a number: consequents have rule, output, and input."""
        if field != "consequents":
            return super().symbol_of(field, index)
        whole, place = divmod(index[0], len(self.inputs) + self.constants)
        rule, output = divmod(whole, len(self.given))
        if place < len(self.inputs):
            return f"P_{{{rule + 1},{output + 1},{place + 1}}}"
        return f"c_{{{rule + 1},{output + 1}}}"

    def __post_init__(self) -> None:
        self.check_channels()
        sets = [len(row) for row in self.centres]
        if len(sets) != len(self.inputs) or sets != [len(row) for row in self.widths] or 0 in sets:
            raise ModelError(
                f"{self.kind!r} of {len(self.inputs)} inputs has centres of {sets} and "
                f"widths of {[len(row) for row in self.widths]} sets",
                remedy="give each input as many of both",
            )
        n_consequents = int(np.prod(sets)) * len(self.given) * (len(sets) + self.constants)
        if len(self.consequents) != n_consequents:
            raise ModelError(
                f"{self.kind!r} of this structure has {n_consequents} consequents, got "
                f"{len(self.consequents)}",
                remedy=f"give {n_consequents}",
            )
        if self.limits is not None and (
            len(self.limits) != len(self.driven)
            or any(len(pair) != 2 or not pair[0] < pair[1] for pair in self.limits)
        ):
            raise ModelError(
                f"limits of {self.kind!r} are {self.limits}",
                remedy="give the lowest and highest of every driven input",
            )

    @property
    def n_scratch(self) -> int:
        return len(self.centres) * max(map(len, self.centres))

    def coefficients(self, sample_time: float | None) -> Array:
        sets = [len(row) for row in self.centres]
        sizes = [len(sets), len(self.given), sum(sets), int(self.constants), max(sets)]
        return np.concatenate([[*sizes, *sets], self.pack()])

    def _n_rules(self, n: int) -> int:
        """Return the number of combinations of the first inputs' sets."""
        return math.prod(map(len, self.centres[:n]))

    def check_invertible(self) -> None:
        if len(self.given) != len(self.driven) or self.limits is None:
            raise ModelError(
                f"{self.kind!r} with {len(self.driven)} driven inputs, {len(self.given)} "
                f"outputs and limits {self.limits} has no inverse",
                remedy="give as many of both, and limits",
            )

    @property
    def n_inverse_scratch(self) -> int:
        """Memberships, their slopes, contracted rules, vectors of inputs, and a matrix."""
        m, most = len(self.driven), max(map(len, self.centres))
        solving = m * most + self._n_rules(m) * m * (m + 1) + m * (m + 6)
        return self.n_scratch + solving

    def inverse_numbers(self, own: Array) -> Array:
        return np.concatenate([*np.array(self.limits).T, own])

    def inverse_complaint(self, state: Array) -> str:
        return (
            f"{int(state[-1])} samples of the reference are out of reach of the network and were "
            "clipped to the nearest that is"
        )

    def unit_of(self, field: str, index: tuple[int, ...]) -> str | None:
        if field != "consequents":
            return super().unit_of(field, index)
        per = [*(channel.unit for channel in self.inputs), *[""] * self.constants]
        rule, k = divmod(index[-1], len(per))
        return f"{self.outputs[rule % len(self.outputs)].unit or '1'}/{per[k] or '1'}"

    @classmethod
    def example(cls) -> Self:
        centres, widths = (0.0, 30.0), (20.0, 20.0)
        consequents = []
        for a, b, p in product((0, 1), repeat=3):
            gain = 1.0 - 0.2 * p
            consequents += [gain + 0.1 * a, 0.1 - 0.05 * b, 0.2 * p]
            consequents += [0.15 - 0.05 * a, gain + 0.05 * b, -0.1 * p]
        return cls(
            (centres, centres, (0.0, 2.5)),
            (widths, widths, (1.0, 1.2)),
            tuple(consequents),
            tuple(Channel(f"displacement_{k}", "mm") for k in (1, 2)),
            tuple(Channel(f"displacement_{k}", "mm") for k in (1, 2)),
            (Channel("pressure_extensor", "bar"),),
            False,
            ((-50.0, 80.0), (-50.0, 80.0)),
        )
