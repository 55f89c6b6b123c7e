"""Identification of multistate friction, alone or on top of a static force law."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Ge, Interval
from numpy.typing import NDArray

from mckibben.blocks.base import Block
from mckibben.blocks.compose import Parallel
from mckibben.blocks.fields import Channel, vector
from mckibben.blocks.force.law import ForceLaw
from mckibben.blocks.force.multistate_friction import (
    EACH_WAY,
    EIGHTEEN,
    ELEVEN,
    SIZES,
    Direction,
    MultistateFriction,
)
from mckibben.errors import DataError
from mckibben.estimators.data import Run, TrainingData
from mckibben.estimators.force.static import force_columns, force_law
from mckibben.estimators.search import Tracker
from mckibben.estimators.separable import SeparableEstimator
from mckibben.recording import Recording

Array = NDArray[np.float64]

Structure = Literal["eleven", "each-way", "eighteen"]
STRUCTURES = {"eleven": ELEVEN, "each-way": EACH_WAY, "eighteen": EIGHTEEN}
ORDERS = {"bilinear": (1, 2), "petrovic": (2, 2), "minh": (3, 3), "schindele": (3, 4)}


def extract_hysteresis(
    recordings: Recording | Sequence[Recording],
    law: ForceLaw,
    *,
    output: str = "force_hysteresis",
) -> list[Recording]:
    """Return recordings with what a static law leaves of the force: f_h = f - f_st.

    Source: "A Multistate Friction Model for the Compensation of the Asymmetric Hysteresis in the
    Mechanical Response of Pneumatic Artificial Muscles", Eq. (2).

    Parameters
    ----------
    recordings : Recording or sequence of Recording
        Isobaric runs with length, pressure and force.
    law : ForceLaw
        Static force, identified from isometric runs.
    output : str
        Name of the new channel [N].

    Raises
    ------
    DataError
        Where a channel that the law needs is absent.
    """
    listed = [recordings] if isinstance(recordings, Recording) else list(recordings)
    force = law.outputs[0].name
    found = []
    for recording in listed:
        static = law.simulate(recording)[force]
        left = recording[force] - static
        found.append(recording.with_channels({output: "N"}, **{output: left}))
    return found


@dataclass(kw_only=True, repr=False, eq=False)
class MultistateEstimator(SeparableEstimator):
    """Multistate friction by bounded least squares from many starts.

    Every value is searched on its logarithm. A static law beside it is linear, so it is solved for; with
    ``static="none"`` the output is taken to be the hysteresis alone, as the paper does after
    `extract_hysteresis`.

    Parameters
    ----------
    pressure : str
        Channel of the pressure.
    static : {"none", "bilinear", "petrovic", "minh", "schindele"}
        Law identified with the friction.
    elements : {"eleven", "each-way", "eighteen"} or sequence of directions
        The paper's two structures; ours, of eleven parameters too, with one element shared, one for
        lengthening and one for shortening; or one direction an element ("shared", "both",
        "lengthening", "shortening").
    fit_pressure_gain : bool
        Whether friction may grow with pressure; wants recordings at several pressures.
    """

    input: str = "length"
    output: str = "force"
    initial: Literal["first_sample", "virgin", "fitted"] = "virgin"
    pressure: str = "pressure"
    static: Literal["none", "bilinear", "petrovic", "minh", "schindele"] = "bilinear"
    elements: Structure | tuple[Direction, ...] = "eleven"
    fit_pressure_gain: bool = False
    nonnegative: bool = False
    n_starts: Annotated[int, Ge(1)] = 128
    n_refined: Annotated[int, Interval(ge=1)] = 12

    made_for: ClassVar[tuple[str, str] | None] = ("length", "force")
    rises: ClassVar[bool] = False
    searches_condensed: ClassVar[bool] = False

    @property
    def scheduling(self) -> tuple[str, ...]:
        """Pressure."""
        return (self.pressure,)

    @property
    def directions(self) -> tuple[Direction, ...]:
        """What each element is."""
        if isinstance(self.elements, str):
            return STRUCTURES[self.elements]
        return tuple(self.elements)

    def identify(self, data: TrainingData, tracker: Tracker) -> tuple[Block, TrainingData]:
        """Return the block found, and the data with the memories at the start that belong to it."""
        if data.sample_time is None:
            raise DataError(
                "the recordings have no time, and friction depends on rate",
                remedy="read them with a time column or --rate",
            )
        return super().identify(data, tracker)

    # theta is log values, element by element, then the pressure gain if it is fitted

    def _scales(self, data: TrainingData) -> tuple[float, float, float]:
        """Return a usual stiffness [N/mm], damping [N s/mm] and limit [N]."""
        low, high = data.input_range
        bottom, top = data.output_range
        limit = 0.5 * (top - bottom) if self.static == "none" else 0.15 * (top - bottom)
        stiffness = limit / (0.25 * (high - low))
        return stiffness, stiffness * (data.sample_time or 1.0), limit

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of the logarithms."""
        k, sigma, limit = np.log(self._scales(data))
        lower, upper = [], []
        for element in self.directions:
            kinds = "ksfsf" if element == "shared" else "ksf" * (SIZES[element] // 3)
            for kind in kinds:
                middle = {"k": k, "s": sigma, "f": limit}[kind]
                down, up = {"k": (3, 6), "s": (7, 5), "f": (6, 2)}[kind]
                lower.append(middle - down)
                upper.append(middle + up)
        if self.fit_pressure_gain:
            lower.append(-0.5)
            upper.append(1.0)
        return np.array(lower), np.array(upper)

    def guesses(self, data: TrainingData) -> list[Array]:
        """Return elements that share the friction, and slip one after another."""
        k, sigma, limit = self._scales(data)
        lower, upper = self.bounds(data)
        guesses = []
        for ratio in (1.0, 3.0):
            for quick in (1.0, 4.0):
                theta: list[float] = []
                for place, element in enumerate(self.directions):
                    share = 1.0 if place == 0 else 0.3 / place
                    stiff = quick * k * share * ratio ** (place * 0.5)
                    numbers = [stiff, sigma, limit * share]
                    own = [*numbers, *numbers] if element == "both" else numbers
                    if element == "shared":
                        own = [*numbers, sigma, limit * share]
                    theta += np.log(own).tolist()
                if self.fit_pressure_gain:
                    theta.append(0.1)
                guesses.append(np.clip(theta, lower, upper))
        return guesses

    def friction(self, theta: Array, data: TrainingData) -> MultistateFriction:
        """Return the friction."""
        n = sum(SIZES[element] for element in self.directions)
        pressures = np.concatenate([run.scheduled[:, 0] for run in data.runs])
        return MultistateFriction(
            self.directions,
            vector(np.exp(theta[:n])),
            float(theta[n]) if self.fit_pressure_gain else 0.0,
            float(np.median(pressures)),
            self.starting_rule,
            **self.channels(data),
        )

    def channels(self, data: TrainingData) -> dict[str, Channel]:
        """Return length, pressure and force."""
        pressure = Channel(data.scheduling[0], data.scheduling_units[0])
        return super().channels(data) | {"pressure": pressure}

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        """Return the friction, then what the static law's coefficients multiply."""
        friction = self.friction(theta, data).simulate(run.inputs, sample_time=run.sample_time)
        if self.static == "none":
            return friction
        length, pressure = run.inputs.T
        columns = force_columns(length, pressure, ORDERS[self.static], data.input_range)
        return np.column_stack([friction, columns])

    def _solve_for(self, matrix: Array, data: TrainingData) -> tuple[Array, float]:
        """Solve for the static law alone: the friction comes with a weight of 1."""
        target = data.target - matrix[:, 0]
        if self.static == "none":
            return np.ones(1), 0.0
        columns = np.column_stack([np.ones(len(matrix)), matrix[:, 1:]])
        size = np.linalg.norm(columns, axis=0)
        size[size == 0] = 1.0
        # several runs at one pressure leave the law undetermined; the smallest is then as good as any
        found = np.linalg.lstsq(columns / size, target, rcond=1e-9)[0] / size
        return np.append(1.0, found[1:]), float(found[0])

    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> Block:
        """Return the friction, with the static law beside it if there is one."""
        friction = self.friction(theta, data)
        if self.static == "none":
            return friction
        orders = ORDERS[self.static]
        law = force_law(linear[1:], offset, orders, data.input_range, self.channels(data))
        return Parallel((law, friction))

    def parameter_bounds(self, data: TrainingData) -> tuple[Block, Array, Array]:
        """Return the block of the first guess, and bounds about it that keep it valid."""
        theta = self.guesses(data)[0]
        template = self.build(theta, *self._solve(theta, data), data)
        lower, upper = self.bounds(data)
        n = sum(SIZES[element] for element in self.directions)
        values = template.pack()
        span = np.maximum(np.abs(values), 1e-3 * np.abs(values).max())
        below, above = values - span, values + span
        start = values.size - theta.size
        below[start : start + n], above[start : start + n] = np.exp(lower[:n]), np.exp(upper[:n])
        below[start + n :], above[start + n :] = lower[n:], upper[n:]
        return template, below, above


@dataclass(kw_only=True, repr=False, eq=False)
class MultistateEighteenEstimator(MultistateEstimator):
    """Multistate friction with three elements in both directions: eighteen parameters."""

    elements: Structure | tuple[Direction, ...] = "eighteen"


@dataclass(kw_only=True, repr=False, eq=False)
class MultistateEachWayEstimator(MultistateEstimator):
    """Multistate friction with one shared element and one for each direction: eleven parameters."""

    elements: Structure | tuple[Direction, ...] = "each-way"
