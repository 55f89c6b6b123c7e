"""Loop, dead zones, memory, creep, rate and coupling from recordings alone: numbers with intervals."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

from mckibben.arrays import Array
from mckibben.channels import by_name, channels_of, loop_of
from mckibben.diagnosis.coupling import SEPARABLE_R2
from mckibben.diagnosis.excitation import extremes
from mckibben.diagnosis.loops import (
    LOOP_FIGURES,
    Branches,
    Cycle,
    Loop,
    Range,
    Scale,
    Track,
    branches_of,
    creep,
    dead_zones,
    drift,
    explained,
    gains_of,
    gap_of,
    largest_of,
    loops_of,
    prepare,
    rate_dependence,
)
from mckibben.errors import DataError
from mckibben.numerics.statistics import half_interval, hats
from mckibben.recording import FEWEST_SAMPLES, Recording, listed
from mckibben.signals.holds import STILL, holds, moves
from mckibben.signals.reversals import whole_cycles
from mckibben.system.showing import Result

SIGNIFICANCE = 0.01
"""Significance level of the loop test."""

NO_GAP_SHARE = 0.01
"""Mean gap between branches, relative to the output range, below which there is no loop."""

LEAST_EXPLAINED = 0.5
"""Smallest share of the variance explained by branches for their shape to be measured."""

FEWEST_REPEATS = 3
"""Smallest number of values for an interval."""

MEDIAN_ERROR = 1.2533
"""Standard error of the median of normal values, relative to that of their mean."""

LOOP_QUANTITIES = {
    *("loop_width", "mid_width", "loop_area", "loop_area_share", "asymmetry", "width_centroid"),
    *("dead_zone_upper", "dead_zone_lower", "rate_dependence", "speeds"),
}
"""Quantities that are measured only if there is a loop."""

UNEXPLAINED_QUANTITIES = {"gain", "drift", "creep", "creep_time"}
"""Further quantities without meaning if input and direction explain little of the output."""

SAME_LEVEL_SHARE = 0.02
"""Share of another input's range within which its levels are equal."""

LEAST_COVERED = 0.5
"""Share of the input range that a segment must cover."""

MOST_SAMPLES = 2000
"""Largest number of samples of a recording from which its zero offset is found."""

KNOTS = 12
"""Number of knots of the curve over the input to which outputs are shifted."""


@dataclass(frozen=True)
class Level:
    """Results with other inputs constant: their channels, levels and units in ``held``."""

    held: tuple[tuple[str, float, str], ...]
    found: Characterization


@dataclass(frozen=True, kw_only=True, repr=False)
class Characterization(Result):
    """Characterization of a muscle from recordings; None for quantities that they do not determine.

    Units are those of the channels; percentages are of the output range. Figures are medians over
    repeats; ``intervals`` has the 95 % intervals of those with three repeats or more, by field.

    Parameters
    ----------
    n_cycles, n_reversals : int
        Whole cycles, from minimum to minimum of the input, over at least a tenth of its range; turning
        points of the input, those of minor loops included.
    duration, sample_time : float or None
        All recordings together [s]; the sample time that they share [s].
    input_noise, output_noise : float or None
        Standard deviation of a sample.
    loop_width, mid_width : float or None
        Distance of the largest cycles' branches at mid input: e_w [%] and [output unit].
    asymmetry, width_centroid : float or None
        Distance of the loop from its image rotated by 180° [%], 0 for classical
        Prandtl-Ishlinskii models; where it is wide, from -1 (low input) to 1 (high input).
    loop_area, loop_area_share : float or None
        Enclosed area [input unit x output unit], and its ratio to the bounding rectangle [%].
    dead_zone_upper, dead_zone_lower : float or None
        Change of the input after upper and lower reversals before the output moves [input unit].
    gain : float or None
        Slope of the mean of both branches at mid input [output unit/input unit].
    branch_gap, p_loop : float or None
        Mean distance of falling and rising output at the same input, positive where the output lags
        [output unit], and the probability of such gaps without a loop. From four branches on drift
        cancels; of fewer there is no probability.
    creep, creep_time, drift : float or None
        Change of the output in a hold of all inputs [output unit], and its time [s]; change from
        one cycle to the next between the same extremes.
    rate_dependence, speeds
        Increase of e_w at twice the speed [%], and the mean speeds compared [input unit/s].
    loop_share : float
        Share of the output's variance that the input and its direction explain.
    n_stretches : int or None
        Segments in which other inputs are constant; None where nothing else moves.
    falls : bool
        Whether the output falls as the input grows.
    levels : tuple of Level
        Levels at which other inputs are constant. The loop is that of the level of largest output
        motion.
    notes : tuple of str
        What was assumed in reading.
    """

    face: ClassVar[str] = "characterization"

    input: str
    output: str
    input_unit: str
    output_unit: str
    n_recordings: int
    n_samples: int
    n_cycles: int
    n_reversals: int
    duration: float | None
    sample_time: float | None
    input_range: Range
    output_range: Range
    input_noise: float | None
    output_noise: float | None
    cycles: tuple[Cycle, ...]
    loop_width: float | None = None
    mid_width: float | None = None
    asymmetry: float | None = None
    width_centroid: float | None = None
    loop_area: float | None = None
    loop_area_share: float | None = None
    dead_zone_upper: float | None = None
    dead_zone_lower: float | None = None
    gain: float | None = None
    branch_gap: float | None = None
    creep: float | None = None
    creep_time: float | None = None
    drift: float | None = None
    rate_dependence: float | None = None
    speeds: Range | None = None
    loop_share: float = 0.0
    p_loop: float | None = None
    n_stretches: int | None = None
    falls: bool = False
    levels: tuple[Level, ...] = ()
    intervals: dict[str, Range] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def to_frame(self) -> Any:
        """Return the cycles as a data frame: extremes, mean speed, and width [%]."""
        import pandas as pd

        return pd.DataFrame([vars(cycle) for cycle in self.cycles])

    @property
    def output_span(self) -> float:
        """Range of the output."""
        return self.output_range[1] - self.output_range[0]

    @property
    def has_loop(self) -> bool | None:
        """Whether branches differ; False only if their gap is significantly below 1 % of the range.

        None where too few branches, or too much noise, leave it open.
        """
        if self.p_loop is not None and self.p_loop <= SIGNIFICANCE:
            return True
        limits = self.intervals.get("branch_gap")
        small = limits is not None and max(map(abs, limits)) <= NO_GAP_SHARE * self.output_span
        return False if small else None


def characterize(
    recordings: Recording | Sequence[Recording],
    input: str | None = None,  # noqa: A002
    output: str | None = None,
    *,
    scheduling: Sequence[str] = (),
) -> Characterization:
    """Measure width and shape of the loop, dead zone, creep and rate dependence of a muscle.

    Sensor noise is averaged first, over samples within which the input moves by 1 % of its range.
    Ranges are those of all recordings together.

    Other inputs, such as pressures of other muscles, loads or lengths, have a separate loop at
    every level at which they are constant; the one of largest output motion is reported.

    Parameters
    ----------
    recordings : Recording or sequence of Recording
        One muscle; every recording starts with unknown memory.
    input, output : str, optional
        Channels; default those that `compare` models.
    scheduling : sequence of str
        Other inputs that move the output, in addition to channels of the input's quantity, loads, and
        channels that are constant within recordings and differ between them.

    Raises
    ------
    DataError
        On no recordings, several inputs or outputs, a missing or constant channel, units that differ
        between recordings, fewer than ten samples, or an input that moves only while others do.

    Examples
    --------
    >>> import numpy as np
    >>> from mckibben import Recording
    >>> from mckibben.signals import triangle
    >>> pressure = triangle(np.arange(401) / 100, period=2.0, peaks=4.0)
    >>> lag = 0.5 * np.sign(np.gradient(pressure))
    >>> run = Recording({"pressure": pressure, "displacement": pressure - lag}, 0.01)
    >>> found = characterize(run)
    >>> found.n_cycles, round(found.mid_width, 6)
    (2, 1.0)
    """
    runs = listed(recordings)
    drive, response = loop_of(runs, input, output)
    others = other_inputs(runs, drive, response, scheduling) if runs else []
    if not others:
        return _measured(runs, drive, response)

    levels = _levels(runs, drive, response, others)
    if not levels:
        following = [name for name in others if _follows(runs, name, response)]
        independent = [name for name in others if name not in following]
        if following and not independent:
            note = f"{', '.join(following)} moves with {response}, and its effect is in the loop"
            return replace(_measured(runs, drive, response), notes=(note,))
        levels = _levels(runs, drive, response, independent) if following else []
    if not levels:
        raise DataError(
            f"it never moves while {', '.join(others)} stay constant: its effect is not identifiable",
            file=runs[0].source,
            channel=drive,
            remedy="record one in which it moves alone; models of several inputs need no such recording",
        )

    largest = max(
        (level.found for level in levels),
        key=lambda result: (result.loop_width is not None, result.output_span),
    )
    return replace(
        largest,
        cycles=tuple(cycle for level in levels for cycle in level.found.cycles),
        n_stretches=sum(level.found.n_recordings for level in levels),
        levels=tuple(levels) if len(levels) > 1 else (),
        **_counts(runs, drive, response),
    )


def _follows(runs: Sequence[Recording], load: str, response: str) -> bool:
    """Return whether a load follows from the output, as that of a spring."""
    if load in by_name(runs)[0]:  # a drive
        return False
    table = np.concatenate([run.matrix([load, response]) for run in runs])
    return bool(np.corrcoef(table.T)[0, 1] ** 2 > SEPARABLE_R2)


def _levels(
    runs: Sequence[Recording], drive: str, response: str, others: Sequence[str]
) -> list[Level]:
    """Return the results at every level of other inputs that shows a loop, or a data gap."""
    levels = []
    low, high = extremes(runs, drive)
    for values, parts in constant_segments(runs, drive, others):
        segments = [segment for _, segment in parts]
        if all(np.ptp(segment[response]) == 0 for segment in segments):
            continue
        result = _measured(segments, drive, response)
        if all(cycle.amplitude < LEAST_COVERED * (high - low) for cycle in result.cycles):
            result = _blanked(result, LOOP_QUANTITIES)  # of small cycles
        if result.loop_width is not None or result.branch_gap is not None:
            units = [runs[0].units[name] for name in others]
            held = tuple(zip(others, values, units, strict=True))
            cycles = tuple(replace(c, recording=parts[c.recording][0]) for c in result.cycles)
            levels.append(Level(held, replace(result, cycles=cycles)))
    return levels


def _counts(runs: Sequence[Recording], drive: str, response: str) -> dict[str, Any]:
    """Return counts and ranges of recordings."""
    durations, steps = [run.duration for run in runs], {run.sample_time for run in runs}
    return {
        "input_range": extremes(runs, drive),
        "output_range": extremes(runs, response),
        "n_recordings": len(runs),
        "n_samples": sum(map(len, runs)),
        "duration": None if None in durations else float(sum(d or 0.0 for d in durations)),
        "sample_time": steps.pop() if len(steps) == 1 else None,
    }


def _measured(runs: Sequence[Recording], drive: str, response: str) -> Characterization:
    """Return the results of recordings in which other inputs are constant, with any zero offsets."""
    several = len(runs) > 1 and all(drive in run and response in run for run in runs)
    scale, tracks = prepare(
        without_offsets(runs, drive, response) if several else runs, drive, response
    )
    loops, branches = loops_of(tracks, scale), branches_of(tracks, scale)

    figures, intervals = _repeated(runs, drive, response, scale, tracks, loops, branches)
    gap, gap_interval, p_loop = gap_of(branches, scale.sign)
    growth, growth_interval, speeds = rate_dependence(loops) or (None, None, None)
    intervals |= {"branch_gap": gap_interval, "rate_dependence": growth_interval}
    share = explained(tracks)
    result = Characterization(
        input=drive,
        output=response,
        input_unit=_unit(runs, drive),
        output_unit=_unit(runs, response),
        **_counts(runs, drive, response),
        n_cycles=sum(len(whole_cycles(track.u, track.major_turns)) for track in tracks),
        n_reversals=sum(track.turns.size - 2 for track in tracks),
        input_noise=None if np.isnan(scale.u.noise) else scale.u.noise,
        output_noise=None if np.isnan(scale.y.noise) else scale.y.noise,
        cycles=tuple(loop.cycle for loop in loops),
        **figures,
        branch_gap=gap,
        p_loop=p_loop,
        rate_dependence=growth,
        speeds=speeds,
        loop_share=share,
        falls=scale.sign < 0,
        intervals={name: ends for name, ends in intervals.items() if ends is not None},
    )

    absent = set() if share >= LEAST_EXPLAINED else LOOP_QUANTITIES | UNEXPLAINED_QUANTITIES
    low, high = gap_interval or (1.0, 1.0)
    if result.has_loop is False or low <= 0 <= high:
        absent |= LOOP_QUANTITIES
    return _blanked(result, absent)


def _repeated(
    runs: Sequence[Recording],
    drive: str,
    response: str,
    scale: Scale,
    tracks: Sequence[Track],
    loops: Sequence[Loop],
    branches: Branches,
) -> tuple[dict[str, Any], dict[str, Range | None]]:
    """Return the medians over repeats of what is measured repeatedly, and their intervals."""
    largest = largest_of(loops)
    creeps = creep(runs, drive, response, scale)
    upper, lower = dead_zones(tracks, scale)
    repeats: dict[str, Sequence[float | None]] = {
        **{name: [loop.figures[name] for loop in largest] for name in LOOP_FIGURES},
        "gain": gains_of(branches, largest, scale),
        "dead_zone_upper": upper,
        "dead_zone_lower": lower,
        "creep": [change for _, change in creeps],
        "creep_time": [time for time, _ in creeps],
        "drift": drift(loops),
    }
    values_of = {name: [x for x in values if x is not None] for name, values in repeats.items()}
    medians = {name: float(np.median(xs)) if xs else None for name, xs in values_of.items()}
    intervals = {name: _interval(xs) for name, xs in values_of.items() if name != "creep_time"}
    return medians, intervals


def _blanked(result: Characterization, absent: Collection[str]) -> Characterization:
    """Return results without some of their quantities."""
    cycles = () if "loop_width" in absent else result.cycles
    intervals = {name: ends for name, ends in result.intervals.items() if name not in absent}
    blank: dict[str, Any] = dict.fromkeys(absent)
    return replace(result, cycles=cycles, intervals=intervals, **blank)


def _interval(values: Sequence[float]) -> Range | None:
    """Return the 95 % interval of the median of repeated values by Student's t; None for one or two.

    It does not reach beyond zero where all values are of one sign.
    """
    if len(values) < FEWEST_REPEATS:
        return None
    half = MEDIAN_ERROR * half_interval(np.array(values), 0.95)
    low, high = float(np.median(values)) - half, float(np.median(values)) + half
    return max(low, 0.0) if min(values) >= 0 else low, min(high, 0.0) if max(values) <= 0 else high


def _unit(runs: Sequence[Recording], channel: str) -> str:
    units = {run.units[channel] for run in runs}
    if len(units) > 1:
        raise DataError(
            f"recordings have it in different units: {', '.join(sorted(units))}",
            channel=channel,
            remedy="convert them, or read the files with `units[CHANNEL]=UNIT`",
        )
    return units.pop()


def other_inputs(
    recordings: Sequence[Recording], drive: str, response: str, scheduling: Sequence[str]
) -> list[str]:
    """Return other inputs that vary within or between recordings.

    Those asked for by ``scheduling``, other drives, what schedules models, and channels that are
    constant in every recording.
    """
    common = [name for name in recordings[0].channels if all(name in run for run in recordings)]
    drives = by_name(recordings)[0]
    further = channels_of(recordings, drive, response).further
    candidates = [
        *scheduling,
        *(name for name in drives if drive in drives and name in common),
        *(name for name in further if name in common),
        *(name for name in common if all(np.ptp(run[name]) == 0 for run in recordings)),
    ]
    others = [name for name in dict.fromkeys(candidates) if name not in (drive, response)]
    return [name for name in others if moves([run[name] for run in recordings])]


Group = tuple[tuple[float, ...], list[tuple[int, Recording]]]
"""Levels of the other inputs, and the segments that have them, each with its recording's number."""


def constant_segments(
    recordings: Sequence[Recording], drive: str, others: Sequence[str]
) -> list[Group]:
    """Return segments in which all other inputs are constant and the input moves, by level."""
    span = max(float(np.ptp(run[drive])) for run in recordings)
    ranges = np.ptp(np.concatenate([run.matrix(others) for run in recordings]), axis=0)

    segments: list[tuple[Array, int, Recording]] = []
    for number, run in enumerate(recordings):
        columns = run.matrix(others)
        whole = bool(np.all(np.ptp(columns, axis=0) <= STILL * ranges))
        parts = [slice(0, len(run))] if whole else holds(columns, ranges.tolist(), FEWEST_SAMPLES)
        for part in parts:
            segment = run.slice(part.start, part.stop)
            if np.ptp(segment[drive]) > LEAST_COVERED * span:
                segments.append((columns[part].mean(axis=0), number, segment))

    groups: list[Group] = []
    for level, number, segment in sorted(segments, key=lambda entry: tuple(entry[0])):
        for values, members in groups:
            if np.all(np.abs(level - values) <= SAME_LEVEL_SHARE * ranges):
                members.append((number, segment))
                break
        else:
            groups.append((tuple(level.tolist()), [(number, segment)]))
    return groups


def without_offsets(recordings: Sequence[Recording], drive: str, response: str) -> list[Recording]:
    """Return recordings whose outputs are shifted onto one curve of the input.

    Least squares of an offset of every recording, and a piecewise-linear curve that they share.
    """
    tables = [run.matrix((drive, response))[:: -(-len(run) // MOST_SAMPLES)] for run in recordings]
    members = np.repeat(np.eye(len(tables)), [len(table) for table in tables], axis=0)
    x, y = np.concatenate(tables).T
    columns = np.column_stack([members, hats(x, KNOTS)])
    offsets = np.linalg.lstsq(columns, y, rcond=None)[0][: len(tables)]
    offsets -= offsets @ members.mean(axis=0)
    return [
        run.with_channels({response: run.units[response]}, **{response: run[response] - offset})
        for run, offset in zip(recordings, offsets.tolist(), strict=True)
    ]
