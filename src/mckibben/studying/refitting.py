"""The same kind of model fitted to a log, and tried against the old one on parts held back."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from mckibben import registry
from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.compose import Series
from mckibben.blocks.free_run import run_free
from mckibben.blocks.inverse import Inverse
from mckibben.comparison.splits import Fold, folds
from mckibben.errors import MckibbenError, ModelWarning
from mckibben.estimators.catalogue import declared
from mckibben.recording import Recording
from mckibben.statistics import BlockBootstrap, correlation_length, interval

N_FOLDS = 4
"""Parts of a log held back in turn."""


@dataclass(frozen=True, eq=False)
class Refit:
    """The same kind of model, fitted to the log.

    Parameters
    ----------
    model : Block
        Fitted to all of the log, and to older data where there are any.
    old, new : float
        Root mean square error, running free, on parts held back, of the old model and of models fitted
        to the rest; of several outputs that of each over its range, on the mean.
    ratio : (float, float)
        95 % interval of new over old.
    n_folds : int
        Parts.
    older : int
        Recordings of older data.
    covered : float
        Share of the range of pressures of the old model that log and older data cover.
    """

    model: Block = field(repr=False)
    old: float
    new: float
    ratio: tuple[float, float]
    n_folds: int
    older: int
    covered: float

    @property
    def recommended(self) -> bool:
        """Whether it is better than the old model by more than chance."""
        return self.ratio[1] < 1

    def to_dict(self) -> dict[str, Any]:
        """Return it for JSON, without the model."""
        return {
            "kind": self.model.kind,
            "old_rmse": self.old,
            "new_rmse": self.new,
            "ratio_interval": list(self.ratio),
            "n_folds": self.n_folds,
            "older_recordings": self.older,
            "covered": self.covered,
            "recommended": self.recommended,
        }


def refitted(
    old: Block, logs: Sequence[Recording], older: Sequence[Recording], *, seed: int = 0
) -> Refit | str:
    """Fit the same kind of model to logs, or say why that cannot be done.

    Every part of the logs is held back in turn; on it, the old model and one fitted to the rest run
    free, and their errors are resampled in the same blocks.

    Parameters
    ----------
    old : Block
        The model that ran.
    logs : sequence of Recording
        With its channels, at scored samples.
    older : sequence of Recording
        What is fitted beside; those without its channels are left out.
    """
    kinds = " ".join(_kinds(old))
    known = map(declared, registry.names("estimators"))
    estimator = next((one for one in known if kinds in one.makes), None)
    if estimator is None:
        return f"No way is known to fit a model of kind {old.kind!r} again."
    inputs = [channel.name for channel in old.inputs]
    outputs = [channel.name for channel in old.outputs]
    whole = [log.select([*inputs, *outputs]) for log in logs]
    beside = [
        one.select([*inputs, *outputs])
        for one in older
        if all(channel in one for channel in (*inputs, *outputs))
    ]
    driving = [n for n in inputs if n not in old.scheduling]
    spans = np.ptp(np.concatenate([log.matrix(outputs) for log in whole]), axis=0)

    def fitted(recordings: Sequence[Recording], rows: Sequence[Array]) -> Block:
        every = [*recordings, *beside]
        masks = [*rows, *(np.ones(len(one), dtype=bool) for one in beside)]
        found: Block = _as(old, estimator, driving, outputs, seed).fit(every, rows=masks).model_
        return found

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ModelWarning)
            parts = list(folds(whole, driving[0], N_FOLDS))
            errors = _held_back(old, whole, parts, fitted, outputs)
            new = fitted(whole, [np.ones(len(one), dtype=bool) for one in whole])
    except MckibbenError as error:
        return f"No model could be fitted to the log: {error}"
    scaled = [e if len(outputs) == 1 else e / spans for e in errors]
    lengths = [len(log) for log in whole]
    squares = np.split((scaled[1] ** 2).mean(axis=1), np.cumsum(lengths)[:-1])
    mean = max(float(np.mean(np.concatenate(squares))), np.finfo(float).tiny)
    memory = correlation_length([part / mean for part in squares])
    bootstrap = BlockBootstrap(lengths, seed, memory)
    before, after = (bootstrap.rmse(each) for each in scaled)
    rms = [float(np.sqrt((each**2).mean(axis=0)).mean()) for each in scaled]
    return Refit(
        model=new,
        old=rms[0],
        new=rms[1],
        ratio=interval(after / np.maximum(before, np.finfo(float).tiny)),
        n_folds=len(parts),
        older=len(beside),
        covered=_covered(old, [*whole, *beside], driving[0]),
    )


def _held_back(
    old: Block,
    logs: Sequence[Recording],
    parts: Sequence[Fold],
    fitted: Any,
    outputs: Sequence[str],
) -> tuple[Array, Array]:
    """Return the errors of the old model, and of new ones on what these were not fitted to."""

    def missed(block: Block, log: Recording) -> Array:
        return np.asarray(run_free(block, log, list(outputs)) - log.matrix(outputs))

    before = [missed(old, log) for log in logs]
    after = [one.copy() for one in before]
    for part in parts:
        new = fitted(part.train, part.train_rows)
        for log, rows in zip(part.test, part.test_rows, strict=True):
            place = next(k for k, own in enumerate(logs) if own is log)
            after[place][rows] = missed(new, log)[rows]
    return np.concatenate(before), np.concatenate(after)


def _kinds(block: Block) -> list[str]:
    """Return the kinds of a model's parts in their order."""
    if isinstance(block, Series):
        return [kind for part in block.parts for kind in _kinds(part)]
    return [f"{block.forward.kind}-inverse" if isinstance(block, Inverse) else block.kind]


def _as(old: Block, made: Any, inputs: Sequence[str], outputs: Sequence[str], seed: int) -> Any:
    """Return an estimator of models with as many operators as the old one."""
    settings = {"seed": seed} | made.channel_settings(inputs, outputs, old.scheduling)
    known = {one.name for one in fields(made)}
    for part in old.parts if isinstance(old, Series) else (old,):
        thresholds = getattr(part, "thresholds", None)
        if "n_operators" in known and thresholds is not None:
            settings["n_operators"] = len(thresholds) - (thresholds[0] == 0)
    return made(**settings)


def _covered(old: Block, recordings: Sequence[Recording], name: str) -> float:
    first = old.parts[0] if isinstance(old, Series) else old
    known = getattr(first, "input_range", None)
    if known is None or not np.isfinite(known).all() or known[0] >= known[1]:
        return 1.0
    low = max(min(float(one[name].min()) for one in recordings), known[0])
    high = min(max(float(one[name].max()) for one in recordings), known[1])
    return max(high - low, 0.0) / (known[1] - known[0])
