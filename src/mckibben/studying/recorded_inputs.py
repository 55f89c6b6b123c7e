"""The inputs of recordings: their ranges, their combinations and their rates, and runs outside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.coupled.balance import balance_in, drive_of
from mckibben.blocks.laws import wander
from mckibben.blocks.ranges import known_ranges
from mckibben.numerals import numeral
from mckibben.recording import Recording

FAST = 0.99
"""Quantile of the changes between samples that counts as the fastest."""

SAMPLES_PER_TURN_LIMITS = (4, 1000)
"""Fewest and most samples from one turning point of a random motion to the next."""

SAMPLES_PER_RANGE, SAMPLE_TIME = 100, 0.02
"""Of the test motion of a model whose recordings are not at hand: samples in which it goes through the
range, and the time between them [s].
"""

UNIFORM_REACH = 3.0**0.5
"""How far a uniform distribution reaches from its mean, in standard deviations."""

CYCLES = 3
"""Of inputs from end to end, after which outputs repeat."""

TURNS = 24
"""Turning points of a random motion."""

MARGIN = 0.05
"""Share of a range beyond which a value counts as outside; noise is smaller."""


@dataclass(frozen=True, eq=False)
class RecordedInputs:
    """A box of inputs along the directions in which recordings move.

    Two muscles that were driven in opposition fill a line, not a square.

    Parameters
    ----------
    names : tuple of str
    units : mapping of str to str
    middle : array, shape (n,)
    scale : array, shape (n,)
        Range of every input; 1 of a constant.
    directions : array, shape (n, n)
        Orthonormal, one a column, of inputs less ``middle`` over ``scale``.
    extent : array, shape (2, n)
        Lowest and highest along the directions.
    ends : array, shape (2, n)
        Lowest and highest of every input.
    samples_per_range : int
        In which the fastest motion runs through the range.
    sample_time : float or None
        [s]
    """

    names: tuple[str, ...]
    units: Mapping[str, str]
    middle: Array
    scale: Array
    directions: Array
    extent: Array
    ends: Array
    samples_per_range: int
    sample_time: float | None

    @classmethod
    def of(cls, recordings: Sequence[Recording], names: Sequence[str]) -> Self:
        """Return the inputs of recordings."""
        derived = [recording.with_derived(names) for recording in recordings]
        tables = [recording.matrix(names) for recording in derived]
        samples = np.concatenate(tables)
        low, high = samples.min(axis=0), samples.max(axis=0)
        scale = np.where(high > low, high - low, 1.0)
        middle = (low + high) / 2

        shares = (samples - middle) / scale
        directions = _principal_directions(shares)
        along = shares @ directions

        steps = np.concatenate([np.abs(np.diff(table, axis=0)) / scale for table in tables])
        largest_steps = steps.max(axis=1)
        moving = largest_steps[largest_steps > 0]
        fastest = float(np.quantile(moving, FAST)) if moving.size else 1.0
        return cls(
            tuple(names),
            {name: derived[0].units[name] for name in names},
            middle,
            scale,
            directions,
            np.array([along.min(axis=0), along.max(axis=0)]),
            np.array([low, high]),
            int(np.clip(1.0 / fastest, *SAMPLES_PER_TURN_LIMITS)),
            recordings[0].sample_time,
        )

    @classmethod
    def known(cls, block: Block, sample_time: float | None = None) -> Self | None:
        """Return the inputs that a model was identified for; None if it says none.

        They are in any combination, but along the drive of a balance that has one. Inputs whose range
        is not known are 0. The fastest motion runs through the range in 100 samples; they are 20 ms
        apart unless the model has a sample time of its own, or one is given [s].
        """
        ranges = known_ranges(block.inputs, block.known_inputs)
        if not any(channel.name in ranges for channel in block.inputs):
            return None
        names = tuple(channel.name for channel in block.inputs)
        units = {channel.name: channel.unit for channel in block.inputs}
        ends = np.array([ranges.get(name, (0.0, 0.0)) for name in names]).T
        step = sample_time or block.sample_time or SAMPLE_TIME
        middle, scale = ends.mean(axis=0), np.where(ends[1] > ends[0], ends[1] - ends[0], 1.0)
        directions, extent = np.eye(len(names)), (ends - middle) / scale
        if (drive := drive_of(block)) is not None:
            n = len(drive[0])
            directions[:n, :n], extent[:, :n] = _along_balance_drive(*drive, middle[:n], scale[:n])
        return cls(names, units, middle, scale, directions, extent, ends, SAMPLES_PER_RANGE, step)

    def motion(self, slowness: float, seed: int) -> Recording:
        """Return a random motion, so many times slower than the fastest recorded."""
        pace = int(np.clip(self.samples_per_range * slowness, *SAMPLES_PER_TURN_LIMITS))
        low, high = self.extent
        inputs = self._inputs(wander(low, high, np.random.default_rng(seed), pace, TURNS))
        return Recording(dict(zip(self.names, inputs.T, strict=True)), self.sample_time, self.units)

    def _inputs(self, along: Array) -> Array:
        """Return the inputs, within their ends, at values along the directions, both (k, n)."""
        return np.clip(self.middle + self.scale * (along @ self.directions.T), *self.ends)

    def reached(
        self, block: Block, held: Mapping[str, float], seconds: float
    ) -> dict[str, tuple[float, float]]:
        """Return the lowest and highest of a model's outputs that these inputs reach again and again.

        They go from end to end along each direction, in cycles of a duration [s], while all other inputs
        are held; what the first cycles leave behind, and what creeps, has come by the last one.
        """
        step = block.sample_time or seconds / (2 * SAMPLES_PER_RANGE)
        n = max(round(seconds / step), 4)
        share = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(CYCLES * n + 1) / n)
        other_channels = {name: np.full(share.size, value) for name, value in held.items()}
        units = {channel.name: channel.unit for channel in block.inputs}
        names = [channel.name for channel in block.outputs]
        ends = []
        for direction, low, high in zip(np.eye(len(self.names)), *self.extent, strict=True):
            inputs = self._inputs(np.outer(low + share * (high - low), direction))
            run = Recording(
                dict(zip(self.names, inputs.T, strict=True)) | other_channels, step, units
            )
            outputs = block.simulate(run).matrix(names)[-n:]
            ends += [outputs.min(axis=0), outputs.max(axis=0)]
        ranges = zip(np.min(ends, axis=0).tolist(), np.max(ends, axis=0).tolist(), strict=True)
        return dict(zip(names, ranges, strict=True))

    def outside(self, inputs: Array) -> float:
        """Return the share of some inputs, shape (k, n), that are not as the recorded ones."""
        along = (inputs - self.middle) / self.scale @ self.directions
        low, high = self.extent
        margin = MARGIN * (high - low).max()
        return float(((along < low - margin) | (along > high + margin)).any(axis=1).mean())


def _principal_directions(shares: Array) -> Array:
    """Return the principal directions of samples, shape (k, n), one a column, shape (n, n)."""
    fewer_samples_than_inputs = len(shares) < shares.shape[1]  # their directions lack some
    centred = shares - shares.mean(axis=0)
    return np.asarray(np.linalg.svd(centred, full_matrices=fewer_samples_than_inputs)[2].T)


def _along_balance_drive(
    centre: Array, deviations: Array, middle: Array, scale: Array
) -> tuple[Array, Array]:
    """Return the directions in which a balance was driven, and the lowest and highest along them.

    Shapes (n, n) and (2, n). ``centre`` (n,) and ``deviations`` (n, d) are those of `drive_of`; inputs
    are relative to ``middle`` and ``scale``. An orthonormal basis begins with the driven directions; a
    uniform distribution with these deviations reaches √3 standard deviations from its mean.
    """
    scaled = deviations / scale[:, np.newaxis]
    directions = np.linalg.qr(scaled, mode="complete").Q
    reach = UNIFORM_REACH * np.sqrt(((directions.T @ scaled) ** 2).sum(axis=1))
    return directions, (centre - middle) / scale @ directions + [-reach, reach]


def beyond_known(model: Block, recording: Recording) -> list[str]:
    """Return warnings about parts of a recording outside the identified range.

    Inverses without a balance count the samples that they clip instead.
    """
    if model.inverts and balance_in(model) is None:
        return []
    ranges, notes = known_ranges(model.inputs, model.known_inputs), []
    for channel in model.inputs:
        if channel.name not in ranges or channel.name not in recording:
            continue
        values, (low, high) = recording[channel.name], ranges[channel.name]
        reach = MARGIN * (high - low)
        if values.min() < low - reach or values.max() > high + reach:
            ends = " to ".join(numeral(float(end), 3) for end in (values.min(), values.max()))
            notes.append(
                f"in {recording.name}, {channel.name} goes from {ends} {channel.unit}, and the model "
                f"was identified from {numeral(low, 3)} to {numeral(high, 3)}: it extrapolates"
            )
    return notes
