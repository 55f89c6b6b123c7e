"""Identification of state-space networks: Gauss-Newton on free runs, from a linear oscillator.

The first two states begin as displacement and velocity of the linear oscillator nearest to the data;
others as lags of the velocity; units begin at random, and next to unread. What the states become is
left to the descent, whose derivatives are exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice
from typing import Annotated, Any, ClassVar, cast

import numpy as np
from annotated_types import Interval

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.dynamics.state_network import SETTLING, SETTLING_STEP, StateNetwork
from mckibben.blocks.fields import rows
from mckibben.errors import DataError, ModelError
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.single import SingleEstimator
from mckibben.estimators.core.uncertainty import relative_sizes, told_by_runs
from mckibben.estimators.dynamics.linear_oscillator import (
    MOST_SUBSTEPS,
    Linear,
    linear_oscillator,
)
from mckibben.estimators.dynamics.paths import averaged, paths
from mckibben.estimators.dynamics.state_network_slopes import follow_network
from mckibben.estimators.optimisers.descent import Damping, descend, marquardt
from mckibben.estimators.optimisers.tracker import Tracker

ANGLE = 1 / 3
"""Of the linear oscillator in a substep, at most [rad]."""

SPRING, DAMPING, LAG = 0.5, 0.1, 0.3
"""Of a start, in units of the linear oscillator: what pulls the displacement back beside lags of the
velocity, what damps, and how fast the first lag dies away."""

UNIT, FORCED, READ = 0.7, 0.05, 0.01
"""Sizes of random weights: of units by states, by the input, and of what is read of them."""

FIRST_DAMPING, HEAVIEST, EASING, FLOOR = 0.1, 1e9, 2.0, 1e-6

LEAST_GAIN = 1e-7
"""Share of the squared error that a step gains, or the descent has arrived."""


@dataclass(kw_only=True, repr=False, eq=False)
class StateNetworkEstimator(SingleEstimator):
    """State-space network by Gauss-Newton on free runs, told nothing but how many states there are.

    Parameters
    ----------
    n_states, n_units : int
        Of the model.
    n_steps : int
        Most steps of the descent, each of which costs about as much as n_states runs of all weights.
    periodic : bool
        Whether every recording is a whole number of periods of a motion that repeats itself; see
        `mckibben.estimators.hysteresis.oscillators.OscillatorEstimator`.
    substeps : int, optional
        Runge-Kutta steps from sample to sample. Default: enough that the linear oscillator turns by
        no more than 1/3 rad in each.
    """

    title = "State-space network"
    purpose = "rate"
    can = (
        "Nonlinear dynamics with memory of any kind, from force to displacement, told nothing"
        " but the number of states."
    )
    cannot = "Slow to fit; no inverse; nothing keeps it sensible beyond the data."
    caution = "a network without physics is arbitrary beyond them"
    needs_time: ClassVar[bool] = True

    input: str = "force"
    output: str = "displacement"
    n_states: Annotated[int, Interval(ge=2, le=10)] = 3
    n_units: Annotated[int, Interval(ge=1, le=100)] = 10
    n_steps: Annotated[int, Interval(ge=1, le=10_000)] = 200
    periodic: bool = False
    substeps: Annotated[int, Interval(ge=1, le=MOST_SUBSTEPS)] | None = None

    made_for: ClassVar[tuple[str, str] | None] = ("force", "displacement")
    rises: ClassVar[bool] = False
    effort: ClassVar[float] = 100.0

    def identify(self, data: TrainingData, tracker: Tracker) -> tuple[Block, TrainingData]:
        step = data.timed()
        if self.initial == "fitted":
            raise ModelError(
                "starts of state-space networks are not fitted. Remedy: use recordings that begin at "
                "rest, or periodic=true and whole periods of a motion that repeats itself."
            )
        linear = linear_oscillator(data, self.channels(data))
        self._warm = linear.forgets(data)
        merged = averaged(data) if self.periodic else data
        template = self.start(linear, merged, self.substeps or linear.substeps(step, ANGLE))
        search = self.search(template, merged, tracker)
        tracker.budget = self.n_steps
        path = descend(
            search.errors,
            search.slopes,
            template.pack(),
            Damping(FIRST_DAMPING, HEAVIEST, easing=EASING, steps=partial(marquardt, floor=FLOOR)),
            least_gain=LEAST_GAIN,
        )
        with tracker.searching():
            for _, squares in islice(path, self.n_steps + 1):
                if not np.isfinite(squares):
                    raise DataError(
                        "no start runs stably under this force",
                        channel=data.input,
                        remedy="choose another seed, or record at a higher rate",
                    )
        assert tracker.best is not None
        return template.unpack(tracker.best), data

    def start(self, linear: Linear, data: TrainingData, substeps: int) -> StateNetwork:
        """Return the network that the descent begins with."""
        rng, n, units = np.random.default_rng(self.seed), self.n_states, self.n_units
        force, moved = data.stacked("driven")[:, 0], data.target
        sizes = float(np.std(force)), float(np.std(moved))
        channels: dict[str, Any] = self.channels(data)
        own = np.zeros((n, n + 2))
        own[0, 1] = 1.0
        own[1, : n + 1] = -SPRING if n > 2 else -1.0
        own[1, 1], own[1, n] = -DAMPING, sizes[0] / (linear.stiffness * sizes[1])
        for place in range(2, n):
            own[1, place] /= n - 2
            own[place, [1, place]] = 1.0, -LAG * (place - 1)
        hidden = UNIT * rng.normal(size=(units, n + 2))
        hidden[:, n] *= FORCED / UNIT
        return StateNetwork(
            linear=rows(own),
            hidden=rows(hidden),
            readout=rows(READ * rng.normal(size=(n, units))),
            rate=linear.frequency,
            input_offset=float(np.mean(force)) if self.periodic else 0.0,
            input_scale=sizes[0],
            output_offset=float(np.mean(moved)) if self.periodic else 0.0,
            output_scale=sizes[1],
            substeps=substeps,
            initial=self.starting_rule,
            **channels,
        )

    def search(self, template: StateNetwork, data: TrainingData, tracker: Tracker) -> NetworkRuns:
        """Return the errors of networks of one structure on all runs."""
        warm = self._warm if self.periodic else None
        at_rest = not self.periodic and self.starting_rule == "first_sample"
        return NetworkRuns(template, data, warm, at_rest, tracker)

    def free_runs(self, blocks: Sequence[Block], data: TrainingData) -> Array:
        """Return the outputs of blocks where samples count: in steady state, of periodic recordings."""
        if not self.periodic:
            return super().free_runs(blocks, data)
        networks = [cast("StateNetwork", block) for block in blocks]
        return np.array([self.search(n, data, Tracker()).outputs(n.pack()) for n in networks])

    def uncertainty(
        self, block: Block, data: TrainingData, residual: Array, at_bounds: Sequence[int]
    ) -> tuple[float, Array]:
        """Return the condition of the weights and their covariance, from exact derivatives."""
        network = cast("StateNetwork", block)
        merged = averaged(data) if self.periodic else data
        search = self.search(network, merged, Tracker())
        left = search.errors(network.pack())
        size = relative_sizes(network.pack())
        condition, own = told_by_runs(search.slopes(network.pack()) * size, left, merged.runs)
        return condition, own * np.outer(size, size)


class NetworkRuns:
    """Errors of networks on all runs, and their derivatives, which are computed with them.

    Parameters
    ----------
    template : StateNetwork
        Whose structure is searched.
    data : TrainingData
    warm : int or None
        Samples before those of a period; None where runs are not periodic.
    at_rest : bool
        Whether runs begin as after their first input has long been held, instead of with zeros.
    tracker : Tracker
        Told of the best.
    """

    def __init__(
        self,
        template: StateNetwork,
        data: TrainingData,
        warm: int | None,
        at_rest: bool,
        tracker: Tracker,
    ) -> None:
        self.template, self.target, self.tracker = template, data.target, tracker
        self.at_rest, self.rate = at_rest, template.rate * (data.sample_time or 1.0)
        self.paths = paths(data, template.substeps, warm, at_rest)

    def errors(self, theta: Array) -> Array:
        """Return the errors where samples count; infinite where a run leaves all bounds."""
        found = self.outputs(theta, slopes=True) - self.target
        self.tracker.saw(theta, float(np.sqrt(np.mean(found**2))))
        return found

    def slopes(self, theta: Array) -> Array:
        """Return the derivatives where errors were last asked for."""
        del theta
        return self._slopes

    def outputs(self, theta: Array, slopes: bool = False) -> Array:
        """Return the outputs where samples count; note their derivatives, if wanted."""
        model = self.template
        n, units = len(model.linear), len(model.hidden)
        sizes = n * (n + 2), units * (n + 2)
        weights: Any = np.split(theta, np.cumsum(sizes))
        linear, hidden, readout = (
            np.ascontiguousarray(part.reshape(count, -1))
            for part, count in zip(weights, (n, units, n), strict=True)
        )
        found, tables = [], []
        for path in self.paths:
            samples = path.run.u.size
            given, table = np.empty(samples), np.empty((samples if slopes else 0, theta.size))
            h, u = self.rate / path.every, (path.inputs - model.input_offset) / model.input_scale
            state, moved = np.zeros(n), np.zeros((n, theta.size))
            if self.at_rest:
                held, last = np.full(1 + SETTLING, u[0]), (np.empty(1), np.empty((1, theta.size)))
                follow_network(
                    linear, hidden, readout, SETTLING_STEP, state, moved, held, SETTLING, 0, *last
                )
            along = (u, path.every, path.skipped)
            ended = follow_network(linear, hidden, readout, h, state, moved, *along, given, table)
            if not ended or not np.isfinite(table).all():
                return np.full(self.target.size, np.inf)
            found.append(given[path.run.counts])
            tables.append(table[path.run.counts] if slopes else table)
        self._slopes = model.output_scale * np.concatenate(tables)
        return np.asarray(model.output_offset + model.output_scale * np.concatenate(found))
