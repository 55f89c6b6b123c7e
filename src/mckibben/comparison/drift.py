"""Drift: what of a model's error is slower than the motion, and was not there in training.

Rubber creeps for tens of minutes, valves warm up, supports settle. A model foresees of this what a lag
that training has shown can carry on, and no more; the rest is a slow error, which feedback on the robot
takes out. Errors are averaged over windows longer than the motion's cycles. Those of training and test
together follow a line through the windows: how the mean and the mean square of every input go, which a
model that is wrong at some inputs makes up, a slope in training, and an offset and a slope in the test:
the drift. Its intervals count windows that depend on their neighbours as fewer. Errors
that stay alike for several windows are drift, too, whatever they come from.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.numerals import numeral
from mckibben.signals.reversals import reversals

CYCLES = 2.0
"""Of the slowest input that a window lasts."""

FEWEST, MOST = 6, 40
"""Windows in the longest test recording: of fewer nothing is told, of more they are made longer."""

CERTAIN, TOLD = 0.98, 0.95
"""Confidence from which there is a drift, in its offset and its change together; and of intervals."""

FORESEEN = 0.5
"""Share of a drift up to which a model has foreseen it that is left with so much."""

NOTABLE = 0.1
"""Share of the squared error below which a drift is not worth a word."""

SLOW, APART = 6, 4
"""Most terms of the polynomial that slow errors in training may follow, and fewest windows to a term."""

LONG = 120.0
"""Duration that is told in minutes [s]."""

MOST_ALIKE = 0.95
"""Largest correlation of neighbouring windows that is reckoned with."""


@dataclass(frozen=True)
class Stretch:
    """A model's error on a recording.

    Parameters
    ----------
    errors : array, shape (n,)
        Measured less modelled.
    inputs : array, shape (n, k)
        What drives.
    counts : array of bool, shape (n,)
        Samples that are scored.
    """

    errors: Array
    inputs: Array
    counts: NDArray[np.bool_]


@dataclass(frozen=True)
class Drift:
    """The slow part of a model's error on the test.

    Parameters
    ----------
    output : str
        Channel.
    unit : str
        Its unit.
    offset : float
        Slow error halfway through the test, measured less modelled, at the motion that training had.
    offset_interval : (float, float)
        95 % interval.
    change : float
        How it changes over the test.
    change_interval : (float, float)
        95 % interval.
    duration : float
        Of the longest test recording [s].
    share : float
        Of the squared error on the test that the drift makes up, 0 to 1.
    certain : bool
        Whether it is more than chance, and notable.
    filter_time : float
        Time of a window [s]: what an observer of the drift may average over.
    rmse, adapted : float
        Of the test, and what is left of it where such an observer takes off what it has seen before.
    """

    output: str
    unit: str
    offset: float
    offset_interval: tuple[float, float]
    change: float
    change_interval: tuple[float, float]
    duration: float
    share: float
    certain: bool
    filter_time: float
    rmse: float
    adapted: float

    @property
    def size(self) -> float:
        """Root mean square of the offset and the change over the test."""
        return float(np.hypot(self.offset, self.change / np.sqrt(12.0)))

    def __str__(self) -> str:
        """Return it as a sentence without its end, or nothing where there is none to tell of."""
        if not self.certain:
            return ""
        offset = self._with(self.offset, self.offset_interval)
        change = self._with(self.change, self.change_interval)
        long, minutes = self.duration >= LONG, numeral(self.duration / 60, 2)
        lasted = f"{minutes} min" if long else f"{numeral(self.duration, 2)} s"
        return (
            f"drift, slower than the motion: {self.output} is off by {offset}, changing by {change} "
            f"over {lasted} of test, {numeral(100 * self.share, 2)} % of the squared error"
        )

    def _with(self, value: float, interval: tuple[float, float]) -> str:
        low, high = (numeral(end, 2) for end in interval)
        return f"{numeral(value, 2)} {self.unit} ({low} to {high})"

    def foresees(self, other: Drift) -> bool:
        """Tell whether what is left here of another model's drift is little, and may be chance."""
        little = self.size < FORESEEN * other.size
        return self.output == other.output and little and not self.certain

    def advice(self, invertible: bool) -> str:
        """Return what to do on the robot, as a sentence without its end."""
        left = (
            f"which would have left {numeral(self.adapted, 2)} of {numeral(self.rmse, 2)} {self.unit} "
            "RMSE here"
        )
        if not invertible:
            return f"adapt on the robot by an observer of a model that has an inverse, {left}"
        return (
            "adapt on the robot: from mckibben.control import DisturbanceObserver; DisturbanceObserver("
            f'mckibben.load("model.json").inverse(), filter_time={numeral(self.filter_time, 2)}), {left}'
        )

    def to_dict(self) -> dict[str, Any]:
        """Return it for JSON."""
        return asdict(self)


def drift_of(
    train: Sequence[Stretch], test: Sequence[Stretch], step: float, output: str, unit: str
) -> Drift | None:
    """Return the slow part of the error of an output, or None where the test is too short to tell.

    Parameters
    ----------
    train, test : sequence of Stretch
        Errors on the data fitted, and on the test.
    step : float
        Sample time [s].
    output, unit : str
        What the errors are of.
    """
    longest = max((len(one.errors) for one in test), default=0)
    size = max(int(np.ceil(CYCLES * _cycle(test))), -(-longest // MOST))
    if longest // size < FEWEST:
        return None
    width = 2 * test[0].inputs.shape[1]
    known, asked = (_Windows.of(part, size, width) for part in (train, test))
    if len(asked.means) < FEWEST:
        return None
    found, errors, freedom = _line(known, asked)
    # a change is told over the longest recording
    scale = np.array([1.0, float(longest)])
    size_of, error_of = found * scale, errors * scale
    from scipy.stats import t

    beyond = bool((np.abs(size_of) > error_of * t.isf((1 - CERTAIN) / 4, freedom)).any())
    reach = error_of * t.isf((1 - TOLD) / 2, freedom)
    every = np.concatenate([one.errors[one.counts] for one in test])
    slow = np.concatenate(
        [
            (found[0] + found[1] * (np.arange(len(one.errors)) - asked.time.mean()))[one.counts]
            for one in test
        ]
    )
    squares = float(every @ every)
    share = 1.0 - float(np.sum((every - slow) ** 2)) / squares if squares > 0 else 0.0
    filter_time = size * step
    adapted = np.concatenate(
        [adapted_by(one.errors, step, filter_time)[one.counts] for one in test]
    )
    offset, change = size_of.tolist()
    low, high = (size_of - reach).tolist(), (size_of + reach).tolist()
    return Drift(
        output=output,
        unit=unit,
        offset=offset,
        offset_interval=(low[0], high[0]),
        change=change,
        change_interval=(low[1], high[1]),
        duration=longest * step,
        share=max(share, 0.0),
        certain=beyond and share >= NOTABLE,
        filter_time=filter_time,
        rmse=float(np.sqrt(squares / every.size)),
        adapted=float(np.sqrt(np.mean(adapted**2))),
    )


def adapted_by(errors: Array, step: float, filter_time: float) -> Array:
    """Return the errors of a model, shape (n,), less what an observer has seen of them before.

    It is `mckibben.control.DisturbanceObserver`'s: their low pass, up to the sample before.
    """
    from scipy.signal import lfilter

    share = 1.0 - np.exp(-step / filter_time)
    seen = np.asarray(lfilter([share], [1.0, share - 1.0], errors))
    return np.asarray(errors - np.concatenate([[0.0], seen[:-1]]))


@dataclass(frozen=True)
class _Windows:
    """Windows of several recordings, one after another: all arrays have one row a window.

    ``after`` tells which follows the one before in the same recording, ``time`` is in samples.
    """

    means: Array
    time: Array
    motion: Array
    after: NDArray[np.bool_]

    @classmethod
    def of(cls, stretches: Sequence[Stretch], size: int, width: int) -> _Windows:
        """Return whole windows, of which at least half is scored."""
        means, time, motion, after = [], [], [], []
        for one in stretches:
            last = -2
            for place in range(len(one.errors) // size):
                part = slice(place * size, (place + 1) * size)
                kept = one.counts[part]
                if 2 * kept.sum() < size:
                    continue
                inputs = one.inputs[part][kept]
                means.append(one.errors[part][kept].mean())
                time.append((place + 0.5) * size)
                motion.append([*inputs.mean(axis=0), *(inputs**2).mean(axis=0)])
                after.append(place == last + 1)
                last = place
        table = np.array(motion, dtype=np.float64).reshape(len(means), width)
        return cls(np.array(means), np.array(time), table, np.array(after, dtype=bool))


def _line(known: _Windows, asked: _Windows) -> tuple[Array, Array, float]:
    """Return the test's offset and its slope per sample, their standard errors, and the freedom."""
    n, time = len(known.means), asked.time - asked.time.mean()
    line = np.vstack([np.zeros((n, 2)), np.column_stack([np.ones(time.size), time])])
    slow = _slow(known.time)
    slow = np.vstack([slow, np.zeros((time.size, slow.shape[1]))])
    motion = np.vstack([known.motion, asked.motion])
    usual = (known if n else asked).motion.mean(axis=0)
    table = np.column_stack([line, slow, _scaled(motion - usual)])
    means = np.append(known.means, asked.means)
    found, _, rank, _ = np.linalg.lstsq(table, means, rcond=1e-9)
    spread, freedom = _spread(
        means - table @ found,
        np.append(known.after, asked.after),
        time.size,
        rank,
        line.shape[1] + slow.shape[1],
    )
    # the model's own offset is no better known than the mean of its errors in training
    offset, slope = np.diag(np.linalg.pinv(table.T @ table, rcond=1e-12))[:2]
    errors = spread * np.sqrt([offset + (1.0 / n if n else 0.0), slope])
    return found[:2], np.asarray(errors), freedom


def _cycle(stretches: Sequence[Stretch]) -> float:
    """Return the mean cycle of the slowest input that moves, in samples."""
    slowest = 1.0
    for one in stretches:
        for column in one.inputs.T:
            if len(column) < 2 or np.ptp(column) == 0:
                continue
            try:
                turns = len(reversals(column)) - 1
            except DataError:
                continue
            slowest = max(slowest, 2.0 * len(column) / max(turns, 1))
    return slowest


def _slow(time: Array) -> Array:
    """Return a polynomial that follows what is slow in training, shape (windows, terms)."""
    if not time.size:
        return np.empty((0, 0))
    terms = int(np.clip(time.size // APART, 1, SLOW))
    reach = max(float(np.abs(time - time.mean()).max()), 1.0)
    return np.asarray(np.polynomial.legendre.legvander((time - time.mean()) / reach, terms - 1))


def _scaled(columns: Array) -> Array:
    """Return columns divided by their sizes, those of none as they are."""
    size = np.abs(columns).max(axis=0, initial=0.0)
    return columns / np.where(size > 0, size, 1.0)


def _spread(
    left: Array, after: NDArray[np.bool_], n_test: int, rank: int, slow: int
) -> tuple[float, float]:
    """Return the deviation of a window that intervals are by, and the freedom behind it.

    The larger of that of all windows and of those of the test, where models do worse. Windows that
    are like the one before count as fewer; what slow terms take off the correlation that is seen is
    put back.
    """
    n = left.size
    freedom = max(n - rank, 1)
    of_test = max(n_test - 2, 1)
    pooled = float(left @ left) / freedom
    tested = float(left[-n_test:] @ left[-n_test:]) / of_test
    if tested > pooled:
        pooled, freedom = tested, of_test
    squares = float(left @ left)
    seen = float(left[1:] @ (left[:-1] * after[1:])) / squares if squares > 0 else 0.0
    alike = float(np.clip(seen + (slow + (slow + 2) * seen) / n, 0.0, MOST_ALIKE))
    fewer = (1.0 + alike) / (1.0 - alike)
    return float(np.sqrt(pooled * fewer)), max(freedom / fewer, 1.0)
