"""Desired motions of the page Compensate: from the ranges and the pace of the recordings to a reference.

A motion is points of time and value for every reference channel. It begins as `default_motion`, is
changed by the controls of the page, and becomes the recording that a loop follows.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress

import numpy as np

from mckibben.app.compensators import block_for_use, cached_of_model, reference_channels
from mckibben.app.formulas import values
from mckibben.app.modelling import Json
from mckibben.app.workspace import Workspace
from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.fields import Channel
from mckibben.blocks.ranges import known_ranges
from mckibben.errors import DataError, MckibbenError
from mckibben.recording import REFERENCE, Recording

Points = list[tuple[float, float]]
"""Time [s] and value, times rising."""

MOTIONS = {"sine": "Sine", "triangle": "Triangle", "steps": "Staircase", "random": "Random"}

MOST_SAMPLES = 1_000_000
"""Most samples of a reference."""


# -- ranges and pace of the recordings --------------------------------------------------------------


def step_and_cycle(workspace: Workspace, name: str) -> tuple[float, float]:
    """Return time between steps, and of a cycle over the range at the speed of the recordings [s].

    Where these have no whole cycle, that is the time of the longest.

    Raises
    ------
    DataError
        If neither the model nor a recording in use has a sample time.
    """
    from mckibben.signals import cycles

    block = workspace.model(name)
    steps: list[float] = []
    seconds: list[float] = []
    strokes: list[float] = []
    ranges = {c.name: np.ptp(known_values(workspace, block, c.name)) for c in block.outputs}
    longest = 0.0
    for run in workspace.used().values():
        if run.sample_time:
            longest = max(longest, run.sample_time * len(run))
            steps.append(run.sample_time)
            for key in ranges.keys() & run.channels:
                with suppress(DataError):
                    for cycle in cycles(run[key]):
                        seconds.append(run.sample_time * (cycle.stop - cycle.start - 1))
                        strokes.append(float(np.ptp(run[key][cycle]) / ranges[key]))
    if not steps and block.sample_time is None:
        remedy = "import one with time, or choose it among the data in use"
        raise DataError("no recording in use has a time", remedy=remedy)
    step = block.sample_time or float(f"{np.median(steps):.3g}")
    return step, sum(seconds) / sum(strokes) if seconds else longest


def recorded_values(workspace: Workspace, name: str) -> Array:
    """Return a channel of all recordings in use, one after the other; empty where none has it."""
    runs = [run[name] for run in workspace.used().values() if name in run]
    return np.concatenate(runs) if runs else np.empty(0)


def known_values(workspace: Workspace, block: Block, name: str) -> Array:
    """Return a channel as recorded, or the ends of what a model was identified for.

    Raises
    ------
    DataError
        If neither is known.
    """
    recorded = recorded_values(workspace, name)
    if recorded.size:
        return recorded
    ranges = known_ranges(block.inputs, block.known_inputs)
    ranges |= known_ranges(block.outputs, block.known_outputs)
    if name not in ranges:
        raise DataError(
            "neither a recording in use nor the model has a range of it",
            channel=name,
            remedy="import a recording of it, or choose one among the data in use",
        )
    return np.array(ranges[name])


def reach(
    workspace: Workspace, name: str, held: Mapping[str, float]
) -> dict[str, tuple[float, float]]:
    """Return what of every channel of a reference can be reached again and again.

    It takes into account what is held meanwhile, hysteresis, and what creeps in cycles of the usual
    pace; it is within what was recorded.
    """
    from mckibben.studying.recorded_inputs import RecordedInputs

    def make() -> dict[str, tuple[float, float]]:
        block, runs = workspace.model(name), list(workspace.used().values())
        driven = [channel.name for channel in block_for_use(workspace, name, "inverse", {}).outputs]
        scheduled = {c.name: held[c.name] for c in block.inputs if c.name not in driven}
        limits: dict[str, tuple[float, float]] = {}
        with suppress(MckibbenError):
            if runs:
                inputs = RecordedInputs.of(runs, driven)
                limits = inputs.reached(block, scheduled, step_and_cycle(workspace, name)[1])
        for channel in reference_channels(workspace, name)[0]:
            values = known_values(workspace, block, channel)
            low, high = limits.get(channel, (-np.inf, np.inf))
            low, high = max(low, float(values.min())), min(high, float(values.max()))
            limits[channel] = low, high if high > low else low + 1.0
        return limits

    return dict(cached_of_model(workspace, name, f"reach {workspace.digest()} {held}", make))


# -- motions ----------------------------------------------------------------------------------------


def default_motion(workspace: Workspace, name: str) -> Json:
    """Return a motion of the first channel that a model is asked for, through its reach and back.

    It begins at the end that is nearer to the first sample; other channels stay at their median. It is
    made smaller, down to a fifth of the reach, until the inverse clips nothing of it.
    """
    step, cycle = step_and_cycle(workspace, name)
    channels, held = reference_channels(workspace, name)
    block = workspace.model(name)
    motion: Json = {"seconds": float(f"{max(2 * cycle, 40 * step):.2g}"), "cycles": 2, "step": step}
    motion |= {"stored": "", "now": next(iter(channels)), "channels": {}}
    motion["held"] = {
        key: float(f"{np.median(known_values(workspace, block, key)):.4g}") for key in held
    }
    inverse, units = block_for_use(workspace, name, "inverse", {}), units_of(channels | held)
    for margin in (0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4):
        for channel, (low, high) in reach(workspace, name, motion["held"]).items():
            samples, digits = (
                known_values(workspace, block, channel),
                2 - math.floor(math.log10(high - low)),
            )
            lower, upper = low + margin * (high - low), high - margin * (high - low)
            start_end, other_end = (
                (lower, upper) if samples[0] - lower < upper - samples[0] else (upper, lower)
            )
            start, kind = start_end, "sine"
            if channel != motion["now"]:
                start, kind = min(max(float(np.median(samples)), lower), upper), "hold"
            ends = {"first": round(start, digits) + 0.0, "other": round(other_end, digits) + 0.0}
            motion["channels"][channel] = {"kind": kind, **ends, "points": []}
        fill_points(motion)
        desired = reference_from_points(motion_points(motion), motion["held"], step, units)
        if not inverse.n_clipped(inverse.final_state(desired)):
            break
    return motion


def units_of(channels: Mapping[str, Channel]) -> dict[str, str]:
    """Return units by name."""
    return {name: channel.unit for name, channel in channels.items()}


def motion_points(motion: Json) -> dict[str, Points]:
    """Return the points of a motion by channel."""
    return {name: settings["points"] for name, settings in motion["channels"].items()}


def fill_points(motion: Json) -> None:
    """Make the points of all motions that are ready-made and filled in."""
    seconds, cycles = motion["seconds"], motion["cycles"]
    for settings in motion["channels"].values():
        first, other = settings["first"], settings["other"]
        if settings["kind"] == "hold" and None not in (seconds, first):
            settings["points"] = [(0.0, first), (seconds, first)]
        elif settings["kind"] == "formula" and seconds and settings.get("text"):
            times = np.linspace(0.0, seconds, max(round(seconds / motion["step"]), 1) + 1)
            settings["points"] = [
                *zip(times.tolist(), values(settings["text"], times).tolist(), strict=True)
            ]
        elif settings["kind"] == "drawn" and settings.get("text"):
            settings["points"] = parse_points(settings["text"])
        elif settings["kind"] in MOTIONS and None not in (seconds, cycles, first, other):
            settings["points"] = ready_made_points(
                settings["kind"], seconds, first, other, int(cycles)
            )


def parse_points(text: str) -> Points:
    """Return points from a text, such as ``0 5; 2 10; 4 5``: times [s] and values.

    >>> parse_points("0 5; 2 10")
    [(0.0, 5.0), (2.0, 10.0)]
    """
    try:
        pairs = [tuple(map(float, re.split(r"[\s,:]+", pair.strip()))) for pair in text.split(";")]
        return [(time, value) for time, value in pairs]
    except ValueError:
        problem = f"{text!r:.60} is no list of points"
        raise DataError(problem, remedy="write times and values, such as 0 5; 2 10; 4 5") from None


def ready_made_points(kind: str, seconds: float, first: float, other: float, cycles: int) -> Points:
    """Return a ready-made motion of `MOTIONS` between two ends.

    A staircase goes there and back by quarters; random ones go in straight lines between levels.
    """
    if not (seconds > 0 and first != other and 1 <= cycles <= 50):
        problem = f"there is no motion of {seconds:g} s between {first:g} and {other:g}"
        raise DataError(problem, remedy="give a time, two ends, and 1 to 50 cycles")
    shares: Array = np.linspace(0.0, 1.0, {"sine": 40, "random": 4}.get(kind, 2) * cycles + 1)
    if kind == "sine":
        known_values: Array = np.asarray(0.5 - 0.5 * np.cos(2 * np.pi * cycles * shares))
    elif kind == "random":
        known_values = np.append(0.0, np.random.default_rng(0).uniform(0.0, 1.0, shares.size - 1))
    elif kind == "triangle":
        known_values = np.asarray(np.arange(shares.size) % 2.0)
    else:
        stairs = np.append(np.tile([0.0, 0.25, 0.5, 0.75, 1.0, 0.75, 0.5, 0.25], cycles), 0.0)
        begin = np.arange(stairs.size) / stairs.size
        shares = np.append(np.column_stack([begin, begin + 0.999 / stairs.size]).ravel()[:-1], 1.0)
        known_values = np.repeat(stairs, 2)
    values = first + (other - first) * known_values
    pairs = zip(seconds * shares, values, strict=True)
    return [(float(f"{t:.6g}"), float(f"{y:.6g}")) for t, y in pairs]


def reference_from_points(
    points: Mapping[str, Sequence[Sequence[float]]],
    held: Mapping[str, float],
    step: float,
    units: Mapping[str, str],
) -> Recording:
    """Return straight lines through points beside what is held; channels that end early stay there."""
    arrays: dict[str, Array] = {}
    for name, pairs in points.items():
        arrays[name] = np.asarray(pairs, dtype=float).reshape(-1, 2).T
        if arrays[name].shape[1] < 2 or np.any(np.diff(arrays[name][0]) <= 0):
            problem = "a reference needs two points or more, with rising times"
            raise DataError(problem, channel=name, remedy="use a ready-made motion, or a file")
    end = max((float(times[-1]) for times, _ in arrays.values()), default=0.0)
    if not step > 0 or not 0 < end / step <= MOST_SAMPLES:
        raise DataError("the reference is too long", remedy="shorten it, or take longer steps")
    grid = np.arange(0.0, end + 0.5 * step, step)
    channels = {name: np.interp(grid, *pairs) for name, pairs in arrays.items()}
    channels |= {name: np.full(grid.size, value) for name, value in held.items()}
    return Recording(channels, step, {name: units[name] for name in channels if name in units})


def points_of_recording(run: Recording, channels: Collection[str]) -> dict[str, Points]:
    """Return a recording as points for channels that are asked for."""
    if run.sample_time is None:
        raise DataError("it has no time", remedy="add a column time_s")
    points, times = {}, (run.time - run.time[0]).tolist()
    for name in channels:
        column = next((column for column in (REFERENCE + name, name) if column in run), None)
        if column is None:
            problem = "the compensator is asked for it, and the file has no such column"
            raise DataError(problem, channel=name, remedy=f"name a column {name}")
        points[name] = [*zip(times, run[column].tolist(), strict=True)]
    return points
