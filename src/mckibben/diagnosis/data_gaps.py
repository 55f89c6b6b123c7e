"""Data gaps: what recordings cannot identify, the number that shows it, and the run that closes it.

Every rule is a function of the excitation of the recordings and gives a number by channels; the table
`RULES` says from which value on nothing is missing.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from mckibben.channels import PRESSURE, channels_of
from mckibben.diagnosis.excitation import Excitation, extremes
from mckibben.errors import DataError
from mckibben.numerics.statistics import dependence
from mckibben.recording import FEWEST_SAMPLES, Recording, listed
from mckibben.signals.shared_rows import without_copies
from mckibben.system.atomic import Numbers

if TYPE_CHECKING:
    from mckibben.channels import Names

MOST_SAMPLES = 20_000
"""Largest number of samples used for correlations."""

AT_END, OFF_REST = 0.1, 0.1
"""Shares of a range: distance from an end for a turning point to be at it; distance from the most
frequent value to be away from rest.
"""

LARGE_BRANCH_SHARE, SIMILAR_FACTOR, FEWEST_BRANCHES = 0.25, 1.5, 4
"""Speeds are compared among branches over this share of the range, whose lengths differ by at most
this factor, if there are this many.
"""

GapNumbers = Iterator[tuple[float, tuple[str, ...]]]
"""A value and the channels it belongs to."""


@dataclass(frozen=True)
class Gap(Numbers):
    """A property that recordings cannot identify.

    Parameters
    ----------
    what : str
        Name of the rule: "rate", "creep", "minor loops" and so on.
    value, needed : float
        The number that shows it, and the value from which, or up to which, nothing is missing.
    channels, ranges : tuple of str, mapping of str to (float, float)
        Those concerned, with their lowest and highest values in the recordings.
    run : str
        Kind of run that would identify it: a key of `report.words.RUNS`, or what has to change.
    severity : float
        From 0 to 1: how wrong a model from these recordings may be.
    """

    what: str
    value: float
    needed: float
    channels: tuple[str, ...]
    ranges: Mapping[str, tuple[float, float]]
    run: str
    severity: float


@dataclass(frozen=True)
class Rule:
    """A rule: there is a gap if ``beyond(number, needed)`` is true.

    ``number`` gives numbers by channels; ``timed`` rules need time; the others are as of `Gap`.
    """

    what: str
    number: Callable[[Excitation], GapNumbers]
    beyond: Callable[[float, float], bool]
    needed: float
    run: str
    severity: float
    timed: bool = False


def data_gaps(
    recordings: Recording | Sequence[Recording],
    inputs: Names = None,
    outputs: Names = None,
    *,
    tests: Sequence[Recording] = (),
) -> tuple[Gap, ...]:
    """Return the data gaps of recordings, most important first.

    Parameters
    ----------
    recordings : Recording or sequence of Recording
        To which a model is to be fitted.
    inputs, outputs : str or sequence of str, optional
        Channels; default those of pressures and displacements, or of pressure, length and force.
        Loads and stiffening pressures are found by name.
    tests : sequence of Recording
        On which the model is to be used.

    Returns
    -------
    tuple of Gap
        Empty where nothing is missing.

    Raises
    ------
    DataError
        On no recordings, absent channels, or fewer than ten samples.

    Examples
    --------
    >>> import numpy as np
    >>> from mckibben import Recording
    >>> from mckibben.signals import triangle
    >>> pressure = triangle(np.arange(4001) / 100, period=10.0, peaks=4.0)
    >>> run = Recording({"pressure": pressure, "displacement": 3 * pressure}, 0.01)
    >>> [gap.what for gap in data_gaps(run)]
    ['rate', 'minor loops', 'creep']
    """
    return gaps_of(excitation(recordings, inputs, outputs, tests))


def gaps_of(excitation: Excitation) -> tuple[Gap, ...]:
    """Return the data gaps for given excitation, most important first."""
    gaps = [
        gap
        for rule in RULES
        if excitation.timed or not rule.timed
        for gap in _gaps(rule, excitation)
    ]
    still = [gap for gap in gaps if gap.what == "still"]
    return tuple(still or sorted(gaps, key=lambda gap: -gap.severity))


def excitation(
    recordings: Recording | Sequence[Recording],
    inputs: Names = None,
    outputs: Names = None,
    tests: Sequence[Recording] = (),
) -> Excitation:
    """Return the excitation of recordings; parameters and errors as in `data_gaps`."""
    runs = listed(recordings)
    if not runs:
        problem = "there are none to judge"
        raise DataError(problem, parameter="recordings", remedy="give at least one")
    channels = channels_of(runs, inputs, outputs)
    driven = (*(name for name in channels.offered if name == PRESSURE), *channels.inputs)
    names = (*driven, *channels.outputs)
    for recording in runs:
        if len(recording) < FEWEST_SAMPLES:
            raise DataError(
                f"{len(recording)} samples are too few for any model",
                file=recording.source,
                remedy=f"give recordings of {FEWEST_SAMPLES} samples or more",
            )
        if absent := [name for name in names if name not in recording]:
            raise DataError(
                f"it is not among its channels, {', '.join(recording.channels)}",
                file=recording.source,
                channel=absent[0],
                remedy="name them with `input` and `output`, or give recordings with the same channels",
            )
    further = (name for name in channels.further if name not in names)
    loads = tuple(name for name in further if all(name in recording for recording in runs))
    distinct = tuple(without_copies(runs, driven, channels.outputs))
    return Excitation(distinct, tuple(tests), driven, loads, channels.outputs)


def _gaps(rule: Rule, excitation: Excitation) -> Iterator[Gap]:
    """Yield the gap of a rule: its worst number, with the channels of all that exceed it."""
    numbers = rule.number(excitation)
    beyond = [(value, names) for value, names in numbers if rule.beyond(value, rule.needed)]
    if beyond:
        worst = min if rule.beyond(-np.inf, rule.needed) else max
        value = worst(value for value, _ in beyond)
        channels = tuple(dict.fromkeys(name for _, names in beyond for name in names))
        ranges = {name: excitation.ranges[name] for name in channels}
        yield Gap(rule.what, value, rule.needed, channels, ranges, rule.run, rule.severity)


# -- rules -----------------------------------------------------------------------------------------


def _still(excitation: Excitation) -> GapNumbers:
    """Yield the outputs that are constant, or all inputs if they are."""
    names = [name for name in excitation.outputs if excitation.constant(name)]
    for name in names or (
        excitation.driven if all(map(excitation.constant, excitation.driven)) else ()
    ):
        yield 0.0, (name,)


def _constant(
    channels: Callable[[Excitation], Sequence[str]],
) -> Callable[[Excitation], GapNumbers]:
    """Return the rule of channels that are constant while others move."""

    def number(excitation: Excitation) -> GapNumbers:
        for name in channels(excitation) if excitation.moving else ():
            yield float(excitation.moves(name)), (name,)

    return number


def _reversals(excitation: Excitation) -> GapNumbers:
    """Yield the number of turning points of every input."""
    for name in excitation.swinging:
        yield sum(turns.size - 2 for turns in excitation.turns[name]), (name,)


def _inner_reversals(excitation: Excitation) -> GapNumbers:
    """Yield the number of turning points inside the range, upper or lower, whichever is smaller."""
    for name in excitation.swinging:
        counts = np.zeros(2, dtype=int)
        for recording, turns in zip(excitation.recordings, excitation.turns[name], strict=True):
            heights = (recording[name][turns] - excitation.ranges[name][0]) / excitation.span(name)
            inner = (heights > AT_END) & (heights < 1 - AT_END)
            upper = np.diff(heights) > 0
            counts += [
                int((inner[1:-1] & (upper[:-1] == direction)).sum()) for direction in (True, False)
            ]
        if sum(turns.size - 2 for turns in excitation.turns[name]):
            yield int(counts.min()), (name,)


def _speed_ratio(excitation: Excitation) -> GapNumbers:
    """Yield the ratio of speeds among similar branches of an input.

    Quantiles are of the time of motion, so that a few ways to where something is held do not count.
    """
    for name in excitation.swinging:
        branches = [
            b
            for b in excitation.branches[name]
            if b.travel >= LARGE_BRANCH_SHARE * excitation.span(name)
        ]
        travel = np.array([branch.travel for branch in branches])
        speeds = np.array([excitation.speed(name, branch) for branch in branches])
        order = np.argsort(speeds)
        ratio = 1.0
        for least in np.unique(np.quantile(travel, np.linspace(0, 1, 20))) if branches else ():
            similar = order[
                (travel[order] >= 0.999 * least) & (travel[order] <= SIMILAR_FACTOR * least)
            ]
            if similar.size >= FEWEST_BRANCHES:
                time = np.cumsum(travel[similar] / speeds[similar])
                slow, fast = speeds[
                    similar[np.searchsorted(time, np.array([0.15, 0.85]) * time[-1])]
                ]
                ratio = max(ratio, float(fast / slow))
        if excitation.branches[name]:
            yield ratio, (name,)


def _hold(excitation: Excitation) -> GapNumbers:
    """Yield the longest hold [s]."""
    if excitation.moving:
        yield excitation.longest_hold, excitation.moving


def _beyond_range(excitation: Excitation) -> GapNumbers:
    """Yield how far tests exceed the recorded range of an input or load, as a share of it."""
    for name in excitation.moving:
        if any(name in test for test in excitation.tests):
            (low, high), (lowest, highest) = (
                excitation.ranges[name],
                extremes(excitation.tests, name),
            )
            yield max(low - lowest, highest - high) / excitation.span(name), (name,)


def _dependence(excitation: Excitation) -> GapNumbers:
    """Yield the R² of an input on the others within recordings."""
    names = [name for name in excitation.moving if excitation.branches[name]]
    if len(names) < 2:
        return
    samples = np.concatenate(
        [
            recording.matrix(names) - recording.matrix(names).mean(axis=0)
            for recording in excitation.recordings
        ]
    )
    shares = dependence(samples[:: max(1, len(samples) // MOST_SAMPLES)])
    for name, share in zip(names, shares.tolist(), strict=True):
        yield share, (name,)


def _load_by_output(excitation: Excitation) -> GapNumbers:
    """Yield the R² of a load on one output, as for a spring."""
    for load in excitation.loads:
        for output in excitation.outputs:
            if excitation.moves(load) and excitation.moves(output):
                correlation = np.corrcoef(excitation.pooled([load, output]).T)
                yield float(correlation[0, 1] ** 2), (load, output)


def _together(excitation: Excitation) -> GapNumbers:
    """Yield the share of samples in which two channels are both away from their most frequent values."""
    if len(excitation.moving) < 2:
        return
    samples = excitation.pooled(excitation.moving)[
        :: max(1, sum(map(len, excitation.recordings)) // MOST_SAMPLES)
    ]
    away = np.empty(samples.shape, dtype=bool)
    for column, name in enumerate(excitation.moving):
        counts, edges = np.histogram(samples[:, column], bins=50)
        rest = float(edges[counts.argmax() : counts.argmax() + 2].mean())
        away[:, column] = np.abs(samples[:, column] - rest) > OFF_REST * excitation.span(name)
    for first, second in combinations(range(len(excitation.moving)), 2):
        share = float((away[:, first] & away[:, second]).mean())
        yield share, (excitation.moving[first], excitation.moving[second])


def _untimed(excitation: Excitation) -> GapNumbers:
    """Yield the share of recordings with time."""
    yield (
        float(np.mean([recording.sample_time is not None for recording in excitation.recordings])),
        excitation.inputs,
    )


RULES = (
    Rule("still", _still, operator.lt, 1.0, "random", 1.0),
    Rule("hysteresis", _reversals, operator.lt, 1, "random", 0.95),
    Rule("coupling", _dependence, operator.gt, 0.9, "random", 0.9),
    Rule("resting", _constant(lambda known: known.inputs), operator.lt, 1.0, "random", 0.9),
    Rule("together", _together, operator.lt, 0.02, "random", 0.85),
    Rule("range", _beyond_range, operator.gt, 0.05, "random", 0.85),
    Rule("time", _untimed, operator.lt, 1.0, "time", 0.8),
    Rule("rate", _speed_ratio, operator.lt, 3.0, "speeds", 0.8, timed=True),
    Rule("minor loops", _inner_reversals, operator.lt, 3, "random", 0.75),
    Rule("load", _constant(lambda known: known.loads), operator.lt, 1.0, "random", 0.6),
    Rule("spring load", _load_by_output, operator.gt, 0.98, "random", 0.6),
    Rule("creep", _hold, operator.lt, 8.0, "holds", 0.55, timed=True),
)
"""Data gaps: the value computed, its threshold, and the run that closes the gap."""
