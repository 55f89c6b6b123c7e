"""Identification of oscillators with internal hysteresis: Gauss-Newton on free runs.

A linear oscillator is found first; its stiffness is shared between spring and element in a few ways,
from each of which a descent on one run in coarse steps begins, and the best goes on with all runs in
fine ones. Free runs and their exact derivatives by all parameters come from one pass: the Runge-Kutta
steps of `mckibben.blocks.hysteresis.oscillators`, and the tangents of each stage.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from annotated_types import Interval

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.fields import vector
from mckibben.blocks.hysteresis.oscillators import (
    BoucWenOscillator,
    DuhemOscillator,
    Oscillator,
    bouc_wen_slope,
    knot_before,
)
from mckibben.blocks.kernels import kernel
from mckibben.errors import DataError, ModelError
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.estimator import SearchEstimator
from mckibben.estimators.core.uncertainty import covariance_by_runs, relative_sizes
from mckibben.estimators.dynamics.linear_oscillator import (
    MOST_SUBSTEPS,
    Path,
    averaged,
    linear_oscillator,
    paths,
)
from mckibben.estimators.optimisers.multi_start import trust_region
from mckibben.estimators.optimisers.tracker import Tracker
from mckibben.presets import preset
from mckibben.system.compiling import deferred

ANGLE, COARSE_ANGLE = 1 / 30, 1 / 3
"""Largest angle of the linear oscillator per substep [rad], in the fit and in the coarse search."""

FEWEST_COARSE = 2

FIRST_STEPS, STEPS = 12, 60
"""Steps from every start, and from the best ones."""

SHARES, BENDS = (0.1, 0.3, 0.6), (0.5, 3.0, 10.0)
"""Initial hysteretic elements: shares of the linear stiffness; and relative loss of slope over the
largest displacement.
"""

ROUNDS = 8
"""Number of refinements of the structure per start."""

FIRST_GAIN, LEAST_GAIN = 1e-3, 1e-9
"""Smallest relative reductions of the squared error for another step."""

LARGEST = 1e50
"""Largest error or derivative; sums of squares stay finite."""

DIFFERENCE = 1e-6
"""Relative step of a parameter for derivatives of starts at rest."""

OWN = 3
"""Number of parameters before those of the element: inertia, damping, stiffness."""

BEYOND = 1.1
"""Position of the outermost knots, relative to the largest force of the element."""

TIGHT = 0.8
"""Smallest share of the knots' range that the forces must cover."""


def following(element: Any) -> Callable[..., None]:
    """Return a simulation of an oscillator with linearly interpolated inputs.

    Parameters
    ----------
    element : function
        ``element(z, velocity, numbers, by)``, to the slope dz/dy and its derivative by z; fills ``by``
        with those by the element's parameters.

    Returns
    -------
    callable
        Of numbers, [inertia, damping, stiffness, those of the element]; step [s]; state, [y, y', z] at
        the first input, and moved, its derivatives by the p parameters, shape (3, p), both changed;
        inputs, shape (1 + every * (skipped + n),); every and skipped, the steps from sample to sample,
        and the samples before the first that is wanted. Fills outputs, shape (n, 2), with y and z at
        every sample, and slopes, shape (n, p), with the derivatives of y, or (0, p) where not wanted.
    """

    def follow(
        numbers: Array,
        step: float,
        state: Array,
        moved: Array,
        inputs: Array,
        every: int,
        skipped: int,
        outputs: Array,
        slopes: Array,
    ) -> None:
        m, c, k, own = numbers[0], numbers[1], numbers[2], numbers[OWN:]
        p, wanted = moved.shape[1], slopes.shape[0] > 0
        by = np.zeros(p - OWN)
        rate, tangent = np.zeros((4, 3)), np.zeros((4, 3, p))
        for t in range(inputs.size - 1):
            for stage in range(4):
                way = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
                h = way * step
                last = max(stage - 1, 0)
                u = inputs[t] + way * (inputs[t + 1] - inputs[t])
                y = state[0] + h * rate[last, 0]
                v = state[1] + h * rate[last, 1]
                z = state[2] + h * rate[last, 2]
                f, bend = element(z, v, own, by)
                a = (u - c * v - k * y - z) / m
                rate[stage, 0], rate[stage, 1], rate[stage, 2] = v, a, v * f
                if wanted:
                    for i in range(p):
                        dy = moved[0, i] + h * tangent[last, 0, i]
                        dv = moved[1, i] + h * tangent[last, 1, i]
                        dz = moved[2, i] + h * tangent[last, 2, i]
                        tangent[stage, 0, i] = dv
                        tangent[stage, 1, i] = -(c * dv + k * dy + dz) / m
                        tangent[stage, 2, i] = f * dv + v * bend * dz
                    tangent[stage, 1, 0] -= a / m
                    tangent[stage, 1, 1] -= v / m
                    tangent[stage, 1, 2] -= y / m
                    for i in range(p - OWN):
                        tangent[stage, 2, OWN + i] += v * by[i]
            for d in range(3):
                state[d] += (
                    step / 6.0 * (rate[0, d] + 2.0 * rate[1, d] + 2.0 * rate[2, d] + rate[3, d])
                )
                if wanted:
                    for i in range(p):
                        ends = tangent[0, d, i] + tangent[3, d, i]
                        middle = tangent[1, d, i] + tangent[2, d, i]
                        moved[d, i] += step / 6.0 * (ends + 2.0 * middle)
            j = (t + 1) // every - skipped - 1
            if (t + 1) % every == 0 and j >= 0:
                outputs[j, 0], outputs[j, 1] = state[0], state[2]
                if wanted:
                    slopes[j] = moved[0]

    return deferred(follow)


@kernel
def bouc_wen_element(z: float, velocity: float, numbers: Array, by: Array) -> tuple[float, float]:
    """Return the slope of a Bouc-Wen element, and its derivatives."""
    up = 1.0 if velocity > 0.0 else -1.0
    by[0], by[1], by[2] = 1.0, -up * z, -abs(z)
    bend = -numbers[1] * up - numbers[2] * (1.0 if z > 0.0 else -1.0)
    return bouc_wen_slope(z, velocity, numbers), bend


@kernel
def duhem_element(z: float, velocity: float, numbers: Array, by: Array) -> tuple[float, float]:
    """Return the slope of an element of two curves, and its derivatives."""
    n = numbers.size // 3
    j = knot_before(z, numbers, n)
    width = numbers[j + 1] - numbers[j]
    share = (z - numbers[j]) / width
    inside = 0.0 <= share <= 1.0
    share = min(max(share, 0.0), 1.0)
    by[:] = 0.0
    i = j if velocity > 0.0 else j + n
    by[i], by[i + 1] = 1.0 - share, share
    rise = numbers[n + i + 1] - numbers[n + i]
    return numbers[n + i] + share * rise, rise / width if inside else 0.0


follow_bouc_wen, follow_duhem = following(bouc_wen_element), following(duhem_element)


def bouc_wen_starts(slope: float, bend: float, fields: dict[str, Any]) -> list[Oscillator]:
    """Return initial oscillators with hardening and softening elements."""
    return [
        BoucWenOscillator(slope=slope, gamma=bend, delta=way * bend, **fields)
        for way in (-0.5, 0.5)
    ]


def duhem_starts(slope: float, bend: float, fields: dict[str, Any]) -> list[Oscillator]:
    """Return an initial element of two pieces per curve, whose slope vanishes at its largest force."""
    most, rising = slope / bend, (2.0 * slope, slope, 0.0)
    return [
        DuhemOscillator(rising=rising, falling=rising[::-1], knots=(-most, 0.0, most), **fields)
    ]


@dataclass(frozen=True)
class Element:
    """Search of oscillators with one kind of element."""

    n_positive: int
    """Number of leading parameters that are searched by their logarithms."""

    order: int
    """The other parameters have the unit of force to this power, over displacement."""

    follows: Callable[..., None]
    starts: Callable[[float, float, dict[str, Any]], list[Oscillator]]
    """Initial models: from the element's slope at zero force, its relative loss per mm, and all
    other fields.
    """


ELEMENTS = {
    "bouc-wen": Element(4, 0, follow_bouc_wen, bouc_wen_starts),
    "duhem": Element(3, 1, follow_duhem, duhem_starts),
}


class FreeRuns:
    """Errors of models of one structure on all runs, with derivatives.

    A tracker counts evaluations, and is reports of the best where ``reports``.
    """

    def __init__(
        self,
        template: Oscillator,
        data: TrainingData,
        paths: Sequence[Path],
        estimator: OscillatorEstimator,
        tracker: Tracker,
        reports: bool = False,
    ) -> None:
        self.template, self.target, self.paths = template, data.target, paths
        self.tracker, self.reports = tracker, reports
        element = ELEMENTS[estimator.element]
        self.n_positive, self.follows = element.n_positive, element.follows
        self.at_rest = estimator.at_rest
        self.step = data.sample_time or 1.0
        force, travel = (float(np.ptp(span)) for span in (data.input_range, data.output_range))
        self.size = np.full(template.n_parameters, force**element.order / travel)
        self.size[: self.n_positive] = 1.0
        if template.output_offset is not None:
            self.size[-1] = travel

    def coordinates(self, model: Oscillator) -> Array:
        """Return the search coordinates of a model: logarithms of positive parameters, then others."""
        theta = model.pack() / self.size
        theta[: self.n_positive] = np.log(np.maximum(theta[: self.n_positive], 1e-300))
        return theta

    def model(self, theta: Array) -> Oscillator:
        """Return the model at coordinates."""
        values = theta * self.size
        values[: self.n_positive] = np.exp(np.minimum(values[: self.n_positive], 690.0))
        return self.template.unpack(values)

    def scale(self, model: Oscillator) -> Array:
        """Return the derivatives of the parameters by the coordinates."""
        found = self.size.copy()
        found[: self.n_positive] = model.pack()[: self.n_positive]
        return found

    def descended(self, steps: int, least_gain: float) -> tuple[Oscillator, float]:
        """Return the model at the end of a descent, and its RMSE."""
        theta = self.coordinates(self.template)
        with self.tracker.searching():
            theta, squares = trust_region(
                self.errors,
                self.slopes,
                theta,
                scale="jac",
                least_gain=least_gain,
                max_evaluations=steps,
            )[-1]
            if not np.isfinite(squares):
                return self.template, np.inf
        if self.tracker.interrupted and self.tracker.best is not None:
            theta = self.tracker.best
        errors = self.errors(theta)
        return self.model(theta), float(np.sqrt(np.mean(errors**2)))

    def errors(self, theta: Array) -> Array:
        """Return the errors at scored samples; infinite if there is no such model."""
        try:
            model = self.model(theta)
            found = self.outputs(model, slopes=True) - self.target
        except ModelError:
            found = np.full(self.target.size, np.inf)
        else:
            sizes = np.abs(found).max(), np.abs(self.slopes(theta)).max()
            if not all(size < LARGEST for size in sizes):
                found = np.full(self.target.size, np.inf)
        cost = float(np.sqrt(np.mean(found**2)))
        if self.reports:
            self.tracker.saw(theta, cost)
        else:
            self.tracker.evaluations += 1
            self.tracker.reached(0.0)
        return found

    def slopes(self, theta: Array) -> Array:
        """Return the derivatives of the last evaluation of errors."""
        with np.errstate(invalid="ignore", over="ignore"):
            found: Array = self._slopes * self.scale(self.model(theta))
        return found

    def forces(self, model: Oscillator) -> Array:
        """Return the forces of the element in all runs."""
        self.outputs(model)
        return self._forces

    def outputs(self, model: Oscillator, slopes: bool = False) -> Array:
        """Return the outputs at scored samples; store derivatives by the parameters if requested."""
        values = model.pack()
        has_offset = model.output_offset is not None
        p = values.size - has_offset
        numbers = np.array([model.inertia, model.damping, model.stiffness, *model.element])
        found, tables, forces = [], [], []
        for path in self.paths:
            n = path.run.u.size
            given, table = np.empty((n, 2)), np.empty((n if slopes else 0, p))
            state, moved = self._begun(model, path, p)
            h = self.step / path.every
            along = (path.inputs, path.every, path.skipped)
            self.follows(numbers, h, state, moved, *along, given, table)
            found.append(given[path.run.counts, 0])
            forces.append(given[:, 1])
            if slopes:
                tables.append(table[path.run.counts])
        self._forces = np.concatenate(forces)
        if slopes:
            self._slopes = np.concatenate(tables)
            self._slopes[:, 0] *= 1e-3  # the mass is in kg
            if has_offset:
                self._slopes = np.column_stack([self._slopes, np.ones(len(self._slopes))])
        return np.concatenate(found) + (model.output_offset or 0.0)

    def _begun(self, model: Oscillator, path: Path, p: int) -> tuple[Array, Array]:
        """Return the initial state of a path, and its derivatives."""
        moved = np.zeros((3, p))
        if not self.at_rest:
            return np.zeros(3), moved
        first = path.run.driven[0]
        state = model.initial_state(first, "first_sample")[:3]
        values = model.pack()
        for place in range(OWN - 1, p):  # rest knows neither mass nor damping
            change = DIFFERENCE * (abs(values[place]) or self.size[place])
            other = values.copy()
            other[place] += change
            moved[:, place] = (
                model.unpack(other).initial_state(first, "first_sample")[:3] - state
            ) / change
        return state, moved


@dataclass(kw_only=True, repr=False, eq=False)
class OscillatorEstimator(SearchEstimator):
    """Mass, damper, spring and a hysteretic element, by Gauss-Newton on free runs.

    Parameters
    ----------
    element : {"bouc-wen", "duhem"}
        A Bouc-Wen element; or one whose slopes are free in either direction.
    n_pieces : int
        Of either curve of a Duhem element on either side of no force, where loading turns into
        unloading, so that a corner is there; spread evenly over the element's forces.
    periodic : bool
        Whether every recording is a whole number of periods of a motion that repeats itself, as under
        a multisine after some periods. Then no start counts, and the input is taken to be band-limited
        between samples; run such models by their `steady_state`. Otherwise recordings begin at
        rest, and the input goes in straight lines from sample to sample.
    fit_offset : bool
        Whether the displacement has an offset to be found; else it is 0 without force.
    substeps : int, optional
        Runge-Kutta steps from sample to sample. Default: enough that the linear oscillator turns by
        no more than 1/30 rad in each.
    """

    purpose = "rate"
    needs_time: ClassVar[bool] = True

    input: str = "force"
    output: str = "displacement"
    element: Literal["bouc-wen", "duhem"] = "bouc-wen"
    n_pieces: Annotated[int, Interval(ge=1, le=20)] = 2
    periodic: bool = False
    fit_offset: bool = False
    substeps: Annotated[int, Interval(ge=1, le=MOST_SUBSTEPS)] | None = None

    made_for: ClassVar[tuple[str, str] | None] = ("force", "displacement")
    effort: ClassVar[float] = 3.0

    def refined(self, model: Oscillator, forces: Array) -> Oscillator | None:
        """Return the model with up to twice the pieces, spread over its element's forces."""
        if not isinstance(model, DuhemOscillator):
            return None
        n, most = len(model.knots) // 2, float(np.abs(forces).max())
        if n == self.n_pieces and TIGHT * model.knots[-1] < most < model.knots[-1]:
            return None
        most *= BEYOND
        knots = most * np.linspace(-1.0, 1.0, 1 + 2 * min(2 * n, self.n_pieces))
        rising, falling = (
            vector(np.interp(knots, model.knots, values))
            for values in (model.rising, model.falling)
        )
        return replace(model, knots=vector(knots), rising=rising, falling=falling)

    def find(self, data: TrainingData, tracker: Tracker) -> tuple[Block, TrainingData]:
        step = data.timed()
        linear = linear_oscillator(data, self.channels(data))
        fine = self.substeps or linear.substeps(step, ANGLE)
        coarse = min(max(linear.substeps(step, COARSE_ANGLE), FEWEST_COARSE), fine)
        self._warm = linear.forgets(data)
        merged = averaged(data) if self.periodic else data
        fields = self.channels(data) | {
            "output_offset": 0.0 if self.fit_offset else None,
            "substeps": fine,
            "initial": self.starting_rule,
        }
        middle = float(np.mean(data.target)) if self.fit_offset else 0.0
        most = float(np.abs(data.target - middle).max())
        first = replace(merged, runs=merged.runs[:1])

        def begun(model: Oscillator) -> tuple[Oscillator, float]:
            return self.search(model, first, coarse, tracker).descended(FIRST_STEPS, FIRST_GAIN)

        tried = []
        for share, bend in product(SHARES, BENDS):
            # an element that is bent far adds the less to the stiffness of large motion
            spring = (1.0 - share / max(1.0, bend)) * linear.stiffness
            own = {"mass": linear.mass, "damping": 0.5 * linear.damping, "stiffness": spring}
            starts = ELEMENTS[self.element].starts(
                share * linear.stiffness, bend / most, fields | own
            )
            tried += [begun(start) for start in starts]
        model, cost = min(tried, key=lambda one: one[1])
        if not np.isfinite(cost):
            raise DataError(
                "no oscillator runs stably under this force",
                channel=data.input,
                remedy="check units, or record at a higher rate",
            )
        for _ in range(ROUNDS):
            finer = self.refined(model, self.search(model, first, coarse, tracker).forces(model))
            if finer is None:
                break
            model, _ = begun(finer)
        for substeps, gain, reports in ((coarse, FIRST_GAIN, False), (fine, LEAST_GAIN, True)):
            search = self.search(model, merged, substeps, tracker, reports)
            model, _ = search.descended(STEPS, gain)
        return model, data

    def search(
        self,
        model: Oscillator,
        data: TrainingData,
        substeps: int,
        tracker: Tracker,
        reports: bool = False,
    ) -> FreeRuns:
        """Return the errors of models of one structure on all runs."""
        warm = self._warm if self.periodic else None
        steps = paths(data, substeps, warm, self.at_rest)
        return FreeRuns(model, data, steps, self, tracker, reports)

    @property
    def at_rest(self) -> bool:
        """Whether runs start in equilibrium with their first input, instead of at zero."""
        return not self.periodic and self.starting_rule == "first_sample"

    def free_runs(self, blocks: Sequence[Block], data: TrainingData) -> Array:
        """Return the outputs of blocks at scored samples: in steady state for periodic recordings."""
        if not self.periodic:
            return super().free_runs(blocks, data)
        rows = []
        for block in blocks:
            assert isinstance(block, Oscillator)
            rows.append(self.search(block, data, block.substeps, Tracker()).outputs(block))
        return np.array(rows)

    def uncertainty(
        self, block: Block, data: TrainingData, residual: Array, at_bounds: Sequence[int]
    ) -> tuple[float, Array]:
        """Return the condition of all parameters and their covariance, from exact derivatives."""
        assert isinstance(block, Oscillator)
        search = self.search(block, data, block.substeps, Tracker())
        theta = search.coordinates(block)
        search.errors(theta)
        size = relative_sizes(block.pack())
        slopes = search.slopes(theta) / search.scale(block) * size
        condition, own = covariance_by_runs(slopes, residual, data.runs)
        return condition, own * np.outer(size, size)


BOUC_WEN_OSCILLATOR = preset(
    OscillatorEstimator,
    "Bouc-Wen oscillator by Gauss-Newton on free runs, started from a linear one.",
    title="Bouc–Wen oscillator",
    can=(
        "A mass, a damper and a spring with Bouc-Wen hysteresis inside the loop, from force "
        "to displacement: six numbers, from free runs or from periods of a steady motion."
    ),
    cannot=(
        "One mass, linear but for the element, whose loops are symmetric; needs time; no inverse."
    ),
    quick=True,
    element="bouc-wen",
)

DUHEM_OSCILLATOR = preset(
    OscillatorEstimator,
    "Oscillator with free slopes, by Gauss-Newton on free runs.",
    title="Duhem oscillator",
    can=(
        "A mass, a damper and a spring with hysteresis of unknown shape inside the loop: "
        "slopes of one element, free in either direction."
    ),
    cannot=(
        "One hysteretic state, so minor loops are forgotten once they are left; "
        "slopes are constant beyond the recorded forces; no inverse."
    ),
    element="duhem",
)
