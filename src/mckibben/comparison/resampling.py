"""Test errors of all models resampled in the same blocks, as long as their memory asks for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mckibben.arrays import Array
from mckibben.statistics import BlockBootstrap, block_length, correlation_length


class Resampling:
    """Resamples of models' test RMSE that pair, kept from one ranking to the next.

    Parameters
    ----------
    lengths : sequence of int
        Scored samples of every test recording.
    seed : int
        Of the resampling.
    """

    def __init__(self, lengths: Sequence[int], seed: int) -> None:
        self._lengths = [n for n in lengths if n]
        self._seed = seed
        self._memory: dict[str, float] = {}
        self._found: dict[tuple[str, tuple[int, ...]], Array] = {}

    def of(self, errors: Mapping[str, Array], other: str, others: Array) -> dict[str, Array]:
        """Return resampled RMSE of every model, shape (RESAMPLES,), and of another one.

        Blocks suit the median of the memories of the models' squared errors; the other has no say.

        Parameters
        ----------
        errors : mapping of str to array, shape (sum of lengths, k)
            At all scored samples.
        other : str
            Name of the other.
        others : array, shape (sum of lengths, k)
            Its errors.
        """
        for model, missed in errors.items():
            if model not in self._memory:
                self._memory[model] = self._remembered(missed)
        memory = float(np.median([self._memory[model] for model in errors] or [1.0]))
        length = tuple(block_length(n, memory) for n in self._lengths)
        bootstrap: BlockBootstrap | None = None
        found = {}
        for model, missed in (*errors.items(), (other, others)):
            if (model, length) not in self._found:
                bootstrap = bootstrap or BlockBootstrap(self._lengths, self._seed, memory)
                self._found[model, length] = bootstrap.rmse(missed)
            found[model] = self._found[model, length]
        return found

    def _remembered(self, errors: Array) -> float:
        squares = errors**2 / np.maximum((errors**2).mean(axis=0), np.finfo(float).tiny)
        ends = np.cumsum(self._lengths)[:-1]
        return correlation_length(np.split(squares.mean(axis=1), ends))
