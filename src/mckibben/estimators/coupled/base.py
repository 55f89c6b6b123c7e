"""What an estimator of several muscles is: settings that find a block from recordings."""

from __future__ import annotations

import time
import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar, Self

import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray

from mckibben.blocks.base import Block
from mckibben.errors import ModelWarning
from mckibben.estimators.coupled.data import CoupledData, coupled_data
from mckibben.estimators.parameters import Parametrised
from mckibben.estimators.search import whole_searches
from mckibben.estimators.settings import check_settings
from mckibben.recording import Recording
from mckibben.signals.checking import LARGEST_SEED
from mckibben.threads import one_blas_thread

Array = NDArray[np.float64]
Tell = Callable[[float, str], None]


@dataclass(frozen=True)
class CoupledDiagnostics:
    """What a fit has to say of itself.

    Parameters
    ----------
    rmse : tuple of float
        Free-running RMSE of every displacement over all recordings fitted [mm].
    n_samples : int
        Samples fitted.
    seconds : float
        Wall time.
    notes : tuple of str
        What the user should know.
    """

    rmse: tuple[float, ...]
    n_samples: int
    seconds: float
    notes: tuple[str, ...] = ()


@dataclass(kw_only=True, repr=False, eq=False)
class CoupledEstimator(Parametrised, ABC):
    """Settings common to all estimators of several muscles.

    Parameters
    ----------
    pressures, displacements : sequence of str, optional
        Channels; default ``pressure_1`` and so on, as many as there are; or, of a single muscle,
        ``voltage`` or else ``pressure``, and ``displacement``.
    scheduling : sequence of str, optional
        Channels that schedule the model: an extensor's pressure, a load, a temperature. Default
        ``pressure_extensor`` and ``force``, where there are any.
    seed : int
        Of everything random.
    """

    pressures: tuple[str, ...] | None = None
    displacements: tuple[str, ...] | None = None
    scheduling: tuple[str, ...] | None = None
    seed: Annotated[int, Interval(ge=0, le=LARGEST_SEED)] = 0

    effort: ClassVar[float] = 1.0
    """About how long a fit to 10 000 samples takes [s]: models are compared cheapest first."""

    paired: ClassVar[bool] = True
    """Whether there must be a displacement to every pressure."""

    def fit(
        self,
        recordings: Recording | Sequence[Recording],
        y: None = None,
        *,
        validation: Sequence[Recording] = (),
        progress: Tell | None = None,
    ) -> Self:
        """Find the block that runs free closest to the recordings.

        Parameters
        ----------
        recordings : Recording or sequence of Recording
            All runs; what each stage needs is found by which inputs move.
        y : None
            Ignored; scikit-learn passes it.
        validation : sequence of Recording
            To stop a search early; nothing is fitted to them.
        progress : callable, optional
            Told the share of the work done, and what is next.

        Returns
        -------
        self
            With ``model_`` (pressures to displacements) and ``diagnostics_``.

        Raises
        ------
        DataError
            On recordings that cannot be learned from.
        ModelError
            On settings out of range.
        """
        del y
        with one_blas_thread(), whole_searches():  # the parts of a model are searched whole
            return self._fit(recordings, validation, progress)

    def _fit(
        self,
        recordings: Recording | Sequence[Recording],
        validation: Sequence[Recording],
        progress: Tell | None,
    ) -> Self:
        started = time.perf_counter()
        check_settings(self)
        listed = [recordings] if isinstance(recordings, Recording) else list(recordings)
        names = (self.pressures, self.displacements, self.scheduling)
        data = coupled_data(listed, *names)
        held_back = coupled_data(list(validation), *names) if validation else None
        if self.paired:
            data.check_pairs(listed[0].source)
        self.notes: list[str] = []
        self.model_ = self.identify(data, held_back, progress or (lambda share, text: None))
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", ModelWarning)
            errors = np.concatenate(
                [
                    self.predict_run(run.inputs, run.sample_time) - run.displacements
                    for run in data.runs
                ]
            )
        self.notes += sorted({str(warning.message) for warning in caught})
        self.diagnostics_ = CoupledDiagnostics(
            tuple(np.sqrt(np.mean(errors**2, axis=0)).tolist()),
            len(errors),
            time.perf_counter() - started,
            tuple(self.notes),
        )
        return self

    @abstractmethod
    def identify(self, data: CoupledData, validation: CoupledData | None, tell: Tell) -> Block:
        """Return the block found."""

    def predict_run(self, inputs: Array, sample_time: float | None) -> Array:
        """Return the model's free-running displacements."""
        found: Block = self.model_
        taken = np.ascontiguousarray(inputs[:, : len(found.inputs)])
        return found.simulate(taken, sample_time=sample_time)
