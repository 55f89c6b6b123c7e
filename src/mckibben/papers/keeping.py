"""What a re-run has recorded and fitted, kept so that one that was stopped goes on from there."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from mckibben.blocks.base import Block
from mckibben.comparison.checkpoints import Checkpoints
from mckibben.errors import MckibbenError
from mckibben.estimators.optimisers.tracker import whole_searches
from mckibben.files import read, write
from mckibben.recording import Recording
from mckibben.rigs import record
from mckibben.signals.protocol import Protocol, Run, protocol


@dataclass(frozen=True)
class Fitted:
    """What a fit gave.

    Parameters
    ----------
    block : Block
        The model.
    rmse : float
        Its free-running error on the data fitted, in the unit of the output; of several the largest.
    seconds : float
        That the fit took [s].
    standard_errors : tuple of float
        Of ``block.pack()``, NaN where not known; of several outputs none.
    """

    __pydantic_config__: ClassVar[dict[str, bool]] = {"arbitrary_types_allowed": True}

    block: Block
    rmse: float
    seconds: float
    standard_errors: tuple[float, ...] = field(default=(), compare=False)


def fitted(
    kept: Checkpoints,
    name: str,
    estimator: Any,
    recordings: Recording | Sequence[Recording],
    **how: Any,
) -> Fitted:
    """Return what an estimator finds on recordings, or found before the work was stopped.

    Parameters
    ----------
    kept : Checkpoints
        Where fits are kept.
    name : str
        Of the model.
    estimator : Estimator
        With its settings.
    recordings : Recording or sequence of Recording
        To fit.
    **how
        What else its ``fit`` takes.

    Raises
    ------
    MckibbenError
        As its ``fit`` does.
    """

    def fit() -> Fitted:
        with whole_searches():
            estimator.fit(recordings, **how)
        said = estimator.diagnostics_
        errors = tuple(getattr(said, "standard_errors", ()))
        return Fitted(estimator.model_, float(np.max(said.rmse)), said.seconds, errors)

    settings = (type(estimator).__name__, estimator.get_params())
    return kept.once(name, Fitted, fit, settings, recordings, how)


def recorded(
    kept: Checkpoints,
    what: Protocol | str,
    runs: Sequence[str],
    seed: int,
    tell: Callable[[float, str], None],
) -> Iterator[tuple[Run, Recording]]:
    """Yield runs of a protocol on its rig, in their order, those recorded before read from disk."""
    plan = protocol(what) if isinstance(what, str) else what
    files = {run: kept.file(run, ".csv", plan.name, plan[run], seed) for run in runs}
    there = {run: _read(file) for run, file in files.items()}
    fresh = record(plan, runs=[run for run in runs if there[run] is None], seed=seed)
    for done, run in enumerate(runs, start=1):
        recording, file = there[run], files[run]
        if recording is None:
            _, recording = next(fresh)
            if file is not None:
                write(recording, file)
        tell(done / len(runs), f"recorded {run}")
        yield plan[run], recording


def _read(file: Path | None) -> Recording | None:
    """Return the recording in a file, or None if it is absent or damaged."""
    try:
        (recording,) = read(file, informative=False) if file is not None else (None,)
    except MckibbenError:
        return None
    return recording
