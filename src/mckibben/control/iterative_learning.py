"""Iterative learning control: a motion that repeats is followed better in every repetition.

The reference of a compensator is corrected by the errors of the repetition before, sample by sample:

    c_{k+1}(t) = c_k(t) + g_k(t) Q[y_d - y_k](t + d).

A compensator and its plant in series are nearly 1 already, so no other model of the plant is needed
(Bristow, Tharayil and Alleyne, "A survey of iterative learning control", IEEE Control Systems Magazine
26(3), 2006). All else is taken from the measured repetitions:

- d is the delay by which the first repetition follows.
- Q is a Gaussian low-pass without delay. With T the transfer function from corrections to outputs,
  errors of a linear plant contract by |1 - Q T| <= 1 - Q + Q |1 - T|, which is below 1 where |1 - T| is.
  The first repetition has followed the motion itself, so there |1 - T| is the amplitude of its error
  over that of the motion. Q is 1/2 where that first reaches 1. When a repetition is worse than the one
  before, the cut-off is halved.
- g begins at 1. Friction and hysteresis answer corrections of different size differently; so where an
  error has changed its sign, g is halved, and elsewhere it grows by a fifth, up to 1 (the constants of
  Riedmiller and Braun, "A direct adaptive method for faster backpropagation learning: the RPROP
  algorithm", 1993).

The repetition with the least error is kept.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.compose import Series
from mckibben.blocks.fields import Channel, vector
from mckibben.blocks.repetition import Repetition
from mckibben.control.connecting import find
from mckibben.errors import DataError, require
from mckibben.recording import REFERENCE, Recording, sample_time_of
from mckibben.system.showing import Result

SEGMENTS = 8
"""Half-overlapping parts of the motion over which its spectrum is averaged."""

GAIN_DECREASE, GAIN_INCREASE = 0.5, 1.2
"""Factors of the gain where an error has changed its sign, and where it has not."""

FILTER_WIDENING = 2.0
"""Factor of the width of the filter after a repetition that is worse than the one before."""

MOST_REPETITIONS = 1000
"""Largest number of repetitions."""


@dataclass(frozen=True, repr=False)
class Learned(Result):
    """What repetitions of a motion have taught.

    Parameters
    ----------
    best, next : Block
        Compensators with the corrections of the best repetition, and with those to try next.
    best_repetition : int
        0 is that without corrections.
    rmse : mapping of str to tuple of float
        Error of every repetition by output, in its unit, with the noise of the sensor.
    cutoff : mapping of str to float
        Frequency up to which errors of the first repetition are corrected [Hz].
    expected : mapping of str to float
        Factor by which errors below the cut-off shrink in one repetition of a linear plant: |1 - T|,
        averaged over the error.
    convergence : mapping of str to float
        Factor by which they did shrink from repetition to repetition, down to the best one.
    runs : tuple of Recording
    """

    best: Block = field(repr=False)
    next: Block = field(repr=False)
    best_repetition: int
    rmse: Mapping[str, tuple[float, ...]]
    cutoff: Mapping[str, float]
    expected: Mapping[str, float]
    convergence: Mapping[str, float]
    runs: tuple[Recording, ...] = field(repr=False)

    face: ClassVar[str] = "learned"

    @property
    def model(self) -> Block:
        """The compensator of the best repetition."""
        return self.best

    @property
    def drawn(self) -> tuple[Recording, ...]:
        """What a plot of it draws."""
        return self.runs


def learn(
    compensator: Block,
    run: Callable[[Block], Recording],
    repetitions: int = 10,
    *,
    ahead: int = 0,
    settle: int = 0,
    repeats: bool = False,
) -> Learned:
    """Repeat a motion, and correct the reference of its compensator by the errors.

    Parameters
    ----------
    compensator : Block
        From desired outputs, and what schedules it, to inputs of a plant.
    run : callable
        Runs the motion once with the compensator given, started at the first sample, and returns the
        recording; see `learned`.
    repetitions : int
        After the first run; at least 1.
    ahead, settle, repeats
        As for `learned`.

    Raises
    ------
    DataError, ModelError
        As `learned`, and on repetitions out of range.
    """
    require(
        1 <= repetitions <= MOST_REPETITIONS, "repetitions", repetitions, f"1 to {MOST_REPETITIONS}"
    )
    runs = [run(compensator)]
    for _ in range(repetitions):
        learning = learned(compensator, runs, ahead=ahead, settle=settle, repeats=repeats)
        runs.append(run(learning.next))
    return learned(compensator, runs, ahead=ahead, settle=settle, repeats=repeats)


def learned(
    compensator: Block,
    runs: Sequence[Recording],
    *,
    ahead: int = 0,
    settle: int = 0,
    repeats: bool = False,
) -> Learned:
    """Return the corrections of a compensator after recorded repetitions of one motion.

    Parameters
    ----------
    compensator : Block
        Without corrections.
    runs : sequence of Recording
        All repetitions in order, each with the measured outputs and, as ``reference_...``, the desired
        ones due at the same samples. The first is that of ``compensator``, every other that of `next`
        as found from those before it.
    ahead : int
        How many samples before it is due the compensator is given the reference; 1 in a loop of
        `track`, or the preview, if that is longer.
    settle : int
        Samples at the beginning that are not scored.
    repeats : bool
        Whether each repetition follows the one before without a pause, in a state left by it. If not,
        the controller is started anew with every repetition.

    Raises
    ------
    DataError
        Without runs or time, without channels of the compensator, or of different motions.
    """
    if not runs:
        raise DataError("there is no repetition", remedy="give the recording of at least one")
    step = sample_time_of(runs[0], "be a repetition")
    length = len(runs[0])
    require(0 <= ahead < length, "ahead", ahead, f"0 to {length - 1} samples")
    require(0 <= settle < length, "settle", settle, f"0 to {length - 1} samples")
    channels = compensator.inputs[: compensator.n_driven]
    lessons = _lessons(compensator, runs, settle, repeats)
    errors = np.array([lesson.errors for lesson in lessons])
    floor = np.maximum(errors[:, :1], np.finfo(float).tiny)
    best = int(np.argmin(np.mean((errors / floor) ** 2, axis=0)))

    def corrected(number: int) -> Block:
        """Return the compensator of a repetition."""
        if number == 0:
            return compensator
        rows = tuple(
            vector(_advanced(lesson.corrections[number], ahead, repeats)) for lesson in lessons
        )
        return Series((Repetition(rows, step, channels, channels, repeats), compensator))

    names = [channel.name for channel in channels]
    shrunk = (errors[:, best] / floor[:, 0]) ** (1.0 / max(best, 1))
    return Learned(
        corrected(best),
        corrected(len(runs)),
        best,
        dict(zip(names, map(tuple, errors.tolist()), strict=True)),
        {name: lesson.cutoff / step for name, lesson in zip(names, lessons, strict=True)},
        {name: lesson.expected for name, lesson in zip(names, lessons, strict=True)},
        dict(zip(names, shrunk.tolist(), strict=True)),
        tuple(runs),
    )


def _lessons(
    compensator: Block, runs: Sequence[Recording], settle: int, repeats: bool
) -> list[_Lesson]:
    """Return what is learned of every output; parameters and errors as of `learned`."""
    desired, measured = (_outputs(compensator, runs, prefix) for prefix in (REFERENCE, ""))
    if not np.array_equal(desired, np.broadcast_to(desired[0], desired.shape)):
        raise DataError("repetitions have different references", remedy="repeat one motion")
    return [
        _Lesson.of(desired[0, :, k], measured[:, :, k], bounds, settle, repeats)
        for k, bounds in enumerate(compensator.input_bounds[: compensator.n_driven])
    ]


def _outputs(compensator: Block, runs: Sequence[Recording], prefix: str) -> Array:
    """Return the compensator's references or their measurements, (n_runs, n, n_outputs)."""
    tables = []
    for run in runs:
        offered = [
            Channel(name.removeprefix(prefix), unit)
            for name, unit in run.units.items()
            if name.startswith(prefix)
        ]
        columns = []
        for channel in compensator.inputs[: compensator.n_driven]:
            place, gain, offset = find(
                channel, offered, run.rest_length, compensator.title, run.name
            )
            columns.append(gain * run[f"{prefix}{offered[place].name}"] + offset)
        tables.append(np.column_stack(columns))
    if len({(len(table), run.sample_time) for table, run in zip(tables, runs, strict=True)}) > 1:
        raise DataError(
            "repetitions have different lengths or sample times",
            remedy="begin and end every recording with the motion",
        )
    return np.array(tables)


@dataclass(frozen=True)
class _Lesson:
    """Learning of one output: its corrections, (n_runs + 1, n), and what the docstring above names."""

    corrections: Array
    errors: Array
    cutoff: float
    expected: float

    @classmethod
    def of(
        cls,
        desired: Array,
        measured: Array,
        bounds: Array,
        settle: int,
        repeats: bool,
    ) -> _Lesson:
        """Return it, from the desired output, (n,), and the measured ones, (n_runs, n).

        What the compensator is asked for stays within the ``bounds`` beyond which it takes it for a
        fault.
        """
        lowest, highest = bounds
        low, high = np.minimum(lowest - desired, 0.0), np.maximum(highest - desired, 0.0)
        delay = _delay(desired, measured[0])
        cutoff, expected = _cutoff(desired, _advanced(desired - measured[0], delay, repeats))
        # of a Gaussian that is 1/2 there
        width = math.sqrt(2 * math.log(2)) / (2 * math.pi * cutoff)
        errors = np.sqrt(np.mean((desired - measured)[:, settle:] ** 2, axis=1))
        corrections, gain = [np.zeros(len(desired))], np.ones(len(desired))
        last_error: Array | None = None
        for k, output in enumerate(measured):
            if k and errors[k] >= errors[k - 1]:
                width *= FILTER_WIDENING
            error = _smooth(_advanced(desired - output, delay, repeats), width, repeats)
            if last_error is not None:
                gain = np.where(
                    error * last_error < 0,
                    GAIN_DECREASE * gain,
                    np.minimum(GAIN_INCREASE * gain, 1.0),
                )
            last_error = error
            correction = corrections[-1] + _smooth(gain, width, repeats) * error
            corrections.append(np.clip(correction, low, high))
        return cls(np.array(corrections), errors, cutoff, expected)


def _delay(desired: Array, output: Array) -> int:
    """Return by how many samples an output follows, not negative: the first least difference."""

    def difference(delay: int) -> float:
        return float(np.mean((output[delay:] - desired[: len(desired) - delay]) ** 2))

    delay, least = 0, difference(0)
    while delay + 2 < len(desired) and (next_difference := difference(delay + 1)) < least:
        delay, least = delay + 1, next_difference
    return delay


def _cutoff(desired: Array, error: Array) -> tuple[float, float]:
    """Return the frequency up to which an error is below its motion, and their mean ratio there.

    The frequency is relative to the sampling rate; the ratio is weighted by the error.
    """
    from scipy.signal import detrend, welch

    def spectrum(samples: Array) -> Array:
        power: Array = welch(samples, nperseg=length, detrend=detrend)[1]
        return power

    length = max(len(desired) // SEGMENTS, 2)
    motion, missed = spectrum(desired), spectrum(error)
    frequencies = np.fft.rfftfreq(length)
    beyond = np.flatnonzero(missed[1:] >= motion[1:])
    end = 1 + int(beyond[0]) if beyond.size else len(frequencies) - 1
    missed, motion = missed[:end], motion[:end]
    ratio = np.divide(missed, motion, out=np.ones(end), where=missed < motion)
    total = float(missed.sum())
    expected = math.sqrt(float(ratio @ missed) / total) if total > 0 else 0.0
    return float(frequencies[end]), expected


def _advanced(samples: Array, samples_ahead: int, repeats: bool) -> Array:
    """Return samples moved forward in time; the end is held, or is the beginning."""
    places = np.arange(len(samples)) + samples_ahead
    return samples[places % len(samples) if repeats else np.minimum(places, len(samples) - 1)]


def _smooth(samples: Array, width: float, repeats: bool) -> Array:
    """Return samples behind a Gaussian low-pass without delay, of a width in samples."""
    from scipy.ndimage import gaussian_filter1d

    smooth: Array = gaussian_filter1d(samples, width, mode="wrap" if repeats else "nearest")
    return smooth
