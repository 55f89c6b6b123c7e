"""Coupling: effect of every input on every output, and the main input of each output."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array
from mckibben.channels import Channels, any_moves, moved_by
from mckibben.numerics.statistics import dependence
from mckibben.recording import Recording
from mckibben.signals.lags import lag

SEPARABLE_R2 = 0.9
"""R² of an input's regression on the others above which their effects are not separable."""

LEAST_EXPLAINED = 0.1
"""Share of an output's variance below which its inputs explain hardly any of it."""


@dataclass(frozen=True, eq=False)
class Coupling:
    """Effect of every input on every output, by linear regression.

    Parameters
    ----------
    inputs, outputs : tuple of str
        Channels.
    effects : array, shape (outputs, inputs)
        Change of an output over an input's whole measured range, in the output's unit; NaN where
        inputs are collinear.
    units : tuple of str
        Of the outputs.
    explained : tuple of float
        Share of each output's variance that linear regression explains.
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    effects: Array
    units: tuple[str, ...]
    explained: tuple[float, ...]

    def own(self, output: str, recordings: Sequence[Recording] = ()) -> str:
        """Return the main input of an output: its pair, or the one of largest effect.

        Where recordings are given, it is one that moves in them, if any does.
        """
        place = self.outputs.index(output)
        moving = [k for k, name in enumerate(self.inputs) if any_moves(recordings, (name,))]
        moving = moving or list(range(len(self.inputs)))
        pair = self.inputs.index(Channels(self.inputs, self.outputs).pairs[place][0])
        effects = np.abs(self.effects[place, moving])
        if pair in moving and (self.paired or not np.isfinite(effects).all()):
            return self.inputs[pair]
        return self.inputs[moving[int(np.argmax(np.nan_to_num(effects)))]]

    def pairs(self, recordings: Sequence[Recording]) -> tuple[tuple[str, str], ...]:
        """Return the abscissa of every output in figures, and the output.

        That is the input that is its own; where all are held, what else drives and moves.
        """
        return tuple(
            (moved_by(recordings, self.own(output, recordings)), output) for output in self.outputs
        )

    @property
    def paired(self) -> bool:
        """Whether there are as many inputs as outputs."""
        return len(self.inputs) == len(self.outputs)


def coupling(
    recordings: Sequence[Recording], inputs: Sequence[str], outputs: Sequence[str]
) -> Coupling:
    """Return the effects of inputs on outputs over all recordings, with separate offsets.

    Parameters
    ----------
    recordings : sequence of Recording
        At least one.
    inputs, outputs : sequence of str
        Channels that all of them have.
    """
    u = np.concatenate([r.matrix(inputs) - r.matrix(inputs).mean(axis=0) for r in recordings])
    y = np.concatenate([r.matrix(outputs) - r.matrix(outputs).mean(axis=0) for r in recordings])
    size = np.linalg.norm(u, axis=0)
    scaled = u / np.where(size > 0, size, 1.0)
    gains = np.linalg.lstsq(scaled, y, rcond=1e-6)[0]
    highest = np.max([r.matrix(inputs).max(axis=0) for r in recordings], axis=0)
    ranges = highest - np.min([r.matrix(inputs).min(axis=0) for r in recordings], axis=0)
    effects = (gains / np.where(size > 0, size, 1.0)[:, np.newaxis] * ranges[:, np.newaxis]).T
    if (dependence(u) > SEPARABLE_R2).any():
        effects = np.full_like(effects, np.nan)
    total = np.sum(y**2, axis=0)
    unexplained_sum = np.sum((y - scaled @ gains) ** 2, axis=0)
    explained = 1 - unexplained_sum / np.where(total > 0, total, 1.0)
    units = tuple(recordings[0].units[name] for name in outputs)
    return Coupling(tuple(inputs), tuple(outputs), effects, units, tuple(explained.tolist()))


def unexplained(recordings: Sequence[Recording], effects: Coupling) -> list[str]:
    """Return the outputs of which inputs explain less than `LEAST_EXPLAINED` of the variance.

    That is the larger of the share of linear regression on all inputs, and of one input at any lag.
    """

    def correlated(run: Recording, name: str, output: str) -> float:
        if min(np.ptp(run[name]), np.ptp(run[output])) <= 0:
            return 0.0
        return lag(run[name], run[output]).correlation ** 2

    return [
        output
        for output, share in zip(effects.outputs, effects.explained, strict=True)
        if share < LEAST_EXPLAINED
        and all(
            correlated(r, name, output) < LEAST_EXPLAINED
            for r in recordings
            for name in effects.inputs
        )
    ]
