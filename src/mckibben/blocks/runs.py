"""A run: what a model is given over one recording, what was measured, and which samples are scored."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from mckibben.arrays import Array, Mask, true_runs
from mckibben.recording import Recording
from mckibben.signals.reversals import reversals


@dataclass(frozen=True, eq=False)
class Run:
    """One recording as inputs and outputs; fits, scores, checks and bands are of such runs.

    Parameters
    ----------
    source : Recording
        What was recorded.
    driven, scheduled : arrays, shapes (n, k) and (n, s)
        Inputs that drive, and those that schedule.
    outputs : array, shape (n, m)
        Measured.
    counts : array of bool, shape (n,)
        Samples whose outputs are scored; outputs elsewhere are never looked at.
    sample_time : float or None
        [s].
    from_outputs : bool
        Whether a free run begins from the first outputs, if these count; otherwise at rest.
    index, place : int
        Of its recording among all, and its own among all runs.
    unmeasured : tuple of str
        Scheduling channels that the recording lacks; their mean over the others is used.
    """

    source: Recording
    driven: Array
    outputs: Array
    scheduled: Array
    counts: Mask
    sample_time: float | None
    from_outputs: bool = True
    index: int = 0
    place: int = 0
    unmeasured: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.counts)

    @property
    def name(self) -> str:
        """Name of the recording."""
        return self.source.name

    @property
    def u(self) -> Array:
        """The first input, shape (n,)."""
        return self.driven[:, 0]

    @property
    def y(self) -> Array:
        """The first output, shape (n,)."""
        return self.outputs[:, 0]

    @property
    def inputs(self) -> Array:
        """Inputs of a block, shape (n, k + s): driven and scheduling."""
        return np.ascontiguousarray(np.hstack([self.driven, self.scheduled]))

    @property
    def start(self) -> Array | None:
        """The outputs that a free run begins from, shape (m,); None where it begins at rest."""
        has_output = self.from_outputs and self.counts[0] and self.outputs.shape[1]
        return self.outputs[0] if has_output else None

    @property
    def first(self) -> Array:
        """Inputs of a block at the first sample, shape (k + s,)."""
        return np.concatenate([self.driven[0], self.scheduled[0]])

    def thinned(self, every: int) -> Self:
        """Return every n-th sample."""
        step = None if self.sample_time is None else every * self.sample_time
        return replace(self._at(slice(None, None, every)), sample_time=step)

    def cut(self, start: int, stop: int | None = None) -> Self:
        """Return a segment of the run."""
        return self._at(slice(start, stop))

    def stretches(self, shortest: int) -> list[Self]:
        """Return the segments of scored samples longer than a minimum, each as a run."""
        ends = true_runs(self.counts).tolist()
        return [self.cut(start, stop) for start, stop in ends if stop - start > shortest]

    def condensed(self) -> Self:
        """Return the run reduced to scored samples and turning points of the input.

        Play operators do not depend on the path between turning points. Turns within
        the noise go too, so this is for searching, not for the final word.
        """
        mask = self.counts.copy()
        mask[reversals(self.u)] = True
        return self._at(mask)

    def _at(self, kept: slice | Mask) -> Self:
        """Return the remaining samples."""
        return replace(
            self,
            driven=self.driven[kept],
            outputs=self.outputs[kept],
            scheduled=self.scheduled[kept],
            counts=self.counts[kept],
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class FreeRun(Run):
    """A run, and the outputs of a model that runs free over it, shape (n, m)."""

    modelled: Array

    @classmethod
    def of(cls, run: Run, modelled: Array) -> FreeRun:
        """Return a run with modelled outputs."""
        return cls(**vars(run), modelled=modelled)

    @property
    def residual(self) -> Array:
        """Measured minus modelled outputs, shape (n, m)."""
        return self.outputs - self.modelled

    @property
    def errors(self) -> Array:
        """Residual at the scored samples, shape (scored, m)."""
        return self.residual[self.counts]

    @property
    def speeds(self) -> Array:
        """Speeds of the modelled outputs there [unit/s], shape (scored, m); 0 without time."""
        steps = np.abs(np.diff(self.modelled, axis=0, prepend=self.modelled[:1]))[self.counts]
        return np.asarray(0.0 * steps if self.sample_time is None else steps / self.sample_time)


def run_of(
    recording: Recording,
    driven: Sequence[str],
    outputs: Sequence[str],
    scheduling: Sequence[str] = (),
    counts: Mask | None = None,
    *,
    index: int = 0,
) -> Run:
    """Return a recording as a run of these channels.

    ``counts`` are the samples that are scored, shape (n,); by default all but those bridged in reading.
    A motion that repeats has no start.
    """
    if counts is None:
        counts = ~recording.bridged
    given, measured, scheduled = (
        recording.matrix(names) if names else np.empty((len(recording), 0))
        for names in (driven, outputs, scheduling)
    )
    step, begins = recording.sample_time, not recording.periodic
    return Run(recording, given, measured, scheduled, counts, step, begins, index, index)
