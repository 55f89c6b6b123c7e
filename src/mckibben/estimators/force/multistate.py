"""Identification of multistate friction, alone or on top of a static force law."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Ge, Interval

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.compose import Parallel
from mckibben.blocks.force.multistate_friction import (
    EACH_WAY,
    EIGHTEEN,
    ELEVEN,
    PLACES,
    Direction,
    MultistateFriction,
)
from mckibben.estimators.core.data import Run, TrainingData
from mckibben.estimators.core.separable import SeparableEstimator
from mckibben.estimators.force.laws import ORDERS, Law, force_columns, force_law
from mckibben.estimators.optimisers.tracker import Tracker
from mckibben.presets import preset
from mckibben.recording import Recording, listed

Structure = Literal["eleven", "each-way", "eighteen"]
STRUCTURES = {"eleven": ELEVEN, "each-way": EACH_WAY, "eighteen": EIGHTEEN}
LEAST_SHARE = 1e-5
"""Smallest force of an element, relative to the range of the output."""


def extract_hysteresis(
    recordings: Recording | Sequence[Recording],
    law: Block,
    *,
    output: str = "force_hysteresis",
) -> list[Recording]:
    """Return recordings with the residual of a static law as output: f_h = f - f_st.

    Source: "A Multistate Friction Model for the Compensation of the Asymmetric Hysteresis in the
    Mechanical Response of Pneumatic Artificial Muscles", Eq. (2).

    Parameters
    ----------
    recordings : Recording or sequence of Recording
        Isobaric runs with length, pressure and force.
    law : Block
        Of one output, as a static force law identified from isometric runs.
    output : str
        Name of the new channel, in the unit of the output.

    Raises
    ------
    DataError
        Where a channel that the law needs is absent.
    """
    (force,) = law.outputs
    found = []
    for recording in listed(recordings):
        left = recording[force.name] - law.simulate(recording)[force.name]
        found.append(recording.with_channels({output: force.unit}, **{output: left}))
    return found


@dataclass(kw_only=True, repr=False, eq=False)
class MultistateEstimator(SeparableEstimator):
    """Multistate friction by bounded least squares from many starts.

    Break-away lengths and relaxation times are searched; stiffnesses, and a static law, are solved
    for. With ``static=None`` the output is taken to be the hysteresis alone, as the paper does
    after `extract_hysteresis`.

    Parameters
    ----------
    pressure : str
        Channel of the pressure.
    static : {"bilinear", "petrovic", "minh", "schindele"}, optional
        Law identified with the friction, or None.
    elements : {"eleven", "each-way", "eighteen"} or sequence of directions
        The paper's two structures; ours, of eleven parameters too, with one element shared, one for
        lengthening and one for shortening; or one direction an element ("shared", "both",
        "lengthening", "shortening").
    """

    purpose = "force"
    inverse_kind = "exact"
    needs_time: ClassVar[bool] = True

    input: str = "length"
    output: str = "force"
    initial: Literal["first_sample", "virgin"] = "virgin"
    pressure: str = "pressure"
    static: Law | None = "bilinear"
    elements: Structure | tuple[Direction, ...] = "eleven"
    nonnegative: bool = False
    n_starts: Annotated[int, Ge(1)] = 64
    n_refined: Annotated[int, Interval(ge=1)] = 8

    made_for: ClassVar[tuple[str, str] | None] = ("length", "force")
    input_settings: ClassVar[tuple[str, ...]] = ("pressure",)
    rises: ClassVar[bool] = False
    searches_condensed: ClassVar[bool] = False
    # where elements begin to slip makes corners in the cost, which take many short steps
    search_evaluations: ClassVar[int] = 20
    polish_evaluations: ClassVar[int] = 20

    @property
    def directions(self) -> tuple[Direction, ...]:
        """The direction of each element."""
        if isinstance(self.elements, str):
            return STRUCTURES[self.elements]
        return tuple(self.elements)

    def identify(self, data: TrainingData, tracker: Tracker) -> Block:
        data.timed("friction depends on rate")
        return super().identify(data, tracker)

    # An element's deflection follows from how far it goes before it slips, F_c / k, and from the time
    # sigma / k in which it relaxes; its force is k times that. So theta is the logarithms of these
    # lengths and times, element by element, lengthening first; the stiffnesses are
    # linear.

    def _pairs(self) -> list[int]:
        """Return the number of length and time pairs of each element."""
        return [2 if element in ("shared", "both") else 1 for element in self.directions]

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of the logarithms."""
        low, high = data.input_range
        lengths = np.log((high - low) * np.array([0.005, 2.0]))
        times = np.log((data.sample_time or 1.0) * np.array([1e-2, 20.0]))
        pairs = np.tile([lengths, times], (sum(self._pairs()), 1))
        return pairs[:, 0], pairs[:, 1]

    def guesses(self, data: TrainingData) -> list[Array]:
        """Return initial elements that slip early and late, without delay."""
        low, high = data.input_range
        time = np.log(0.1 * (data.sample_time or 1.0))
        guesses = []
        for first in (0.5, 0.25, 0.1):
            for ratio in (0.7, 0.4, 0.2):
                theta: list[float] = []
                for place, pairs in enumerate(self._pairs()):
                    length = np.log((high - low) * first * ratio**place)
                    theta += [length, time] * pairs
                guesses.append(np.array(theta))
        return guesses

    def _unit(self, place: int, theta: Array) -> MultistateFriction:
        """Return one element with stiffnesses of 1."""
        pairs = self._pairs()
        first, element = 2 * sum(pairs[:place]), self.directions[place]
        ways = np.exp(theta[first : first + 2 * pairs[place]]).reshape(-1, 2).tolist()
        (length, time), (other, later) = ways[0], ways[-1]
        six = (1.0, time, length, 1.0, later, other)
        values = tuple(six[value] for value in PLACES[element])
        return MultistateFriction((element,), values, initial=self.starting_rule)

    def _forces(self, theta: Array, run: Run) -> Array:
        """Return the force of every element per unit of its stiffnesses, over the run."""
        length = run.u
        rising = np.diff(length, prepend=length[0]) >= 0
        columns = []
        for place, element in enumerate(self.directions):
            force = self._unit(place, theta).simulate(run.inputs, sample_time=run.sample_time)[:, 0]
            columns += [force * rising, force * ~rising] if element == "both" else [force]
        return np.column_stack(columns)

    @property
    def n_stiffnesses(self) -> int:
        """Number of linear parameters of the friction."""
        return sum(2 if element == "both" else 1 for element in self.directions)

    def friction(self, theta: Array, stiffnesses: Array, data: TrainingData) -> MultistateFriction:
        """Return the friction."""
        values, given = [], iter(stiffnesses.tolist())
        for place, element in enumerate(self.directions):
            ways = [next(given) for _ in range(2 if element == "both" else 1)] * 2
            unit = zip(PLACES[element], self._unit(place, theta).values, strict=True)
            values += [ways[slot // 3] * value for slot, value in unit]
        return MultistateFriction(
            self.directions,
            tuple(values),
            0.0,
            float(np.median(data.stacked("scheduled"))),
            self.starting_rule,
            **self.channels(data),
        )

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        """Return the forces of the elements, then the regressors of the static law."""
        friction = self._forces(theta, run)
        if self.static is None:
            return friction
        length, pressure = run.inputs.T
        columns = force_columns(length, pressure, ORDERS[self.static], data.input_range)
        return np.column_stack([friction, columns])

    @property
    def solves_nonnegative(self) -> bool:
        """Whether linear parameters have lower bounds: those of the friction do."""
        return True

    @property
    def solves_offset(self) -> bool:
        """Whether there is a constant: that of the static law."""
        return self.static is not None

    def least(self, matrix: Array, data: TrainingData) -> Array:
        """Return the smallest stiffnesses, with which every element has some force."""
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
        orders = ORDERS[self.static]
        law = force_law(linear[n:], offset, orders, data.input_range, self.channels(data))
        return Parallel((law, friction))


MULTISTATE = preset(
    MultistateEstimator,
    "Multistate friction with one shared element and one for each direction: eleven parameters.",
    title="Multistate friction (three elements)",
    can=(
        "Friction force with elements for each direction of motion, rate included, integrated"
        " exactly."
    ),
    cannot="Needs a static force law; compensated by feedforward only.",
    elements="each-way",
    effort=3.0,
)

MULTISTATE_11 = preset(
    MultistateEstimator,
    "Multistate friction by bounded least squares from many starts.",
    title="Multistate friction with eleven parameters",
    can="The paper's friction model of eleven parameters.",
    cannot="Structure of the paper's muscle; multistate selects one for yours.",
    elements="eleven",
)

MULTISTATE_18 = preset(
    MultistateEstimator,
    "Multistate friction with three elements in both directions: eighteen parameters.",
    title="Multistate friction with eighteen parameters",
    can="The paper's friction model of eighteen parameters.",
    cannot="Structure of the paper's muscle; many parameters are hardly determined.",
    elements="eighteen",
)
