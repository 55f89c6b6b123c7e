"""Set-up of a balance from recordings: channels, directions, ranges, loads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import compress

import numpy as np

from mckibben.arrays import Array, Mask
from mckibben.blocks.fields import Channel
from mckibben.blocks.memoryless import Affine
from mckibben.channels import LOAD_UNITS
from mckibben.errors import DataError, ModelError
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.coupled.balance_problem import held
from mckibben.estimators.coupled.balance_structure import Bench
from mckibben.recording import Recording

LEAST_VARIED = 0.02
"""Smallest variation of a scheduling or load channel, relative to its largest value."""

BLOCK, NOISE = 25, 0.4
"""Samples per averaged block, and noise, as a share of the range, above which means are not
compared.
"""

LEAST_MOVED = 0.02
"""Motion due to a pressure, relative to the largest, below which the pressure has no effect."""

LEAST_DRIVEN = 0.05
"""Spread of pressures along a direction, relative to the widest, below which it is noise."""

STILL = 0.005
"""Motion of an output, relative to the largest, below which it counts as constant."""

LARGEST = 1e12
"""Bound of plausible numbers."""

OTHER_ORIGIN = 0.5
"""Distance of outputs from zero, relative to their range, above which they have another origin."""

AT_START = 0.02
"""Displacement at the start of a run, relative to the range, that counts as zero."""

ONE_SPEED, SLOW = 2.0, 0.05
"""Largest ratio of fast to slow speeds that counts as one speed; share of the fastest below which a
channel is at rest.
"""


def with_loads(
    recordings: Sequence[Recording], scheduling: Sequence[str], rows: Sequence[Mask] | None = None
) -> list[Recording]:
    """Return recordings that all have every load.

    What one lacks is what it is in others on average, over their samples that count.
    """
    filled = list(recordings)
    counting = [~run.bridged for run in recordings]
    if rows is not None:
        counting = [mask & own for mask, own in zip(rows, counting, strict=True)]
    for name in scheduling:
        units = {run.units[name] for run in recordings if name in run}
        if not units or not units <= {*LOAD_UNITS}:
            continue
        pairs = zip(recordings, counting, strict=True)
        loads = np.concatenate([run[name][own] for run, own in pairs if name in run])
        mean, unit = (
            float(loads.mean()) if loads.size else 0.0,
            min(units),
        )  # of none it is left out
        filled = [
            run
            if name in run
            else run.with_channels({name: unit}, **{name: np.full(len(run), mean)})
            for run in filled
        ]
    return filled


def without_held(data: TrainingData) -> tuple[TrainingData, list[str]]:
    """Return data without runs that have neither motion nor measured force, and their names."""
    loaded = any(channel.unit in LOAD_UNITS for channel in data.scheduled)
    useful = [(loaded and not run.unmeasured) or not held(data, run) for run in data.runs]
    if not any(useful):
        return data, []
    names = dict.fromkeys(run.name for run in compress(data.runs, np.logical_not(useful)))
    return replace(data, runs=tuple(compress(data.runs, useful))), list(names)


def in_one_order(data: TrainingData) -> TrainingData:
    """Return the same runs in an order that does not depend on how they were given.

    Sums over runs are then equal to the last bit, and so are the terms that are chosen.
    """
    runs = sorted(data.runs, key=lambda run: (run.driven.tobytes(), run.outputs.ravel().tolist()))
    return replace(data, runs=tuple(replace(run, place=k) for k, run in enumerate(runs)))


def only_forces(data: TrainingData) -> bool:
    """Return whether the one coordinate is held in every run, so that only the load is informative."""
    loads = sum(channel.unit in LOAD_UNITS for channel in data.scheduled)
    return loads == len(data.outputs) == 1 and all(held(data, run) for run in data.runs)


def varying(data: TrainingData) -> tuple[TrainingData, list[str]]:
    """Return data without constant loads and scheduling inputs, loads last; and those left out."""
    moving, constant = list[Channel](), list[Channel]()
    for k, channel in enumerate(data.scheduled):
        columns = [run.scheduled[:, k] for run in data.runs]
        means = np.concatenate(
            [
                np.add.reduceat(v, starts := np.arange(0, v.size, BLOCK))
                / np.diff([*starts, v.size])
                for v in columns
            ]
        )
        table = np.concatenate(columns)
        least = max(LEAST_VARIED * float(np.abs(table).max()), NOISE * float(np.ptp(table)))
        (moving if np.ptp(means) > least else constant).append(channel)
    moving.sort(key=lambda channel: channel.unit in LOAD_UNITS)
    return scheduled_by(data, moving), [channel.name for channel in constant]


def scheduled_by(data: TrainingData, channels: Sequence[Channel]) -> TrainingData:
    """Return data with some of the loads and scheduling inputs."""
    places = [data.scheduled.index(channel) for channel in channels]
    runs = tuple(replace(run, scheduled=run.scheduled[:, places]) for run in data.runs)
    return replace(data, runs=runs, scheduled=tuple(channels))


def check_numbers(data: TrainingData) -> None:
    """Raise an error for implausible numbers, constant outputs, and pressures without effect.

    Raises
    ------
    DataError
        Naming the channel and the recording.
    ModelError
        If a muscle never moves, or there never is pressure.
    """
    span = data.travel
    if not (span > STILL * span.max()).all():
        raise ModelError(
            f"it never changes, but by {span.min():.3g}",
            channel=data.outputs[int(np.argmin(span))].name,
            remedy="record muscles that move",
        )
    for run in data.runs:
        for channels, table in ((data.inputs, run.driven), (data.outputs, run.outputs)):
            for k in np.flatnonzero(np.abs(table).max(axis=0) > LARGEST).tolist():
                raise DataError(
                    f"it reaches {np.abs(table[:, k]).max():.3g} {channels[k].unit}",
                    file=run.name,
                    channel=channels[k].name,
                    remedy="check its unit",
                )
    if not data.highest.max() > 0:
        raise ModelError(
            f"{data.inputs[0].name} never exceeds 0", remedy="give pressures above the atmosphere's"
        )


def directions(data: TrainingData) -> Array:
    """Return the shortening of every muscle per coordinate, shape (muscles, coordinates).

    A muscle shortens along the way in which its pressure moves coordinates, by least squares on all
    inputs; each by its own coordinate alone where that is the one that its pressure moves most.

    Raises
    ------
    DataError
        If a pressure moves nothing, or the coordinates only move together.
    """
    runs = tuple(run for run in data.runs if not held(data, run)) or data.runs
    moving = replace(data, runs=runs)
    driven, scheduled, outputs = map(moving.stacked, ("driven", "scheduled", "outputs"))
    span = data.highest - data.lowest
    columns = np.column_stack(
        [driven / span, scheduled / np.maximum(np.ptp(scheduled, axis=0), 1e-300)]
    )
    columns, outputs = columns - columns.mean(axis=0), outputs - outputs.mean(axis=0)
    # along a direction in which pressures hardly went they share what they do
    found = np.linalg.lstsq(columns, outputs, rcond=LEAST_DRIVEN)[0][: driven.shape[1]]
    found /= span[:, np.newaxis]
    effects = found * span[:, np.newaxis] / data.travel
    n, m = effects.shape
    if n == m and (np.abs(effects).argmax(axis=1) == np.arange(n)).all():
        return np.diag(np.where(np.diag(effects) < 0, -1.0, 1.0))
    sizes = np.sqrt((effects**2).sum(axis=1))
    for k in np.flatnonzero(~(sizes > LEAST_MOVED * sizes.max())).tolist():
        raise DataError(
            "it has no effect",
            channel=data.inputs[k].name,
            remedy="leave it out, or record runs in which it moves the muscles",
        )
    ways = found / np.sqrt((found**2).sum(axis=1))[:, np.newaxis]
    if np.linalg.svd(ways, compute_uv=False)[-1] < LEAST_MOVED:
        raise DataError(
            "all outputs move together, whatever the pressures",
            remedy="leave out all but one, or record runs in which pressures move independently",
        )
    return ways


def recorded_drive(pressures: Array) -> Array:
    """Return the middle of pressures, shape (k, n), and their spread along directions, (n, 1 + r).

    Directions are principal ones of the pressures over their ranges, spreads standard deviations.
    """
    middle, span = pressures.mean(axis=0), np.ptp(pressures, axis=0)
    shares = (pressures - middle) / (np.where(span > 0, span, 1.0) * np.sqrt(len(pressures)))
    sizes, ways = np.linalg.svd(shares, full_matrices=False)[1:]
    driven = sizes > LEAST_DRIVEN * sizes[0]
    spread = span[:, np.newaxis] * (ways[driven].T * sizes[driven])
    return np.column_stack([middle, spread])


def sensors_of(data: TrainingData, ways: Array) -> tuple[tuple[Affine, ...], Array]:
    """Return what turns coordinates, which are relative to about zero, into outputs; and directions.

    Muscles with a coordinate each shorten by that.
    """
    is_own = bool((np.abs(ways) == np.eye(*ways.shape)).all())
    gains = np.diag(ways).copy() if is_own else np.ones(ways.shape[1])
    shortened = data.stacked("outputs") * gains
    offsets = []
    for column, gain, span in zip(shortened.T, gains, data.travel.tolist(), strict=True):
        far = OTHER_ORIGIN * (np.ptp(column) if data.spans is None else span)
        away = column.min() > far or column.max() < 0.0
        offsets.append(float(gain) * float(column.min()) if away else 0.0)
    sensors = tuple(
        Affine(float(gain), offset, channel, channel)
        for gain, offset, channel in zip(gains, offsets, data.outputs, strict=True)
    )
    return sensors, np.eye(*ways.shape) if is_own else ways


def of_coordinates(data: TrainingData, sensors: Sequence[Affine]) -> TrainingData:
    """Return data with coordinates instead of outputs."""
    gains, offsets = np.array([[sensor.gain, sensor.offset] for sensor in sensors]).T
    return data.changed(lambda run: replace(run, outputs=(run.outputs - offsets) / gains))


def one_speed(data: TrainingData) -> bool:
    """Return whether all inputs always move at about one speed, so that rate is not identifiable."""
    if any(run.sample_time is None for run in data.runs):
        return True
    speeds = [(np.abs(np.diff(run.driven, axis=0)) / data.timed()).max(axis=1) for run in data.runs]
    speeds_found = np.concatenate(speeds)
    rests = speeds_found <= SLOW * float(np.quantile(speeds_found, 0.99))
    if rests.mean() > SLOW:
        return False
    slow, fast = np.quantile(speeds_found[~rests], [0.1, 0.9])
    return bool(fast <= ONE_SPEED * slow)


def unmeasured_in(data: TrainingData, *, every: bool) -> tuple[int, ...]:
    """Return the recordings without a load that others have; or all but the first with it."""
    lacking = {run.index for run in data.runs if run.unmeasured}
    indices = sorted({run.index for run in data.runs})
    reference = next((index for index in indices if index not in lacking), None)
    return tuple(index for index in indices if index in lacking or (every and index != reference))


def set_up(
    data: TrainingData, *, of_force: bool, tare: bool | None, unknown_load: bool | None
) -> tuple[TrainingData, Bench]:
    """Return data of coordinates, and the bench on which they were recorded.

    By settings of the estimator; ``tare`` is found where it is None.
    """
    of_force = of_force or only_forces(data)
    sensors, ways = sensors_of(data, np.eye(1) if of_force else directions(data))
    data = of_coordinates(data, sensors)
    loads = [channel.unit in LOAD_UNITS for channel in data.scheduled]
    n_x = loads.index(True) if any(loads) else len(loads)
    x = data.stacked("scheduled")
    y, span = data.stacked("outputs"), data.travel
    if tare is None:
        first = np.array([run.outputs[0] for run in data.runs])
        at_start = bool((np.abs(first) <= AT_START * span).all())
        tare = n_x > 0 and at_start and not unknown_load
    short = y @ ways.T
    margin = (0.15 if tare else 0.02) * np.ptp(short, axis=0)
    if data.spans is not None:
        short = np.vstack([short, [data.spans]])
    steps = [run.sample_time for run in data.runs]
    longest = max(len(run.outputs) * (run.sample_time or 0.0) for run in data.runs)
    step = min(step or 0.0 for step in steps)
    heaviest = float(np.abs(x[:, n_x:]).max(initial=0.0)) or 1.0
    ends = np.column_stack([x[:, :n_x].min(axis=0), x[:, :n_x].max(axis=0)])
    tenths = (np.round(v / (0.1 * (float(np.ptp(v)) or 1.0))) for v in x[:, :n_x].T)
    bench = Bench(
        driven=data.outputs,
        scheduled=data.scheduled[:n_x],
        loaded=data.scheduled[n_x:],
        given=data.inputs,
        sensors=sensors,
        directions=ways,
        hull=np.column_stack([short.min(axis=0) - margin, short.max(axis=0) + margin]),
        lowest=y.min(axis=0),
        travel=span,
        levels=ends,
        highest=float(data.highest.max()),
        heaviest=heaviest,
        preload=float(data.stacked("driven").mean()),
        tare=tare,
        lag_range=(2.0 * (step or 1.0), max(0.5 * longest, 1.0)),
        step=step,
        of_force=of_force,
        curved=n_x > 0 and all(np.unique(v).size > 2 for v in tenths),
        some_held=any(held(data, run) for run in data.runs),
        unmeasured=() if tare else unmeasured_in(data, every=bool(unknown_load)),
    )
    return data, bench
