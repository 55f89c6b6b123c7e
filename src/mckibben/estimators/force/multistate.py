"""Identification of multistate friction, alone or on top of a static force law."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.compose import Parallel
from mckibben.blocks.force.multistate_friction import (
    EACH_WAY,
    EIGHTEEN,
    ELEVEN,
    PARAMETER_POSITIONS,
    RELEASED,
    Direction,
    MultistateFriction,
)
from mckibben.blocks.runs import Run
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.separable import SeparableEstimator
from mckibben.estimators.force.laws import Law, force_columns, force_law
from mckibben.numerics.multi_start import Choice
from mckibben.numerics.tracker import Tracker
from mckibben.recording import Recording, listed

Structure = Literal["eleven", "eleven-released", "each-way", "eighteen"]
STRUCTURES = {
    "eleven": ELEVEN,
    "eleven-released": RELEASED,
    "each-way": EACH_WAY,
    "eighteen": EIGHTEEN,
}

LEAST_SHARE = 1e-5
"""Smallest force of an element, relative to the range of the output."""

EXCHANGE_LENGTHS = np.geomspace(0.02, 1.0, 8)
"""Break-away lengths tried for one element at a time, relative to the range of the input."""

EXCHANGE_TIMES = (0.1, 10.0)
"""Relaxation times tried with each of these [samples]."""


def extract_hysteresis(
    recordings: Recording | Sequence[Recording], law: Block, *, output: str = "force_hysteresis"
) -> list[Recording]:
    """Return recordings with the residual of a static law as output: f_h = f - f_st.

    Source: "A Multistate Friction Model for the Compensation of the Asymmetric Hysteresis in the
    Mechanical Response of Pneumatic Artificial Muscles", Eq. (2).

    Parameters
    ----------
    recordings : Recording or sequence of Recording
        Isobaric runs with length, pressure and force.
    law : Block
        Static force law with one output, such as one identified from isometric runs.
    output : str
        Name of the new channel, which has the unit of the law's output.

    Raises
    ------
    DataError
        If a channel that the law needs is absent.
    """
    (force,) = law.outputs
    extracted = []
    for recording in listed(recordings):
        residual = recording[force.name] - law.simulate(recording)[force.name]
        extracted.append(recording.with_channels({output: force.unit}, **{output: residual}))
    return extracted


class MultistateEstimator(SeparableEstimator):
    """Multistate friction by bounded least squares from many starts, with exchange of elements.

    Break-away lengths and relaxation times are searched; stiffnesses and the static law are linear and
    are solved for. With ``static=None`` the output is the hysteresis alone, as in the paper; see
    `extract_hysteresis`.

    Parameters
    ----------
    pressure : str
        Channel of the pressure.
    static : {"bilinear", "petrovic", "minh", "schindele"}, optional
        Law identified with the friction, or None.
    elements : {"eleven", "eleven-released", "each-way", "eighteen"} or sequence of directions
        The paper's two structures, "eleven" and "eighteen", the former also with elements that let go
        at once where they are inactive; "each-way", also of eleven parameters, with one shared element,
        one for lengthening and one for shortening; or the direction of every element: "shared",
        "both", "lengthening", "shortening" or "shortening-released".
    """

    purpose = "force"
    inverse_kind = "exact"
    needs_time = True
    made_for = ("length", "force")
    input_settings = ("pressure",)
    rises = False
    searches_condensed = False
    bounds_linear = True  # stiffnesses have lower bounds
    # where elements begin to slip makes corners in the cost, which take many short steps
    search_evaluations = 20
    polish_evaluations = 20

    initial = "virgin"
    pressure: str = "pressure"
    static: Law | None = "bilinear"
    elements: Structure | tuple[Direction, ...] = "eleven"
    nonnegative = False
    n_starts = 64
    n_refined = 8

    @property
    def directions(self) -> tuple[Direction, ...]:
        """The direction of each element."""
        if isinstance(self.elements, str):
            return STRUCTURES[self.elements]
        return tuple(self.elements)

    @property
    def _n_pairs(self) -> list[int]:
        """Number of break-away length and relaxation time pairs of each element."""
        return [2 if direction in ("shared", "both") else 1 for direction in self.directions]

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of the nonlinear parameters, theta.

        The break-away length F_c / k and the relaxation time sigma / k determine the deflection of an
        element; its force is k times that. So theta is the logarithms of these lengths and times,
        element by element, lengthening first.
        """
        lengths = np.log(data.input_span * np.array([0.005, 2.0]))
        times = np.log(data.timed() * np.array([1e-2, 20.0]))
        pairs = np.tile([lengths, times], (sum(self._n_pairs), 1))
        return pairs[:, 0], pairs[:, 1]

    def guesses(self, data: TrainingData) -> list[Array]:
        """Return initial elements that slip early and late, with short relaxation times."""
        time, elements = np.log(0.1 * data.timed()), np.arange(len(self.directions))
        guesses = []
        for first, ratio in product((0.5, 0.25, 0.1), (0.7, 0.4, 0.2)):
            lengths = np.repeat(np.log(data.input_span * first * ratio**elements), self._n_pairs)
            guesses.append(np.column_stack([lengths, np.full(lengths.size, time)]).ravel())
        return guesses

    def choices(self, data: TrainingData) -> list[Choice]:
        """Return candidate lengths and times of one element at a time.

        The cost has many local minima, in which elements have changed roles, and rounding decides in
        which of them a search ends.
        """
        lengths = np.log(data.input_span * EXCHANGE_LENGTHS)
        times = np.log(data.timed() * np.array(EXCHANGE_TIMES))
        choices = []
        for index, n_pairs in enumerate(self._n_pairs):
            candidates = [
                np.ravel([(length, time) for length in element])
                for time, element in product(times, product(lengths, repeat=n_pairs))
            ]
            choices.append(Choice(self._theta_indices(index), np.array(candidates)))
        return choices

    def _theta_indices(self, index: int) -> NDArray[np.intp]:
        """Return the indices in theta of the lengths and times of an element."""
        first, n_pairs = sum(self._n_pairs[:index]), self._n_pairs[index]
        return np.arange(2 * first, 2 * (first + n_pairs))

    def _unit_element(self, index: int, theta: Array) -> MultistateFriction:
        """Return one element with stiffnesses of 1."""
        direction = self.directions[index]
        pairs = np.exp(theta[self._theta_indices(index)]).reshape(-1, 2).tolist()
        # k, sigma and F_c lengthening, then shortening: with k = 1, sigma is the time, F_c the length
        six = [value for length, time in (pairs[0], pairs[-1]) for value in (1.0, time, length)]
        values = tuple(six[position] for position in PARAMETER_POSITIONS[direction])
        return MultistateFriction((direction,), values, initial=self.starting_rule)

    def _forces(self, theta: Array, run: Run) -> Array:
        """Return the forces per unit of stiffness over the run, shape (n, n_stiffnesses)."""
        lengthening = np.diff(run.u, prepend=run.u[0]) >= 0
        columns = []
        for index, direction in enumerate(self.directions):
            element = self._unit_element(index, theta)
            force = element.simulate(run.inputs, sample_time=run.sample_time)[:, 0]
            both_ways = direction == "both"
            columns += [force * lengthening, force * ~lengthening] if both_ways else [force]
        return np.column_stack(columns)

    @property
    def n_stiffnesses(self) -> int:
        """Number of linear parameters of the friction: two for elements in both directions."""
        return len(self.directions) + self.directions.count("both")

    def friction(self, theta: Array, stiffnesses: Array, data: TrainingData) -> MultistateFriction:
        """Return the friction model; each parameter of a unit element times its stiffness."""
        values, remaining = [], iter(stiffnesses.tolist())
        for index, direction in enumerate(self.directions):
            lengthening = next(remaining)
            shortening = next(remaining) if direction == "both" else lengthening
            unit = self._unit_element(index, theta).values
            for position, value in zip(PARAMETER_POSITIONS[direction], unit, strict=True):
                values.append(value * (lengthening if position < 3 else shortening))
        pressure, rule = float(np.median(data.stacked("scheduled"))), self.starting_rule
        channels = self.channels(data)
        return MultistateFriction(
            self.directions, tuple(values), 0.0, pressure, initial=rule, **channels
        )

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        """Return the forces of the elements, then the regressors of the static law."""
        forces = self._forces(theta, run)
        if self.static is None:
            return forces
        return np.column_stack([forces, force_columns(self.static, run, data)])

    @property
    def fits_offset(self) -> bool:
        """Whether there is a constant: that of the static law."""
        return self.static is not None

    def lower_bounds(self, matrix: Array, data: TrainingData) -> Array:
        """Return the smallest stiffnesses, for which every element has some force."""
        largest = np.maximum(np.abs(matrix).max(axis=0), 1e-300)
        floor = np.asarray(LEAST_SHARE * np.ptp(data.target) / largest)
        floor[self.n_stiffnesses :] = -np.inf
        return floor

    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> Block:
        """Return the friction, with the static law if there is one."""
        n = self.n_stiffnesses
        friction = self.friction(theta, linear[:n], data)
        if self.static is None:
            return friction
        law = force_law(self.static, linear[n:], offset, data, self.channels(data))
        return Parallel((law, friction))

    def identify(self, data: TrainingData, tracker: Tracker) -> Block:
        """Return the model; of the eighteen parameters and the eleven the better: more are never worse.

        Eleven are eighteen of which two elements have no F_c lengthening, which no search over positive
        ones comes to.
        """
        if self.elements != "eighteen":
            return super().identify(data, tracker)
        # given as directions, not by name, eighteen are fitted above without comparison
        return self.best_of("elements", ("eleven", EIGHTEEN), data, tracker)


class EachWayMultistateEstimator(MultistateEstimator):
    """Multistate friction with one shared element and one for each direction: eleven parameters."""

    title = "Multistate friction (three elements)"
    can = (
        "Friction force with elements for each direction of motion, rate included, integrated"
        " exactly."
    )
    cannot = "Needs a static force law; compensated by feedforward only."
    effort = 3.0
    elements = "each-way"


class Multistate11Estimator(MultistateEstimator):
    """Multistate friction by bounded least squares from many starts, and exchange of elements."""

    title = "Multistate friction with eleven parameters"
    can = "The paper's friction model of eleven parameters."
    cannot = "Its structure is that of the paper's muscle; try multistate for others."


class Multistate18Estimator(MultistateEstimator):
    """Multistate friction with three elements in both directions: eighteen parameters."""

    title = "Multistate friction with eighteen parameters"
    can = "The paper's friction model of eighteen parameters; of eleven where these fit better."
    cannot = "Its structure is that of the paper's muscle; many parameters are poorly determined."
    elements = "eighteen"
