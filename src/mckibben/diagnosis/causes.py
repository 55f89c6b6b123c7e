"""Causes of a residual: regressors of effects that a model may lack, tested by cross-validation.

Regressors are computed at every sample and averaged over blocks that are short against a branch of the
loop. All are made of inputs, loads, the modelled output and time, none of the measured output, whose
noise is the residual's. A cause counts if its regressors reduce the squared residual of segments that
they were not fitted to. ``benchmarks/validation.py`` measures how often a correct model is rejected, and
how often the right cause is found first.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.hysteresis.pi import PI
from mckibben.blocks.runs import FreeRun
from mckibben.numerics.blocks import blocks_of, squared_errors, sums_of_others
from mckibben.numerics.least_squares import solve_products
from mckibben.numerics.statistics import correlation_length, half_interval, hats
from mckibben.recording import base_name
from mckibben.signals.holds import holds
from mckibben.signals.reversals import reversals

PER_BRANCH, FEWEST_BLOCKS, MOST_BLOCKS = 24, 400, 6000
"""Smallest number of blocks per typical branch of the input; smallest and largest number of blocks, if
there are as many samples.
"""

PER_COLUMN = 6
"""Smallest number of blocks per regressor."""

KNOTS = 8
"""Total number of knots of curves over the inputs."""

REVERSAL_SHARES = (0.05, 0.2, 0.6)
"""Distances of reversal, in shares of half the range, after which the input is on the other branch.
"""

HOLDS_SHARE = 0.15
"""Share of samples in holds above which creep is distinguished from the loop."""

MOST_DELAY, DELAYS_PER_RECORDING = 50, 8
"""Largest shift of outputs [samples], and the shortest recording as its multiple."""

CAUSES = ("pressure", "voltage", "force", "torque")
"""Channels that may explain a residual although the model does not use them."""

SEGMENTS, FEWEST_SEGMENTS, SEGMENT_MEMORIES = 40, 8, 4.0
"""Largest and smallest number of segments of cross-validation; their length in correlation lengths of
what no regressor explains.
"""

FOLDS = 4
"""Number of cross-validation folds; segments belong to them in turn."""

LEAST_SHARE, LEVEL = 0.02, 0.01
"""Smallest share of the residual's variance of a cause, and significance level of its mean reduction of
the squared residual over segments (one-sided t-test).
"""

RIDGE = 1e-6
"""Regularisation, relative to a regressor's energy."""


@dataclass(frozen=True)
class Cause:
    """A cause of a residual.

    Parameters
    ----------
    kind : str
        ``offset``, ``curve`` over an input, ``load``, ``hysteresis`` (branch of an input), ``lag``,
        ``drift``, ``speed``, ``creep`` or ``output`` (curve of the modelled output).
    channel : str
        The channel of its regressors; empty for the output and time.
    share : float
        Share of the residual's variance that it explains on segments not fitted, given the causes
        before; 0 to 1.
    size : float
        The same as a root mean square, in the unit of the output.
    coefficient : float or None
        The offset [unit of the output], or the delay of measured after modelled motion [samples].
    """

    kind: str
    channel: str
    share: float
    size: float
    coefficient: float | None = None


@dataclass(frozen=True)
class _Group:
    """Regressors of a cause: their columns, and those of effects that are no fault of its own."""

    kind: str
    channel: str
    columns: tuple[int, ...]
    given: tuple[int, ...] = ()
    delay: int = 0


def causes(
    block: Block, runs: Sequence[FreeRun], output: int, residuals: Sequence[Array], block_size: int
) -> tuple[tuple[Cause, ...], tuple[Cause, ...]]:
    """Return the significant causes of a residual, largest first, and every cause by itself.

    Drift counts only as the first, an offset only alone: any misfit has a trend and a mean.

    Parameters
    ----------
    residuals : sequence of array, shape (n,)
        Of every run, as means over blocks of ``every`` samples.
    """
    groups, tables = _groups(block, runs, output, block_size)
    slow = [
        place for group in groups if group.kind in ("offset", "drift") for place in group.columns
    ]
    test = _Test(residuals, tables, slow)
    significant_causes: list[Cause] = []
    columns: tuple[int, ...] = (0,)
    candidates = [group for group in groups if group.kind != "offset"]
    while significant := [group for group in candidates if test.significant(group, columns)]:
        best = max(significant, key=lambda group: test.total_gain(group, columns))
        significant_causes.append(test.cause(best, columns))
        columns = (*columns, *best.given, *best.columns)
        candidates = [group for group in candidates if group is not best and group.kind != "drift"]
    offset = groups[0]
    if not significant_causes and test.significant(offset, ()):
        significant_causes.append(test.cause(offset, ()))
    every_cause = [test.cause(group, (0,) if group.columns != (0,) else ()) for group in groups]
    return tuple(significant_causes), tuple(every_cause)


class _Test:
    """Cross-validated least squares of a residual on columns."""

    def __init__(
        self, residuals: Sequence[Array], tables: Sequence[Array], slow: Sequence[int]
    ) -> None:
        x, e = np.concatenate(tables), np.concatenate(residuals)
        self.mean, self.n = float(e.mean()), e.size
        ends = np.cumsum([len(piece) for piece in residuals])[:-1]

        def memory(columns: Array) -> float:
            residual = e - columns @ np.linalg.lstsq(columns, e, rcond=None)[0]
            return correlation_length(np.split(residual, ends))

        self.long_enough = e.size >= FEWEST_SEGMENTS * memory(x[:, slow])
        n_segments = min(int(e.size / (SEGMENT_MEMORIES * memory(x))), SEGMENTS)
        segments = [
            part
            for run in blocks_of(np.split(np.column_stack([x, e]), ends), n_segments)
            for part in run
            if part.size
        ]
        self.products = np.array([part.T @ part for part in segments])
        self.folds = np.arange(len(segments)) % min(FOLDS, len(segments))

    def errors(self, columns: tuple[int, ...]) -> Array:
        """Return the squared error of every segment, with columns fitted to the other folds."""
        indices = [*dict.fromkeys(columns), -1]
        products = self.products[:, indices][:, :, indices]
        weights = solve_products(sums_of_others(products, self.folds), len(indices) - 1, RIDGE)
        return squared_errors(products, weights[self.folds])[:, 0]

    def gains(self, group: _Group, columns: tuple[int, ...]) -> Array:
        """Return the reduction of every segment's squared error by a cause."""
        given_columns = (*columns, *group.given)
        return self.errors(given_columns) - self.errors((*given_columns, *group.columns))

    def total_gain(self, group: _Group, columns: tuple[int, ...]) -> float:
        """Return the reduction of the squared error by a cause and what it is given."""
        all_columns = (*columns, *group.given, *group.columns)
        return float((self.errors(columns) - self.errors(all_columns)).sum())

    def significant(self, group: _Group, columns: tuple[int, ...]) -> bool:
        """Return whether a cause reduces the error, beyond chance and by a share that matters."""
        gains, total = self.gains(group, columns), float(self.errors(columns).sum())
        if gains.size < 2 or not self.long_enough or not gains.sum() > LEAST_SHARE * total:
            return False
        return bool(gains.mean() > half_interval(gains, 1 - 2 * LEVEL))

    def cause(self, group: _Group, columns: tuple[int, ...]) -> Cause:
        """Return what a group explains in addition to known columns."""
        gain = max(float(self.gains(group, columns).sum()), 0.0)
        total = float(self.errors((0,) if group.kind != "offset" else ()).sum())
        coefficient = {"lag": float(group.delay), "offset": self.mean}.get(group.kind)
        share = min(gain / total, 1.0) if total > 0 else 0.0
        return Cause(group.kind, group.channel, share, float(np.sqrt(gain / self.n)), coefficient)


def averaged(samples: Array, block_size: int) -> Array:
    """Return the means over blocks of so many samples, shape (n // every, ...)."""
    n = len(samples) // block_size
    return np.asarray(
        samples[: n * block_size].reshape(n, block_size, *samples.shape[1:]).mean(axis=1)
    )


def _groups(
    block: Block, runs: Sequence[FreeRun], output: int, block_size: int
) -> tuple[list[_Group], list[Array]]:
    """Return the groups of regressors, and their columns (blocks, k) of every run; the first is 1."""
    room = max(sum(len(run) // block_size for run in runs) // PER_COLUMN, 1)
    tables = [np.ones((len(run) // block_size, 1)) for run in runs]
    groups = [_Group("offset", "", (0,))]
    modelled = _scaled([run.modelled[:, output] for run in runs])
    for kind, channel, delay, columns in _regressors(block, runs, output, modelled):
        first, more = tables[0].shape[1], columns[0].shape[1]
        if 0 < more <= room - first:
            curve = groups[-1].columns if groups[-1].kind == "curve" else ()
            given = curve if kind == "hysteresis" else ()
            places = tuple(range(first, first + more))
            groups.append(_Group(kind, channel, places, given, delay))
            for i, part in enumerate(columns):
                tables[i] = np.column_stack([tables[i], averaged(part, block_size)])
    return groups, tables


def _regressors(
    block: Block, runs: Sequence[FreeRun], output: int, modelled: Sequence[Array]
) -> Iterator[tuple[str, str, int, list[Array]]]:
    """Yield kind, channel, delay and columns of causes; short recordings have room for the first."""
    delay = _best_delay(runs, output)
    yield "lag", "", delay, [_lagging(y, delay) for y in modelled]
    names = _moving(block, runs)
    driven = [name for name in names if name in _driven(block)]
    for name in names:
        x = _scaled(_samples(runs, name))
        if name in driven:
            yield "curve", name, 0, _hats(x, max(KNOTS // len(driven), 4))
            yield "hysteresis", name, 0, [_branches(part) for part in x]
        else:
            acting = zip(x, modelled, strict=True)
            yield "load", name, 0, [np.column_stack([load, load * y]) for load, y in acting]
    yield "drift", "", 0, _trends(modelled)
    yield "speed", "", 0, [_speeds(y) for y in modelled]
    if longest := _longest_hold(block, runs, names):
        yield "creep", "", 0, [_creeping(y, longest) for y in modelled]
    yield "output", "", 0, _hats(modelled, KNOTS)


def block_length(block: Block, runs: Sequence[FreeRun]) -> int:
    """Return the number of samples per block: short compared with a branch, with a limited total."""
    sizes = [len(run) for run in runs]
    branches = _branch_lengths(block, runs)
    branch_share = int(np.median(branches)) // PER_BRANCH if branches else 1
    largest = max(int(np.median(sizes)) // (2 * PER_COLUMN), 1)
    return min(
        max(1, min(branch_share, sum(sizes) // FEWEST_BLOCKS), -(-sum(sizes) // MOST_BLOCKS)),
        largest,
    )


def _branch_lengths(block: Block, runs: Sequence[FreeRun]) -> list[int]:
    """Return the samples between turning points of driven inputs."""
    driven = [x for name in _driven(block) for x in _samples(runs, name) if np.ptp(x) > 0]
    return [int(length) for x in driven for length in np.diff(reversals(x))]


def _driven(block: Block) -> list[str]:
    return [c.name for c in block.inputs if c.name not in block.scheduling]


def _moving(block: Block, runs: Sequence[FreeRun]) -> list[str]:
    """Return the inputs, and recorded causes that the model does not use, that vary."""
    inputs, outputs = ([c.name for c in channels] for channels in (block.inputs, block.outputs))
    others = [
        name
        for name in runs[0].source.channels
        if base_name(name) in CAUSES and name not in (*inputs, *outputs)
    ]
    recorded = [n for n in (*inputs, *others) if all(n in run.source for run in runs)]
    return [name for name in recorded if np.ptp(np.concatenate(_samples(runs, name))) > 0]


def _samples(runs: Sequence[FreeRun], name: str) -> list[Array]:
    return [run.source[name] for run in runs]


def _scaled(parts: Sequence[Array]) -> list[Array]:
    """Return samples scaled to a range from -1 to 1."""
    low, high = min(part.min() for part in parts), max(part.max() for part in parts)
    return [2 * (part - low) / ((high - low) or 1.0) - 1 for part in parts]


def _hats(parts: Sequence[Array], knots: int) -> list[Array]:
    """Return piecewise-linear basis functions, without the first, which the mean replaces."""
    table = hats(np.concatenate(parts), knots)[:, 1:]
    return np.split(table, np.cumsum([len(part) for part in parts])[:-1])


def _branches(x: Array) -> Array:
    """Return the branch of an input, from -1 to 1 after a distance, and its product with the input."""
    plays = [
        (x - PI(thresholds=(distance,), weights=(1.0,)).simulate(x)) / distance
        for distance in REVERSAL_SHARES
    ]
    return np.column_stack([part for branch in plays for part in (branch, branch * x)])


def _lagging(modelled: Array, delay: int) -> Array:
    """Return the speed of the modelled output, and its change under a delay."""
    slope = np.gradient(modelled)
    places = np.clip(np.arange(modelled.size) - delay, 0, modelled.size - 1)
    return np.column_stack([slope, modelled[places] - modelled])


def _best_delay(runs: Sequence[FreeRun], output: int) -> int:
    """Return the best shift of the modelled output in samples."""
    largest = min(MOST_DELAY, min(len(run) for run in runs) // DELAYS_PER_RECORDING)

    def squared_error(delay: int) -> float:
        total = 0.0
        for run in runs:
            n = len(run)  # the same samples at every delay
            y = run.outputs[largest : n - largest, output]
            total += float(
                np.sum((y - run.modelled[largest - delay : n - largest - delay, output]) ** 2)
            )
        return total

    return min(range(-largest, largest + 1), key=lambda delay: (squared_error(delay), abs(delay)))


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


def _longest_hold(block: Block, runs: Sequence[FreeRun], names: Sequence[str]) -> int:
    """Return the samples of the longest hold of all inputs and loads; 0 if holds are rare."""
    shortest = max(int(np.median(_branch_lengths(block, runs))) // 2, 10)
    tables = [run.source.matrix(names) for run in runs]
    spans = np.ptp(np.concatenate(tables), axis=0).tolist()
    lengths = [hold.stop - hold.start for table in tables for hold in holds(table, spans, shortest)]
    return max(lengths, default=0) if sum(lengths) >= HOLDS_SHARE * sum(map(len, tables)) else 0


def _creeping(modelled: Array, longest: int) -> Array:
    """Return the difference of the modelled output from its own slow lags."""
    from scipy.signal import lfilter

    differences = []
    for time in (longest / 3, longest):
        share = 1 - np.exp(-1 / time)
        start = [(1 - share) * modelled[0]]
        differences.append(modelled - lfilter([share], [1.0, share - 1.0], modelled, zi=start)[0])
    return np.column_stack(differences)
