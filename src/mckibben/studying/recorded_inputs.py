"""The inputs of recordings: their ranges, their combinations and their rates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.coupled.balance import balance_in
from mckibben.blocks.laws import wander
from mckibben.control.identified import BEYOND, known_ranges
from mckibben.recording import Recording

FAST = 0.99
"""Quantile of the changes between samples that counts as the fastest."""

STRIDES = (4, 1000)
"""Fewest and most samples from one turning point of a random motion to the next."""

SAMPLES, STEP = 100, 0.02
"""Of the motion of a model whose recordings are not at hand: samples, and the time between them [s]."""

EVEN = 3.0**0.5
"""Reach of an even distribution, in standard deviations."""

CYCLES = 3
"""Of inputs from end to end, after which outputs repeat."""

TURNS = 24
"""Turning points of a random motion."""


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
    samples : int
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
    samples: int
    sample_time: float | None

    @classmethod
    def of(cls, recordings: Sequence[Recording], names: Sequence[str]) -> Self:
        """Return the inputs of recordings."""
        tables = [recording.with_derived(names).matrix(names) for recording in recordings]
        every = np.concatenate(tables)
        low, high = every.min(axis=0), every.max(axis=0)
        scale = np.where(high > low, high - low, 1.0)
        middle = (low + high) / 2
        shares = (every - middle) / scale
        few = len(shares) < len(names)  # whose directions lack some
        directions = np.linalg.svd(shares - shares.mean(axis=0), full_matrices=few)[2].T
        along = shares @ directions
        steps = np.concatenate([np.abs(np.diff(table, axis=0)) / scale for table in tables]).max(
            axis=1
        )
        moving = steps[steps > 0]
        fastest = float(np.quantile(moving, FAST)) if moving.size else 1.0
        units = {name: recordings[0].with_derived(names).units[name] for name in names}
        return cls(
            tuple(names),
            units,
            middle,
            scale,
            directions,
            np.array([along.min(axis=0), along.max(axis=0)]),
            np.array([low, high]),
            int(np.clip(1.0 / fastest, *STRIDES)),
            recordings[0].sample_time,
        )

    @classmethod
    def known(cls, block: Block) -> Self | None:
        """Return the inputs that a model was identified for; None if it says none.

        They are in any combination, but along the drive of a balance that has one. Inputs whose range
        is not known are 0. The fastest motion runs through the range in 100 samples of 20 ms.
        """
        ranges = known_ranges(block)
        if not any(channel.name in ranges for channel in block.inputs):
            return None
        low, high = np.array([ranges.get(channel.name, (0.0, 0.0)) for channel in block.inputs]).T
        names = [channel.name for channel in block.inputs]
        units = {channel.name: channel.unit for channel in block.inputs}
        rise = np.linspace(low, high, SAMPLES + 1)
        box = cls.of([Recording(dict(zip(names, rise.T, strict=True)), STEP, units)], names)
        directions, extent = np.eye(len(names)), (box.ends - box.middle) / box.scale
        placed = balance_in(block)
        if placed is not None and placed.solved and placed.balance.drive:
            drive, n = np.array(placed.balance.drive), len(placed.balance.given)
            middle = (drive[:, 0] - box.middle[:n]) / box.scale[:n]
            ways = drive[:, 1:] / box.scale[:n, np.newaxis]
            own = np.linalg.qr(ways, mode="complete").Q
            reach = EVEN * np.sqrt(((own.T @ ways) ** 2).sum(axis=1))
            directions[:n, :n] = own
            extent[:, :n] = middle @ own + [-reach, reach]
        return replace(box, directions=directions, extent=extent)

    def motion(self, slowness: float, seed: int) -> Recording:
        """Return a random motion, so many times slower than the fastest recorded."""
        pace = int(np.clip(self.samples * slowness, *STRIDES))
        low, high = self.extent
        along = wander(low, high, np.random.default_rng(seed), pace, TURNS)
        inputs = self.middle + self.scale * (along @ self.directions.T)
        inputs = np.clip(inputs, *self.ends)
        return Recording(dict(zip(self.names, inputs.T, strict=True)), self.sample_time, self.units)

    def reached(
        self, block: Block, held: Mapping[str, float], seconds: float
    ) -> dict[str, tuple[float, float]]:
        """Return the lowest and highest of a model's outputs that these inputs reach again and again.

        They go from end to end along each direction, in cycles; what the first cycles leave behind, and
        what creeps, has come by the last one.

        Parameters
        ----------
        block : Block
        held : mapping of str to float
            All other inputs of the model, which stay.
        seconds : float
            Duration of a cycle [s].
        """
        step = block.sample_time or seconds / (2 * SAMPLES)
        n = max(round(seconds / step), 4)
        share = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(CYCLES * n + 1) / n)
        others = {name: np.full(share.size, value) for name, value in held.items()}
        units = {channel.name: channel.unit for channel in block.inputs}
        low, high = self.extent
        ends = []
        for place, direction in enumerate(self.directions.T):
            along = low[place] + share * (high[place] - low[place])
            inputs = np.clip(self.middle + self.scale * np.outer(along, direction), *self.ends)
            run = Recording({**dict(zip(self.names, inputs.T, strict=True)), **others}, step, units)
            given = block.simulate(run).matrix([channel.name for channel in block.outputs])[-n:]
            ends += [given.min(axis=0), given.max(axis=0)]
        found = zip(np.min(ends, axis=0).tolist(), np.max(ends, axis=0).tolist(), strict=True)
        return dict(zip([channel.name for channel in block.outputs], found, strict=True))

    def outside(self, inputs: Array) -> float:
        """Return the share of some inputs, shape (k, n), that are not as the recorded ones."""
        along = (inputs - self.middle) / self.scale @ self.directions
        low, high = self.extent
        margin = BEYOND * (high - low).max()
        return float(((along < low - margin) | (along > high + margin)).any(axis=1).mean())
