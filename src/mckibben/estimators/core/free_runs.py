"""Free runs of a fitted block, and of the same block with other parameters, over its recordings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mckibben.arrays import Array, Mask
from mckibben.blocks.base import Block
from mckibben.blocks.derivatives import DIFFERENCE, derivatives, differences, relative_sizes
from mckibben.blocks.free_run import run_free
from mckibben.blocks.running import run_many
from mckibben.blocks.starts import history, known_state
from mckibben.metrics import rmse
from mckibben.recording import Recording

AT_ONCE = 2_000_000
"""Numbers of derivatives that are held in memory at once."""

Changed = Callable[[Block, int], Block]
"""Returns a block as it runs over a recording, by the recording's index: some parameters shifted."""


def as_it_is(block: Block, place: int) -> Block:
    """Return the block itself, for every recording."""
    del place
    return block


@dataclass(frozen=True, eq=False)
class FreeRuns:
    """Runs of a block over recordings, at the samples that count.

    Blocks with other parameters begin after the same past as the block itself, so that outputs differ by
    the parameters alone.

    Parameters
    ----------
    block : Block
    recordings : sequence of Recording
        With all channels of the block.
    rows : sequence of array of bool, shape (n,)
        Samples of every recording that count. Outputs elsewhere are never looked at: a recording whose
        first sample does not count begins at rest.
    changed : callable, optional
        What runs over a recording instead of a block: the block under a load of the recording's own.
    at_rest : bool
        Whether all runs begin at rest at their first inputs, whatever was measured.
    """

    block: Block
    recordings: Sequence[Recording]
    rows: Sequence[Mask]
    changed: Changed = as_it_is
    at_rest: bool = False

    @cached_property
    def known(self) -> list[Recording]:
        """The recordings with the outputs that runs may begin from, or without."""
        inputs = [channel.name for channel in self.block.inputs]
        pairs = zip(self.recordings, self.rows, strict=True)
        return [
            r.select(inputs) if self.at_rest or not rows[0] or r.periodic else r
            for r, rows in pairs
        ]

    @cached_property
    def pasts(self) -> list[Array]:
        """Inputs before the first sample of every recording, shape (k, inputs) each."""
        return [
            history(self.changed(self.block, place), known)
            for place, known in enumerate(self.known)
        ]

    @cached_property
    def from_rest(self) -> FreeRuns:
        """The same runs, begun at rest at their first inputs."""
        return replace(self, at_rest=True)

    @property
    def names(self) -> list[str]:
        """Names of the outputs."""
        return [channel.name for channel in self.block.outputs]

    def preceded(self) -> tuple[list[Recording], list[Mask]]:
        """Return the recordings with their pasts before them, and the samples that count."""
        names, found, counted = [channel.name for channel in self.block.inputs], [], []
        for recording, past, rows in zip(self.recordings, self.pasts, self.rows, strict=True):
            columns = dict(zip(names, past.T, strict=True))
            channels = {
                name: np.concatenate([columns.get(name, np.full(len(past), samples[0])), samples])
                for name, samples in recording.channels.items()
            }
            step = 1.0 if recording.sample_time is None else recording.sample_time
            begun = recording.start_time - len(past) * step
            found.append(replace(recording, channels=channels, start_time=begun))
            counted.append(np.concatenate([np.zeros(len(past), dtype=bool), rows]))
        return found, counted

    @cached_property
    def modelled(self) -> list[Array]:
        """Outputs of the block over every recording, shape (n, m) each."""
        return self.simulated(self.block)

    @cached_property
    def residual(self) -> Array:
        """Measured less modelled outputs that count, sample by sample, shape (N,)."""
        measured = [recording.matrix(self.names) for recording in self.recordings]
        return self.scored(measured) - self.scored(self.modelled)

    @property
    def errors(self) -> tuple[float, ...]:
        """Root mean square error of every output; infinite of a model that overflows."""
        names = self.names
        measured = np.concatenate(
            [r.matrix(names)[rows] for r, rows in zip(self.recordings, self.rows, strict=True)]
        )
        modelled = np.concatenate(
            [table[rows] for table, rows in zip(self.modelled, self.rows, strict=True)]
        )
        if not np.isfinite(modelled).all():
            return (np.inf,) * len(names)
        return tuple(rmse(*pair) for pair in zip(measured.T, modelled.T, strict=True))

    @property
    def rmse(self) -> float:
        """Root mean square of the residual."""
        with np.errstate(over="ignore", invalid="ignore"):
            return float(np.sqrt(np.mean(self.residual**2)))

    def apart(self, other: FreeRuns) -> float:
        """Return the root mean square by which outputs differ from those of other runs."""
        with np.errstate(over="ignore", invalid="ignore"):
            differences = self.scored(self.modelled) - self.scored(other.modelled)
            return float(np.sqrt(np.mean(differences**2)))

    def scored(self, outputs: Sequence[Array]) -> Array:
        """Return the outputs of all recordings, (n, m) each, at the samples that count, (N,)."""
        pairs = zip(outputs, self.rows, strict=True)
        return np.concatenate([table[rows].ravel() for table, rows in pairs])

    def simulated(self, block: Block) -> list[Array]:
        """Return the outputs of a block over every recording, shape (n, m) each."""
        found = []
        for place, (recording, before) in enumerate(zip(self.recordings, self.pasts, strict=True)):
            own = self.changed(block, place)
            if recording.periodic:
                found.append(run_free(own, recording, self.names))
                continue
            inputs = recording.matrix(channel.name for channel in self.block.inputs)
            whole = np.ascontiguousarray(np.vstack([before, inputs]))
            state = known_state(own, self.known[place])  # from its own past outputs
            many = run_many([own], whole, sample_time=recording.sample_time, initial=state)
            found.append(many[0, len(before) :])
        return found

    def slopes(self, places: Sequence[int], kept: Array | slice = slice(None)) -> Array:
        """Return derivatives of the outputs by parameters in units of their sizes, shape (n, k).

        At the outputs ``kept`` of the N that count; see `mckibben.blocks.derivatives`.
        """
        sizes, found = relative_sizes(self.block.pack()), []
        many = max(1, AT_ONCE // max(sum(map(len, self.recordings)) * len(self.names), 1))
        for first in range(0, len(places), many):
            some = places[first : first + many]
            tables = [self._slopes_over(place, some) for place in range(len(self.recordings))]
            pairs = zip(tables, self.rows, strict=True)
            scored = np.concatenate([table[rows].reshape(-1, len(some)) for table, rows in pairs])
            found.append(scored[kept] * sizes[some])
        return np.concatenate(found, axis=1)

    def _slopes_over(self, place: int, places: Sequence[int]) -> Array:
        """Return the derivatives of the outputs over a recording, shape (n, m, k)."""
        block, known, past = self.changed(self.block, place), self.known[place], self.pasts[place]
        recording, values = self.recordings[place], block.pack()
        if recording.periodic:

            def run(moved: Array) -> Array:
                return run_free(block.unpack(moved), recording, self.names)

            return differences(run, values, DIFFERENCE * relative_sizes(values), places)

        def start(other: Block) -> Array:
            state = known_state(other, known)
            assert state is not None
            return state

        begun = start if known_state(block, known) is not None else None
        inputs = recording.matrix(channel.name for channel in block.inputs)
        whole = np.vstack([past, inputs])
        return derivatives(block, whole, recording.sample_time, begun, places)[len(past) :]
