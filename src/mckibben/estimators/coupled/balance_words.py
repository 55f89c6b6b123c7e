"""Notes on a fitted balance: responses that the recordings determine, and doubtful data.

A number varies as a step without each fifth of recordings finds it (jackknife), and as two displacements
do that the model misses. One that is not known within a factor of two is not said.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.coupled.balance_response import KINDS, Trial
from mckibben.blocks.running import run_many
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.coupled.balance_problem import at_rest, held
from mckibben.estimators.coupled.balance_search import Search
from mckibben.estimators.coupled.base import LOADS
from mckibben.numerals import numeral
from mckibben.statistics import NORMAL_95

POOR = 0.1
"""Relative error above which a note states that the model does not explain the recordings."""

WORSE = 3.0
"""Error of a recording, relative to the others, above which a note states it."""

AMPLITUDE, QUARTER = 0.25, 100
"""Amplitude of test loops, relative to the pressure range; samples in a quarter of one."""

DETERMINED = 0.25
"""Largest relative standard error of a number that is stated: a factor of two at 95 %."""


class Measured(NamedTuple):
    """A response of muscles: one of `KINDS`, of an input and an output, its standard error and unit."""

    kind: str
    place: int
    output: int
    value: float
    error: float
    unit: str


def trial_of(data: TrainingData) -> Trial:
    """Return test loops and steps like those of the recordings: within their ranges, half as long."""
    low, high, x = np.minimum(data.lowest, 0.0), data.highest, data.stacked("scheduled")
    loads = np.array([channel.unit in LOADS for channel in data.scheduled], dtype=bool)
    middles = np.where(loads, 0.5 * (x.min(axis=0) + x.max(axis=0)), np.median(x, axis=0))
    return Trial(
        data.inputs,
        data.scheduled,
        data.outputs,
        middle=np.append(0.5 * (low + high), middles),
        swing=np.append(AMPLITUDE * (high - low), 0.5 * loads * np.ptp(x, axis=0)),
        seconds=0.5 * max(len(run.outputs) * (run.sample_time or 0.0) for run in data.runs),
    )


def measured(
    search: Search, z: Array, others: list[Array], model: Callable[[Array], Block]
) -> tuple[Trial, list[Measured]]:
    """Return the test responses, and those that the recordings determine."""
    trial = trial_of(search.problem.data)
    if _faster(trial, search.problem.data):
        return trial, []

    def response(one: Array) -> Array:
        block = model(one)

        def respond(inputs: Array) -> Array:
            return run_many([block], inputs, sample_time=0.25 * trial.seconds / QUARTER or 1.0)[0]

        return trial.response(respond, QUARTER)

    value, *every = (response(one) for one in (z, *others))
    if len(every) < 2:
        return trial, []
    away, found = np.array(every) - np.mean(every, axis=0), []
    # a model knows no better what moves than it follows recordings
    reach, missed = value[KINDS.index("reach")], np.sqrt(2.0) * _missed(search, z)
    share = missed / reach
    follows = np.stack([share * reach, share * reach, share * value[2], 2.0 * share])
    error = np.sqrt((len(every) - 1) * (away**2).mean(axis=0) + follows**2)
    for place in np.flatnonzero(trial.swing).tolist():
        pressure, output = place < len(trial.pressures), int(np.argmax(value[0, place]))
        unit = trial.outputs[output].unit
        per = "" if pressure else f"{trial.others[place - len(trial.pressures)].unit}/{unit}"
        units = {"width": unit, "creep": ""} if pressure else {"stiffness": per}
        for kind, unit in units.items():
            at = KINDS.index(kind), place, output
            if 0.0 < error[at] <= DETERMINED * value[at]:
                number = Measured(kind, place, output, float(value[at]), float(error[at]), unit)
                found.append(number)
    return trial, found


def _faster(trial: Trial, data: TrainingData) -> bool:
    """Return whether test loops are faster than the recordings."""
    steps = [
        np.abs(np.diff(run.driven, axis=0)).max(axis=0) / run.sample_time
        for run in data.runs
        if run.sample_time is not None
    ]
    way = 4.0 * trial.swing[: len(trial.pressures)]
    return bool(steps and (way > trial.seconds * np.max(steps, axis=0)).any())


def _missed(search: Search, z: Array) -> Array:
    """Return the root mean square error of every output in motion, shape (m,)."""
    problem, structure = search.problem, search.structure
    errors = zip(problem.runs, problem.errors(structure, z)[0], strict=False)
    moved = [one for run, one in errors if not problem.still(run)] or [np.full(structure.m, np.nan)]
    whole = np.concatenate(moved).reshape(-1, structure.m)
    return np.asarray(structure.bench.travel * np.sqrt((whole**2).mean(axis=0)))


def said_of(trial: Trial, one: Measured) -> str:
    """Return a response as a sentence."""
    channel, output = (*trial.pressures, *trial.others)[one.place], trial.outputs[one.output]
    middle, swing = (numeral(v[one.place], 3) for v in (trial.middle, trial.swing))
    within = f" in {numeral(trial.seconds, 2)} s" if trial.seconds else ""
    half = NORMAL_95 * one.error
    loop = f"a loop of ± {swing} about {middle} {channel.unit}{within}"
    if one.kind == "creep":
        return (
            f"{channel.name}: of a step of {swing} from {middle} {channel.unit}, held for "
            f"{numeral(trial.seconds, 2)} s, {numeral(100.0 * one.value, 3)} ± "
            f"{numeral(100.0 * half, 2)} % (95 %) comes after the first second"
        )
    number = f"{numeral(one.value, 3)} ± {numeral(half, 2)} {one.unit}"
    if one.kind == "width":
        return f"{channel.name}: {loop} is {number} wide (95 %)"
    at = " and ".join(numeral(float(p), 3) for p in trial.middle[: len(trial.pressures)])
    return f"{output.name}: stiffness at {at} {trial.pressures[0].unit}, {loop}: {number} (95 %)"


def sentences(search: Search, z: Array, others: list[Array], balance: Balance) -> list[str]:
    """Return notes on recordings and loads."""
    return [*_of_runs(search, z), *_of_loads(search, z, others, balance)]


def _of_runs(search: Search, z: Array) -> list[str]:
    """Return notes on recordings with large errors, or another start."""
    problem, structure = search.problem, search.structure
    parts = problem.errors(structure, z)[0][: len(problem.runs)]
    sizes = np.array([float(np.sqrt(np.mean(part**2))) for part in parts])
    found = [
        f"the error of {run.name} is {size / np.median(np.delete(sizes, place)):.2g} times the median"
        for place, (run, size) in enumerate(zip(problem.runs, sizes.tolist(), strict=True))
        if len(sizes) > 1 and size > WORSE * np.median(np.delete(sizes, place))
    ]
    whole = float(np.sqrt(np.mean(sizes**2)))
    if whole > POOR:
        found.append(
            f"errors are {100 * whole:.2g} % of the range: this model does not explain these "
            "recordings: check channels, units, signs and zeros, recording by recording"
        )
    found += [
        f"{run.name} does not begin at rest: its first part does not count: begin recordings "
        "without pressure"
        for run in problem.runs
        if not (structure.settled or held(problem.data, run) or at_rest(problem.data, run))
    ]
    return found


def _of_loads(search: Search, z: Array, others: list[Array], balance: Balance) -> list[str]:
    """Return notes on estimated loads, and on loads that seem to push."""
    found: list[str] = []
    for j, channel in enumerate(balance.scheduled[balance.n_schedules :]):
        share = np.array(balance.loads)[:, j]
        if (share < 0.0).all():
            found.append(
                f"{channel.name} acts as if it helped the muscles: the larger it is, the further they "
                "move at equal pressures. If it pulls against them, its sign is wrong: give "
                "loads that pull muscles longer as positive"
            )
    listed = {}
    for run in search.problem.runs:
        place = search.problem.loads_at(search.structure, run)
        found_load, among = z[place], np.array([one[place] for one in others])
        unsure = 2.0 * np.sqrt(len(among)) * among.std(axis=0) if others else np.abs(found_load)
        if (np.abs(found_load) > unsure).any():
            each = (numeral(float(balance.areas[0][0] * one), 3) for one in found_load)
            listed[run.recording] = f"{' and '.join(each)} in {run.name}"
    if listed:
        unit = "N" if balance.areas[0][0] != 1.0 else f"{balance.given[0].unit} on the area at rest"
        found.append(
            f"constant loads that were not measured [{unit}], beyond those of the others: "
            f"{', '.join(listed.values())}: record the force of all"
        )
    return found
