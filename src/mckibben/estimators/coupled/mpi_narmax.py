"""Identification of MPI-NARMAX: rate-dependent hysteresis, then a recurrent network with the load.

Two steps: the hysteresis on the runs without load; then the network, which takes in the hysteresis, the
measured force, and its own past output, running free.

Source: "High-Precision Displacement and Force Hybrid Modeling of Pneumatic Artificial Muscle Using 3D
PI-NARMAX Model", Sections 3 and 4.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Gt, Interval
from numpy.typing import NDArray

from mckibben import registry
from mckibben.blocks.base import Block
from mckibben.blocks.compose import Series
from mckibben.errors import DataError
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.coupled.base import CoupledEstimator
from mckibben.estimators.coupled.fuzzy import Sets
from mckibben.estimators.coupled.recurrent_fit import RecurrentProblem, Shape
from mckibben.estimators.optimisers.tracker import Tracker, whole_searches
from mckibben.recording import Recording

UNLOADED = 0.05
"""A run is without load where its largest stays below this share of the largest of all runs."""


@dataclass(kw_only=True, repr=False, eq=False)
class MPINarmaxEstimator(CoupledEstimator):
    """Rate-dependent hysteresis and a recurrent fuzzy network scheduled by force.

    Parameters
    ----------
    n_sets : int
        Of every regressor.
    output_lags, input_lags, scheduling_lags : int
        n_a, n_b and n_c.
    memory : {"mpi", "rdpi"}
        Hysteresis in front: without rate, or with weights by rate as in the paper. It is identified on
        all runs without load, or on the one under the least: weights by rate need runs of several
        rates, since along one sine the rate follows from place and direction.
    learns_from : {"all", "loaded"}
        Runs that the network learns from: all, or as in the paper those under a load only.
    constants : bool
        Whether a consequent has a constant; the paper's fourth layer has none.
    method : {"pso", "ls"}
        Antecedents and feedbacks by the paper's particle swarm; or even and none. Consequents by least
        squares always.
    ridge : float
        Damping of what is a rule's own.
    """

    title = "MPI in a recurrent fuzzy network (MPI–NARMAX)"
    can = "Hysteresis under a load that varies, by a recurrent fuzzy network behind a modified PI."
    cannot = "No inverse; nothing keeps the network sensible under other pulls."
    caution = "its network is arbitrary under loads and motions of another kind"
    effort: ClassVar[float] = 6.0

    most_inputs: ClassVar[float] = 1

    n_sets: Annotated[int, Interval(ge=1, le=4)] = 3
    output_lags: Annotated[int, Interval(ge=1, le=3)] = 1
    input_lags: Annotated[int, Interval(ge=0, le=3)] = 0
    scheduling_lags: Annotated[int, Interval(ge=0, le=3)] = 0
    memory: Literal["mpi", "rdpi"] = "mpi"
    learns_from: Literal["all", "loaded"] = "all"
    constants: bool = True
    method: Literal["pso", "ls"] = "pso"
    ridge: Annotated[float, Gt(0)] = 1e-4

    def identify(self, data: TrainingData, tracker: Tracker) -> Block:
        """Return the series of hysteresis and network."""
        if len(data.inputs) != 1 or not data.scheduled:
            raise DataError(
                f"there are {len(data.inputs)} inputs and {len(data.scheduled)} loads",
                remedy="give recordings of one muscle, with a channel force",
            )
        if len({run.sample_time for run in data.runs}) > 1 or data.runs[0].sample_time is None:
            raise DataError("the runs differ in sample time", remedy="resample them to one")
        tracker.reached(0.0)
        free, loaded = _parted(data)
        hysteresis = self.hysteresis(free)
        known = loaded if self.learns_from == "loaded" and loaded.runs else data
        shape = Shape(
            self.n_sets,
            self.output_lags,
            self.input_lags,
            self.scheduling_lags,
            self.constants,
            self.ridge,
        )
        problem = RecurrentProblem.of(shape, known, hysteresis)
        low, high = problem.ranges
        even = Sets.even(low, high, self.n_sets)
        still = np.zeros_like(even.centres)
        chosen = (even, still)
        if self.method == "pso":
            chosen = problem.swarm(even, self.seed, tracker)
        tracker.reached(0.9)
        network = problem.best(*chosen)
        return Series((hysteresis, network))

    def hysteresis(self, data: TrainingData) -> Block:
        """Return the hysteresis from runs without load."""
        u, y = data.inputs[0], data.outputs[0]
        free = f"{y.name}_free"
        recordings = [
            Recording(
                {u.name: run.driven[:, 0], free: run.outputs[:, 0]},
                run.sample_time,
                {u.name: u.unit, free: y.unit},
            )
            for run in data.runs
        ]
        settings = {"input": u.name, "output": free, "seed": self.seed}
        if self.memory == "rdpi":
            settings["rate_time_constant"] = 5.0 * (data.runs[0].sample_time or 0.0)
        estimator = registry.load("estimators", self.memory)(**settings)
        with whole_searches():
            block: Block = estimator.fit(recordings).model_
        return block


def _parted(data: TrainingData) -> tuple[TrainingData, TrainingData]:
    """Return the runs without load, at least the one under the least, and all others."""
    largest = np.array([np.abs(run.scheduled).max(axis=0) for run in data.runs])
    shares = (largest / np.maximum(largest.max(axis=0), 1e-300)).max(axis=1)
    free = shares <= max(UNLOADED, float(shares.min()))

    def those(wanted: NDArray[np.bool_]) -> TrainingData:
        runs = tuple(run for run, is_one in zip(data.runs, wanted, strict=True) if is_one)
        return replace(data, runs=runs)

    return those(free), those(~free)
