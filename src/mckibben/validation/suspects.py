"""What a residual may follow: columns, in groups with a name, each what a model can lack.

They are computed of every sample and then averaged over blocks, which loses nothing of what is as slow
as a branch of the loop, and makes noise short. All are made of inputs, the modelled output and time;
nothing is made of the measured output, whose noise is the residual's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.hysteresis.pi import PI
from mckibben.signals.reversals import reversals
from mckibben.validation.residuals import Run

PER_BRANCH = 24
"""Blocks to a branch of the input, of those that are short."""

SHORT = 0.25
"""Quantile of the branches' lengths that is reckoned with."""

FEWEST, MOST = 400, 6000
"""Blocks looked at at least, where there are as many samples, and at most."""

KNOTS, FEWER = 12, 5
"""Of the curve over a single input, and over each of several."""

DEAD_ZONES = (0.05, 0.2, 0.5)
"""Thresholds of the play operators that remember an input, as shares of half its range."""

STILL = 0.005
"""Share of its range that an input moves in as many blocks of a hold as `SHARE` at most."""

HELD = 0.15
"""Share of the blocks that are held from which creep is told from the loop."""

LARGE = 0.25
"""Step, as a share of the range, that is large."""

LAGS = (1, 2, 4, 8)
"""Blocks by which the input is shifted to be correlated with the residual."""

SHARE = 6
"""Blocks to a column at least."""

MOST_DELAY, LONGER = 50, 8
"""Samples that outputs are shifted by at most, and the shortest recording as a multiple of that."""


@dataclass(frozen=True)
class Group:
    """Columns that belong together.

    Parameters
    ----------
    kind : str
        What they stand for: ``offset``, ``runs``, ``curve``, ``load``, ``hysteresis``, ``lag``,
        ``speed``, ``creep``, ``drift``, ``output``, ``crossing``.
    channel : str
        The channel they are made of, or "".
    columns : tuple of int
        Where they stand.
    beside : tuple of int
        What the residual may follow without this group being at fault.
    delay : int
        Of a lag: whole samples by which the modelled output is best shifted; 0 for less than one.
    """

    kind: str
    channel: str
    columns: tuple[int, ...]
    beside: tuple[int, ...] = ()
    delay: int = 0


@dataclass(frozen=True)
class Suspects:
    """The columns of all recordings.

    Parameters
    ----------
    every : int
        Samples to a block.
    tables : tuple of array, shape (blocks, k)
        Of every recording.
    groups : tuple of Group
    large_steps : bool
        Whether holds follow large steps.
    """

    every: int
    tables: tuple[Array, ...]
    groups: tuple[Group, ...]
    large_steps: bool

    def of(self, kind: str, channel: str = "") -> Group | None:
        """Return a group, or None."""
        found = (g for g in self.groups if g.kind == kind and channel in ("", g.channel))
        return next(found, None)


def averaged(samples: Array, every: int) -> Array:
    """Return the means over blocks of so many samples, shape (n // every, ...)."""
    n = len(samples) // every
    return np.asarray(samples[: n * every].reshape(n, every, *samples.shape[1:]).mean(axis=1))


def suspects(block: Block, runs: Sequence[Run], output: int, every: int) -> Suspects:
    """Return what the residual of an output may follow, of blocks of so many samples."""
    names = [channel.name for channel in block.inputs]
    driven = [k for k, name in enumerate(names) if name not in block.scheduling]
    spans = {
        k: (low, high)
        for k in range(len(names))
        if (low := min(float(run.inputs[:, k].min()) for run in runs))
        < (high := max(float(run.inputs[:, k].max()) for run in runs))
    }
    blocks = [len(run.inputs) // every for run in runs]
    maker = _Maker(blocks)
    constant = maker.add("offset", "", [np.ones((size, 1)) for size in blocks])
    knots = KNOTS if len(spans) == 1 else FEWER
    knots = int(np.clip(sum(blocks) // (6 * SHARE * len(spans)), 4, knots))
    scaled = {
        k: [2 * (run.inputs[:, k] - low) / (high - low) - 1 for run in runs]
        for k, (low, high) in spans.items()
    }
    means = {k: [averaged(x, every) for x in parts] for k, parts in scaled.items()}
    moving = [k for k in spans if k in driven]
    for k in spans:
        kind = "curve" if k in driven else "load"
        curve = maker.add(kind, names[k], _hats(means[k], knots), constant)
        if k in moving:
            memory = [averaged(_memory(x), every) for x in scaled[k]]
            maker.add("hysteresis", names[k], memory, (*constant, *curve))
    delay = _delay(runs, output)
    lagging = [_lagging(run.modelled[:, output], delay, every) for run in runs]
    maker.add("lag", "", lagging, constant, delay)
    maker.add("drift", "", _trends(blocks), constant)
    large = False
    for k in moving:
        creeping = _creeping(means[k])
        if creeping is not None:
            maker.add("creep", names[k], creeping, constant)
            large |= any(np.abs(np.diff(x)).max() > 2 * LARGE for x in means[k])
    for k in moving:
        maker.add("crossing", names[k], [_shifted(x) for x in means[k]], constant)
        speeds = _speeds(means[k])
        if speeds is not None:
            maker.add("speed", names[k], speeds, constant)
    modelled = [averaged(run.modelled[:, output], every) for run in runs]
    maker.add("output", "", _hats(modelled, FEWER), constant)
    if len(runs) > 1:
        own = np.eye(len(runs))[:, 1:]
        maker.add(
            "runs", "", [np.tile(own[i], (size, 1)) for i, size in enumerate(blocks)], constant
        )
    return Suspects(every, maker.tables(), tuple(maker.groups), large)


class _Maker:
    """Columns put side by side, group by group, while there are blocks for them."""

    def __init__(self, blocks: Sequence[int]) -> None:
        self._parts: list[list[Array]] = [[] for _ in blocks]
        self._room = sum(blocks) // SHARE
        self._count = 0
        self.groups: list[Group] = []

    def add(
        self,
        kind: str,
        channel: str,
        parts: Sequence[Array],
        beside: tuple[int, ...] = (),
        delay: int = 0,
    ) -> tuple[int, ...]:
        width = parts[0].shape[1]
        if self._count + width > max(self._room, 1):
            return ()
        columns = tuple(range(self._count, self._count + width))
        self._count += width
        self.groups.append(Group(kind, channel, columns, beside, delay))
        for own, part in zip(self._parts, parts, strict=True):
            own.append(part)
        return columns

    def tables(self) -> tuple[Array, ...]:
        return tuple(np.concatenate(own, axis=1) for own in self._parts)


def block_length(block: Block, runs: Sequence[Run]) -> int:
    """Return how many samples make a block: few beside a branch, and not too many blocks in all."""
    names = [channel.name for channel in block.inputs]
    lengths = [
        length
        for run in runs
        for k, name in enumerate(names)
        if name not in block.scheduling and np.ptp(run.inputs[:, k]) > 0
        for length in np.diff(reversals(run.inputs[:, k]))
    ]
    sizes = [len(run.inputs) for run in runs]
    usual = int(np.quantile(lengths, SHORT)) // PER_BRANCH if lengths else 1
    most = max(int(np.median(sizes)) // (2 * SHARE), 1)
    usual = min(usual, sum(sizes) // FEWEST)
    return int(min(max(1, usual, -(-sum(sizes) // MOST)), most))


def _hats(parts: Sequence[Array], knots: int) -> list[Array]:
    """Return piecewise-linear functions between knots that have as many blocks between them."""
    at = np.unique(np.quantile(np.concatenate(parts), np.linspace(0, 1, knots)))
    if at.size < 2:
        return [np.zeros((part.size, 1)) for part in parts]
    return [
        np.column_stack([np.interp(part, at, row) for row in np.eye(at.size)[1:]]) for part in parts
    ]


def _memory(x: Array) -> Array:
    """Return the direction of an input from -1 to 1, times it too, and play operators that follow it."""
    if np.ptp(x) == 0:
        way = np.zeros(x.size)
    else:
        turns = reversals(x)
        ways = np.repeat(np.sign(np.diff(x[turns])), np.diff(turns))
        way = np.concatenate([ways[:1], ways])
    plays = [PI(thresholds=(zone,), weights=(1.0,)).simulate(x) - x for zone in DEAD_ZONES]
    return np.column_stack([way, way * x, *plays])


def _speeds(parts: Sequence[Array]) -> list[Array] | None:
    """Return functions of the speed; None where there is one speed only."""
    rates = [np.gradient(part) if part.size > 1 else np.zeros(part.size) for part in parts]
    usual = float(np.sqrt(np.mean(np.concatenate(rates) ** 2)))
    if usual == 0:
        return None
    scaled = [rate / usual for rate in rates]
    return [
        np.column_stack([r, np.abs(r), np.sign(r) * np.sqrt(np.abs(r)), r * part])
        for r, part in zip(scaled, parts, strict=True)
    ]


def _creeping(parts: Sequence[Array]) -> list[Array] | None:
    """Return how far an input is ahead of its own slow lags; None without holds."""
    from scipy.signal import lfilter

    still = [_held(part) for part in parts]
    longest = max(map(_longest, still))
    if sum(map(np.sum, still)) < HELD * sum(part.size for part in parts) or longest < SHARE:
        return None
    found = []
    times = np.geomspace(1.0, longest, 4)
    for part in parts:
        columns = []
        for time in times:
            share = 1 - np.exp(-1 / time)
            late = lfilter([share], [1.0, share - 1.0], part, zi=[(1 - share) * part[0]])[0]
            columns.append(part - late)
        found.append(np.column_stack(columns))
    return found


def _held(x: Array) -> Array:
    """Return which blocks are in a hold."""
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    quiet = maximum_filter1d(x, SHARE) - minimum_filter1d(x, SHARE) < 2 * STILL
    return np.asarray(maximum_filter1d(quiet, SHARE))


def _longest(flags: Array) -> int:
    """Return how many flags in a row are set at most."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return int(np.max(edges[1::2] - edges[::2], initial=0))


def _shifted(x: Array) -> Array:
    """Return an input as it is and as it was; before the first sample as there."""
    return np.column_stack(
        [x, *(np.concatenate([np.full(min(lag, x.size), x[0]), x[:-lag]]) for lag in LAGS)]
    )


def _delay(runs: Sequence[Run], output: int) -> int:
    """Return by how many samples the modelled output is best shifted."""
    most = min(MOST_DELAY, min(len(run.inputs) for run in runs) // LONGER)
    pairs = [(run.measured[:, output], run.modelled[:, output]) for run in runs]

    def left(delay: int) -> float:
        total = 0.0
        for y, modelled in pairs:
            # the same samples at every delay
            kept = slice(most, len(y) - most)
            total += float(np.sum((y[kept] - modelled[most - delay : len(y) - most - delay]) ** 2))
        return total

    return min(range(-most, most + 1), key=lambda delay: (left(delay), abs(delay)))


def _lagging(modelled: Array, delay: int, every: int) -> Array:
    """Return how fast the modelled output moves; and how far it is from itself when it is delayed."""
    slope = np.gradient(modelled)
    if delay == 0:
        return averaged(slope[:, np.newaxis], every)
    shifted = np.roll(modelled, delay)
    shifted[slice(delay) if delay > 0 else slice(delay, None)] = modelled[0 if delay > 0 else -1]
    return averaged(np.column_stack([slope, shifted - modelled]), every)


def _trends(lengths: Sequence[int]) -> list[Array]:
    """Return slow functions of time: a line and a parabola that begin with every recording."""
    longest = max(lengths)
    return [np.column_stack([t := np.arange(n) / longest, t**2]) for n in lengths]
