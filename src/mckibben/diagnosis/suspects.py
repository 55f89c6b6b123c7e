"""Possible causes of a residual: groups of regressors, each for a missing effect.

They are computed of every sample and then averaged over blocks, which loses nothing of what is as slow
as a branch of the loop, and makes noise short. All are made of inputs, loads, the modelled output and
time; nothing is made of the measured output, whose noise is the residual's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.hysteresis.pi import PI
from mckibben.diagnosis.free_runs import Run
from mckibben.signals.holds import holds
from mckibben.signals.reversals import reversals
from mckibben.statistics import hats

PER_BRANCH, PER_COLUMN = 24, 6
"""Smallest number of blocks per typical branch of the input, and per column."""

FEWEST, MOST = 400, 6000
"""Smallest and largest number of blocks, if there are as many samples."""

KNOTS = 8
"""Total number of knots of curves over the inputs."""

COVERED, START = (0.25, 0.75), 8
"""Quantiles that an input must have passed for its earlier memory to be erased, and the first part
of a run in which it must.
"""

WAYS = (0.05, 0.2, 0.6)
"""Distances of reversal, in shares of half the range, after which the input is on the other branch.
"""

HELD = 0.15
"""Share of samples in holds above which creep is distinguished from the loop."""

MOST_DELAY, LONGER = 50, 8
"""Largest shift of outputs [samples], and the shortest recording as its multiple."""

CAUSES = ("pressure", "voltage", "force", "torque")
"""Channels that may explain a residual although the model does not use them."""


@dataclass(frozen=True)
class Group:
    """Regressors of one cause.

    Parameters
    ----------
    kind : str
        ``offset``, ``start`` (memory from before a run), ``curve`` over an input, ``load``,
        ``hysteresis`` (branches by region), ``lag``, ``drift``, ``speed``, ``creep``, ``output`` (its
        curve) or ``runs`` (offsets between them).
    channel : str
        The channel that they are made of; "" for the output and time.
    columns : tuple of int
        Places.
    beside : tuple of int
        Places of what the residual may follow without this group being at fault.
    delay : int
        Of a lag: samples by which the modelled output is best shifted.
    """

    kind: str
    channel: str
    columns: tuple[int, ...]
    beside: tuple[int, ...] = ()
    delay: int = 0


def averaged(samples: Array, every: int) -> Array:
    """Return the means over blocks of so many samples, shape (n // every, ...)."""
    n = len(samples) // every
    return np.asarray(samples[: n * every].reshape(n, every, *samples.shape[1:]).mean(axis=1))


def suspects(
    block: Block, runs: Sequence[Run], output: int, every: int
) -> tuple[tuple[Group, ...], list[Array]]:
    """Return the groups of possible causes of an output's residual, and columns (blocks, k) per run.

    Columns are means over blocks of so many samples. Groups that come first have room first where
    recordings are short.
    """
    room = max(sum(len(run.inputs) // every for run in runs) // PER_COLUMN, 1)
    tables = [np.zeros((len(run.inputs) // every, 0)) for run in runs]
    groups: list[Group] = []

    def add(
        kind: str,
        columns: Sequence[Array],
        channel: str = "",
        beside: tuple[int, ...] | None = None,
        delay: int = 0,
    ) -> tuple[int, ...]:
        first, more = tables[0].shape[1], columns[0].shape[1]
        places = tuple(range(first, first + more))
        if not 0 < more <= room - first:
            return ()
        groups.append(Group(kind, channel, places, known if beside is None else beside, delay))
        for i, part in enumerate(columns):
            tables[i] = np.column_stack([tables[i], averaged(part, every)])
        return places

    modelled = _scaled([run.modelled[:, output] for run in runs])
    causes = {name: _scaled(_samples(runs, name)) for name in _moving(block, runs)}
    driven = [name for name in causes if name in _driven(block)]
    known: tuple[int, ...] = ()
    known = add("offset", [np.ones((len(y), 1)) for y in modelled])
    known += add("start", [_start([causes[name][i] for name in driven]) for i in range(len(runs))])
    delay = _best_delay(runs, output)
    add("lag", [_lagging(y, delay) for y in modelled], delay=delay)
    for name, x in causes.items():
        if name in driven:
            places = add("curve", _hats(x, max(KNOTS // len(driven), 4)), name)
            add("hysteresis", [_branches(part) for part in x], name, (*known, *places))
        else:
            acting = zip(x, modelled, strict=True)
            add("load", [np.column_stack([load, load * y]) for load, y in acting], name)
    add("drift", _trends(modelled))
    add("speed", [_speeds(y) for y in modelled])
    longest = _longest_hold(block, runs, list(causes))
    if longest:
        add("creep", [_creeping(y, longest) for y in modelled])
    add("output", _hats(modelled, KNOTS))
    own = np.eye(len(runs))[:, 1:]
    add("runs", [np.tile(row, (len(y), 1)) for row, y in zip(own, modelled, strict=True)])
    return tuple(groups), tables


def block_length(block: Block, runs: Sequence[Run]) -> int:
    """Return the number of samples per block: short compared with a branch, with a limited total."""
    sizes = [len(run.inputs) for run in runs]
    branches = _branch_lengths(block, runs)
    usual = int(np.median(branches)) // PER_BRANCH if branches else 1
    most = max(int(np.median(sizes)) // (2 * PER_COLUMN), 1)
    return min(max(1, min(usual, sum(sizes) // FEWEST), -(-sum(sizes) // MOST)), most)


def _branch_lengths(block: Block, runs: Sequence[Run]) -> list[int]:
    """Return the samples between turning points of driven inputs."""
    driven = [x for name in _driven(block) for x in _samples(runs, name) if np.ptp(x) > 0]
    return [int(length) for x in driven for length in np.diff(reversals(x))]


def _driven(block: Block) -> list[str]:
    return [c.name for c in block.inputs if c.name not in block.scheduling]


def _moving(block: Block, runs: Sequence[Run]) -> list[str]:
    """Return the inputs, and recorded causes that the model does not use, that vary."""
    inputs, outputs = ([c.name for c in channels] for channels in (block.inputs, block.outputs))
    others = [
        name
        for name in runs[0].recording.channels
        if name.split("_")[0] in CAUSES and name not in (*inputs, *outputs)
    ]
    recorded = [n for n in (*inputs, *others) if all(n in run.recording for run in runs)]
    return [name for name in recorded if np.ptp(np.concatenate(_samples(runs, name))) > 0]


def _samples(runs: Sequence[Run], name: str) -> list[Array]:
    return [run.recording[name] for run in runs]


def _scaled(parts: Sequence[Array]) -> list[Array]:
    """Return samples scaled to a range from -1 to 1."""
    low, high = min(part.min() for part in parts), max(part.max() for part in parts)
    return [2 * (part - low) / ((high - low) or 1.0) - 1 for part in parts]


def _start(inputs: Sequence[Array]) -> Array:
    """Return the part of a run in which earlier memory may act: until inputs cover half their range.

    At most an eighth of a run: over one cycle, more would be a branch.
    """
    reached = 0
    for x in inputs:
        low, high = np.quantile(x, COVERED)
        reached = max(reached, int(np.argmax(x <= low)), int(np.argmax(x >= high)))
    before = np.arange(len(inputs[0])) < min(reached, len(inputs[0]) // START)
    return before[:, np.newaxis].astype(np.float64)


def _hats(parts: Sequence[Array], knots: int) -> list[Array]:
    """Return piecewise-linear basis functions, without the first, which the mean replaces."""
    found = hats(np.concatenate(parts), knots)[:, 1:]
    return np.split(found, np.cumsum([len(part) for part in parts])[:-1])


def _branches(x: Array) -> Array:
    """Return the branch of an input, from -1 to 1 after a distance, and its product with the input."""
    ways = [(x - PI(thresholds=(way,), weights=(1.0,)).simulate(x)) / way for way in WAYS]
    return np.column_stack([part for way in ways for part in (way, way * x)])


def _lagging(modelled: Array, delay: int) -> Array:
    """Return the speed of the modelled output, and its change under a delay."""
    slope = np.gradient(modelled)
    places = np.clip(np.arange(modelled.size) - delay, 0, modelled.size - 1)
    return np.column_stack([slope, modelled[places] - modelled])


def _best_delay(runs: Sequence[Run], output: int) -> int:
    """Return the best shift of the modelled output in samples."""
    most = min(MOST_DELAY, min(len(run.inputs) for run in runs) // LONGER)

    def left(delay: int) -> float:
        total = 0.0
        for run in runs:
            n = len(run.inputs)  # the same samples at every delay
            y = run.measured[most : n - most, output]
            total += float(np.sum((y - run.modelled[most - delay : n - most - delay, output]) ** 2))
        return total

    return min(range(-most, most + 1), key=lambda delay: (left(delay), abs(delay)))


def _trends(modelled: Sequence[Array]) -> list[Array]:
    """Return linear and quadratic trends, and a change of gain over time, for every recording."""
    longest = max(map(len, modelled))
    times = [np.arange(len(y)) / longest for y in modelled]
    return [np.column_stack([t, t**2, t * y]) for t, y in zip(times, modelled, strict=True)]


def _speeds(modelled: Array) -> Array:
    """Return functions of the modelled output's speed; a linear one is a lag."""
    rate = np.gradient(modelled)
    rate = rate / (np.sqrt(np.mean(rate**2)) or 1.0)
    root = np.sign(rate) * np.sqrt(np.abs(rate))
    return np.column_stack([np.abs(rate), root, rate * modelled])


def _longest_hold(block: Block, runs: Sequence[Run], names: Sequence[str]) -> int:
    """Return the samples of the longest hold of all inputs and loads; 0 if holds are rare."""
    shortest = max(int(np.median(_branch_lengths(block, runs))) // 2, 10)
    tables = [run.recording.matrix(names) for run in runs]
    spans = np.ptp(np.concatenate(tables), axis=0).tolist()
    found = [hold.stop - hold.start for table in tables for hold in holds(table, spans, shortest)]
    return max(found, default=0) if sum(found) >= HELD * sum(map(len, tables)) else 0


def _creeping(modelled: Array, longest: int) -> Array:
    """Return the difference of the modelled output from its own slow lags."""
    from scipy.signal import lfilter

    found = []
    for time in (longest / 3, longest):
        share = 1 - np.exp(-1 / time)
        start = [(1 - share) * modelled[0]]
        found.append(modelled - lfilter([share], [1.0, share - 1.0], modelled, zi=start)[0])
    return np.column_stack(found)
