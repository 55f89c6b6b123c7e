"""What recordings cannot tell a balance of forces, said before it is fitted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import DataError, ModelError
from mckibben.estimators.core.data import Run, TrainingData

ALIKE = 0.02
"""Share of its largest value by which a load has to change to be one."""

BLOCK, NOISE = 25, 0.4
"""Samples whose means are compared, and the share of the range over which noise has no means."""

ONE_SPEED = 2.0
"""Ratio of the fastest to the slowest speeds up to which there is one."""

RESTING = 0.05
"""Share of the fastest speed below which an input rests; share of samples that may."""

HELD = 0.02
"""A muscle is held where it moves less than this share of what it moves in all runs."""

APART = 0.1
"""Least eigenvalue of the correlations of pressures that move apart."""

LARGEST = 1e12
"""Number that no muscle has."""

BEGUN = 0.1
"""Share of the range of pressure up to which a run begins at rest."""

STILL = 0.005
"""Share of the most that any muscle moves, below which one does not."""

ALONGSIDE = 0.1
"""Share of what schedules that pressures leave unexplained, below which it follows them."""

FOLLOWS = 0.7
"""Share of what a muscle moves that follows its pressure, from which it is known which way."""

SAME, OFF = 0.05, 0.06
"""Shares of their ranges within which inputs are the same, and beyond which an output is another."""


def telling(data: TrainingData) -> tuple[TrainingData, list[str]]:
    """Return the data without loads and schedules that never change, and what is said of them."""
    kept, notes = [], []
    whole = data.stacked("scheduled")
    for place, channel in enumerate(data.scheduled):
        values = whole[:, place]
        means = [
            np.add.reduceat(column, starts) / np.diff([*starts, column.size])
            for column in (run.scheduled[:, place] for run in data.runs)
            for starts in [np.arange(0, column.size, BLOCK)]
        ]
        moves = float(np.ptp(np.concatenate(means)))
        least = max(ALIKE * float(np.abs(values).max()), NOISE * float(np.ptp(values)))
        if not moves > least:
            notes.append(
                f"{channel.name} is about {values.mean():.3g} {channel.unit} in all recordings: what "
                "it does cannot be told, and it is left out. Remedy: record at other values too"
            )
            continue
        kept.append(place)
        pressed = np.column_stack([data.stacked("driven"), np.ones(len(whole))])
        left = whole[:, place] - pressed @ np.linalg.lstsq(pressed, whole[:, place], rcond=None)[0]
        if np.std(left) < ALONGSIDE * np.std(whole[:, place]):
            notes.append(
                f"{channel.name} follows the pressures in all recordings: what it does cannot be told "
                "from what they do. Remedy: record it changing while pressures do not"
            )
    runs = tuple(replace(run, scheduled=run.scheduled[:, kept]) for run in data.runs)
    scheduled = tuple(data.scheduled[place] for place in kept)
    return replace(data, runs=runs, scheduled=scheduled), notes


def turned(data: TrainingData, ways: list[tuple[float, float]]) -> TrainingData:
    """Return data whose outputs are shortenings from about zero."""
    gains, offsets = np.array(ways).T
    runs = [replace(run, outputs=(run.outputs - offsets) / gains) for run in data.runs]
    return replace(data, runs=tuple(runs))


def one_speed(data: TrainingData) -> bool:
    """Tell whether all inputs always move at about one speed, which tells nothing of rate."""
    speeds = []
    for run in data.runs:
        if run.sample_time is None:
            return True
        moved = np.abs(np.diff(run.driven, axis=0)) / run.sample_time
        speeds.append(moved.max(axis=1))
    found = np.concatenate(speeds)
    rests = found <= RESTING * float(np.quantile(found, 0.99))
    if rests.mean() > RESTING:
        return False
    slow, fast = np.quantile(found[~rests], [0.1, 0.9])
    return bool(fast <= ONE_SPEED * slow)


def held(data: TrainingData, run: Run) -> bool:
    """Tell whether nothing moves in a run, so that its forces are what tells of the muscle."""
    return bool((np.ptp(run.outputs, axis=0) < HELD * data.travel).all())


def at_rest(data: TrainingData, run: Run) -> bool:
    """Tell whether a run begins about where pressures are lowest, so that nothing came before it."""
    low, high = data.lowest, data.highest
    return bool((run.driven[0] - np.minimum(low, 0.0) <= BEGUN * (high - low)).all())


def moving(data: TrainingData) -> TrainingData:
    """Return the same data without runs in which nothing moves."""
    return replace(data, runs=tuple(run for run in data.runs if not held(data, run)))


def other_zeros(data: TrainingData, loads: Array) -> list[str]:
    """Return which runs begin where others with the same inputs do not, as with another zero.

    Those of recordings with loads of their own do for that.
    """
    data = moving(data)
    known = tuple(run for run in data.runs if not loads[run.recording].any())
    data = replace(data, runs=known)
    if not data.runs:
        return []
    first = np.array([[*run.driven[0], *run.scheduled[0]] for run in data.runs])
    began = np.array([run.outputs[0] for run in data.runs])
    whole = np.hstack([data.stacked("driven"), data.stacked("scheduled")])
    spans, travel = np.ptp(whole, axis=0), data.travel
    notes = []
    for place, run in enumerate(data.runs):
        same = (np.abs(first - first[place]) <= SAME * spans).all(axis=1)
        others = np.flatnonzero(same & (np.arange(len(same)) != place))
        if not others.size or others.tolist() == [0]:  # told of the first, if of two
            continue
        off = began[place] - np.median(began[others], axis=0)
        for k in np.flatnonzero(np.abs(off) > OFF * travel).tolist():
            channel = data.outputs[k]
            notes.append(
                f"{run.name} begins {off[k]:.3g} {channel.unit} of {channel.name} from where others "
                "with the same inputs do, as if it had another zero. Remedy: let all count from the same"
            )
    return notes


def check_directions(data: TrainingData) -> None:
    """Refuse numbers that no muscle has, and displacements that stay or fall as their pressure rises.

    Raises
    ------
    DataError
        Naming the channel and the recording.
    ModelError
        If a muscle never moves.
    """
    span = data.travel
    if not (span > STILL * span.max()).all():
        raise ModelError(
            f"{data.outputs[int(np.argmin(span))].name} never changes, but by {span.min():.3g}. "
            "Remedy: record muscles that move"
        )
    for run in data.runs:
        for channels, table in ((data.inputs, run.driven), (data.outputs, run.outputs)):
            for place in np.flatnonzero(np.abs(table).max(axis=0) > LARGEST).tolist():
                raise DataError(
                    f"it reaches {np.abs(table[:, place]).max():.3g} {channels[place].unit}",
                    file=run.name,
                    channel=channels[place].name,
                    remedy="check its unit",
                )
    _check_turned(data)
    spans = data.highest - data.lowest
    for run in data.runs:
        moved = np.ptp(run.driven, axis=0) > 0.5 * spans
        if len(spans) < 2 or held(data, run) or not moved.all():
            continue
        alike = np.corrcoef(run.driven.T)
        if np.linalg.eigvalsh(alike)[0] < APART:
            continue  # they move together, so that none tells of its own
        for k in np.flatnonzero(np.diag(_by_pressures(run)) < 0).tolist():
            raise DataError(
                f"it falls while {data.inputs[k].name} rises",
                file=run.name,
                channel=data.outputs[k].name,
                remedy="give shortening, positive when a muscle contracts",
            )


def _by_pressures(run: Run) -> Array:
    """Return how displacements move with pressures, were that straight, shape (pressures, outputs)."""
    columns = np.column_stack([run.driven, run.scheduled, np.ones(len(run.driven))])
    found = np.asarray(np.linalg.lstsq(columns, run.outputs, rcond=None)[0], dtype=np.float64)
    return found[: run.driven.shape[1]]


def _check_turned(data: TrainingData) -> None:
    """Refuse recordings of a muscle alone in which it moves the other way than in most."""
    if len(data.inputs) > 1:
        return
    ways = {}
    for run in moving(data).runs:
        by = float(_by_pressures(run)[0, 0])
        if abs(by) * np.std(run.u) > FOLLOWS * np.std(run.y):
            ways[run.name] = by > 0
    rising = sum(ways.values())
    few = rising < len(ways) - rising
    turned = [name for name, rises in ways.items() if rises == few]
    if turned and len(turned) < len(ways):
        raise DataError(
            f"it {'rises' if few else 'falls'} with {data.inputs[0].name}, and does not in other "
            "recordings",
            file=turned[0],
            channel=data.outputs[0].name,
            remedy="count displacements the same way in all recordings",
        )


def not_at_rest(data: TrainingData, *, settled: bool, found: bool) -> list[str]:
    """Return which runs begin under pressure, and what was made of that."""
    names = [run.name for run in data.runs if not held(data, run) and not at_rest(data, run)]
    if settled:
        return [
            f"{name} begins under a pressure that seems to have long been held" for name in names
        ]
    how = "what it remembers was found" if found else "its first part does not count"
    return [
        f"{name} does not begin at rest: {how}, and simulations of it begin as if it did. "
        "Remedy: begin recordings without pressure"
        for name in names
    ]
