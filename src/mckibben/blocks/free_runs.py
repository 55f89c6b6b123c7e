"""Free runs of a block over recordings, and of the same block with other parameters."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array, Mask
from mckibben.blocks.base import Block
from mckibben.blocks.derivatives import by_moving, derivatives, relative_sizes
from mckibben.blocks.fields import check_units
from mckibben.blocks.runs import FreeRun, Run
from mckibben.errors import ModelError
from mckibben.recording import Recording

AT_ONCE = 2_000_000
"""Numbers of derivatives that are held in memory at once."""

DIVERGED = 1e3
"""Error, in ranges of the measured output, above which a model has diverged."""

Kind = TypeVar("Kind", np.float64, np.bool_)

Changed = Callable[[Block, int], Block]
"""Returns a block as it runs over a recording, by the recording's index: some parameters shifted."""


def as_it_is(block: Block, index: int) -> Block:
    """Return the block itself, for every recording."""
    del index
    return block


def free_run(block: Block, recording: Recording) -> FreeRun:
    """Return a block's free run over a recording with its outputs.

    It begins by the rule of `mckibben.blocks.starts`. After that nothing measured but the inputs is
    used.

    Raises
    ------
    DataError
        Where the recording lacks a channel.
    ModelError
        If the outputs are not finite, or diverge from the measured ones.
    """
    (run,) = FreeRuns.of(block, [recording]).runs
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore", RuntimeWarning)
        modelled = block.simulate(recording).matrix(channel.name for channel in block.outputs)
    span = np.ptp(run.outputs, axis=0)
    if not (np.abs(modelled - run.outputs) <= DIVERGED * span).all():
        far, wide = float(np.abs(modelled).max()), float(span.max())
        raise ModelError(
            f"the output of {block.kind!r} runs away on {recording.name}: to {far:.4g}, "
            f"where what is measured spans {wide:.4g}",
            remedy="see whether units are those that it was identified in; if so, this "
            "model does not suit these data: identify it again",
        )
    return FreeRun.of(run, modelled)


@dataclass(frozen=True, eq=False)
class FreeRuns:
    """Runs of a block over recordings, at the samples that count.

    Blocks with other parameters begin after the same past as the block itself, so that outputs differ by
    the parameters alone.

    Parameters
    ----------
    block : Block
    runs : sequence of Run
        Of the block's channels; a run without a start begins at rest.
    changed : callable, optional
        What runs over a recording instead of a block: the block under a load of the recording's own.
    """

    block: Block
    runs: Sequence[Run]
    changed: Changed = as_it_is

    @classmethod
    def of(
        cls, block: Block, recordings: Sequence[Recording], rows: Sequence[Mask] | None = None
    ) -> FreeRuns:
        """Return the runs over recordings with all channels of the block.

        ``rows`` are the samples of each that count, shape (n,); those bridged in reading never do.
        """
        masks = [None] * len(recordings) if rows is None else rows
        pairs = enumerate(zip(recordings, masks, strict=True))
        runs = [block.as_run(recording, mask, index) for index, (recording, mask) in pairs]
        for run in runs:
            check_units(run.source, block.outputs)
        return cls(block, runs)

    @cached_property
    def pasts(self) -> list[Array]:
        """Inputs before the first sample of every run, shape (k, inputs) each."""
        return [self.changed(self.block, run.index).past(run) for run in self.runs]

    @cached_property
    def from_rest(self) -> FreeRuns:
        """The same runs, begun at rest at their first inputs."""
        return replace(self, runs=[replace(run, from_outputs=False) for run in self.runs])

    @property
    def names(self) -> list[str]:
        """Names of the outputs."""
        return [channel.name for channel in self.block.outputs]

    @property
    def rows(self) -> list[Mask]:
        """Samples of every run that count."""
        return [run.counts for run in self.runs]

    @cached_property
    def modelled(self) -> list[Array]:
        """Outputs of the block over every run, shape (n, m) each."""
        return self.simulated(self.block)

    @cached_property
    def residual(self) -> Array:
        """Measured less modelled outputs that count, sample by sample, shape (N,)."""
        return self.scored([run.outputs for run in self.runs]) - self.scored(self.modelled)

    @property
    def errors(self) -> tuple[float, ...]:
        """Root mean square error of every output; infinite of a model that overflows."""
        by_output = self.residual.reshape(-1, len(self.names)).T
        if not np.isfinite(by_output).all():
            return (np.inf,) * len(by_output)
        return tuple(float(np.sqrt(np.mean(errors**2))) for errors in by_output)

    @property
    def rmse(self) -> float:
        """Root mean square of the residual."""
        with np.errstate(over="ignore", invalid="ignore"):
            return float(np.sqrt(np.mean(self.residual**2)))

    def apart(self, other: FreeRuns) -> float:
        """Return the root mean square by which outputs differ from those of other runs."""
        with np.errstate(over="ignore", invalid="ignore"):
            distance = self.scored(self.modelled) - self.scored(other.modelled)
            return float(np.sqrt(np.mean(distance**2)))

    def scored(self, outputs: Sequence[NDArray[Kind]]) -> NDArray[Kind]:
        """Return the outputs of all runs, (n, m) each, at the samples that count, (N,)."""
        pairs = zip(outputs, self.runs, strict=True)
        return np.concatenate([table[run.counts].ravel() for table, run in pairs])

    def simulated(self, block: Block) -> list[Array]:
        """Return the outputs of a block over every run, shape (n, m) each."""
        result = []
        for run, past in zip(self.runs, self.pasts, strict=True):
            changed_block = self.changed(block, run.index)
            if run.source.periodic:
                result.append(changed_block.simulate(run.source).matrix(self.names))
                continue
            state, outputs = changed_block.state_after(past, run), np.empty(run.outputs.shape)
            changed_block.bind(run.sample_time, state, run.inputs, outputs)()
            result.append(outputs)
        return result

    def slopes(self, places: Sequence[int], kept: Array | slice = slice(None)) -> Array:
        """Return derivatives of the outputs by parameters in units of their sizes, shape (n, k).

        At the outputs ``kept`` of the N that count; see `mckibben.blocks.derivatives`.
        """
        sizes, found = relative_sizes(self.block.pack()), []
        many = max(1, AT_ONCE // max(sum(map(len, self.runs)) * len(self.names), 1))
        for first in range(0, len(places), many):
            some = places[first : first + many]
            tables = [
                self._slopes_over(*pair, some) for pair in zip(self.runs, self.pasts, strict=True)
            ]
            pairs = zip(tables, self.rows, strict=True)
            scored = np.concatenate([table[rows].reshape(-1, len(some)) for table, rows in pairs])
            found.append(scored[kept] * sizes[some])
        return np.concatenate(found, axis=1)

    def _slopes_over(self, run: Run, past: Array, places: Sequence[int]) -> Array:
        """Return the derivatives of the outputs over a run, shape (n, m, k)."""
        block = self.changed(self.block, run.index)
        if run.source.periodic:
            source, names = run.source, self.names
            return by_moving(block, lambda other: other.simulate(source).matrix(names), places)

        def start(other: Block) -> Array:
            state = other.known_state(run)
            assert state is not None
            return state

        initial = start if block.known_state(run) is not None else None
        inputs = np.vstack([past, run.inputs])
        return derivatives(block, inputs, run.sample_time, initial, places)[len(past) :]
