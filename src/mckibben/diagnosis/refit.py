"""Refit of a model to a log, compared with the old model on held-out parts."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from mckibben import registry
from mckibben.blocks.base import Block
from mckibben.blocks.compose import Series
from mckibben.blocks.inverse import Inverse
from mckibben.channels import channels_of
from mckibben.errors import MckibbenError, ModelWarning
from mckibben.estimators.catalogue import declared
from mckibben.numerics.blocks import BlockBootstrap, interval
from mckibben.numerics.statistics import correlation_length
from mckibben.recording import Recording
from mckibben.splits import parts_of


@dataclass(frozen=True, eq=False)
class Refit:
    """Model of the same kind, refitted to the log and to older data if there are any.

    Parameters
    ----------
    model : Block
    old, new : float
        Root mean square error, running free, on parts held out, of the old model and of the new one as
        it would be without the part; of several outputs that of each over its range, on the mean.
    ratio : (float, float)
        95 % interval of new over old, by a paired block bootstrap.
    n_parts, older : int
        Parts, and recordings of older data.
    """

    model: Block = field(repr=False)
    old: float
    new: float
    ratio: tuple[float, float]
    n_parts: int
    older: int

    @property
    def recommended(self) -> bool:
        """Whether it is significantly better than the old model."""
        return self.ratio[1] < 1

    def to_dict(self) -> dict[str, Any]:
        """Return it for JSON, without the model."""
        return {
            "kind": self.model.kind,
            "old_rmse": self.old,
            "new_rmse": self.new,
            "ratio_interval": list(self.ratio),
            "n_parts": self.n_parts,
            "older_recordings": self.older,
            "recommended": self.recommended,
        }


def refitted(
    old: Block, logs: Sequence[Recording], older: Sequence[Recording], *, seed: int = 0
) -> Refit | str:
    """Refit a model of the same kind to logs, or return why that is not possible.

    ``older`` recordings are fitted as well; those without its channels are left out.
    """
    kinds = " ".join(_kinds(old))
    known = map(declared, registry.names("estimators"))
    estimator = next((one for one in known if kinds in one.makes), None)
    if estimator is None:
        return f"No estimator makes models of kind {old.kind!r}."
    inputs, outputs = ([c.name for c in channels] for channels in (old.inputs, old.outputs))
    names = [*inputs, *outputs]
    whole = [log.select(names) for log in logs]
    older_runs = [one.select(names) for one in older if all(name in one for name in names)]
    driving = [name for name in inputs if name not in old.scheduling]
    channels = channels_of(whole, driving, outputs, old.scheduling)
    settings = {"seed": seed} | estimator.channel_settings(channels)
    for part in old.parts if isinstance(old, Series) else (old,):
        thresholds = getattr(part, "thresholds", None)
        if thresholds is not None and "n_operators" in {one.name for one in fields(estimator)}:
            settings["n_operators"] = len(thresholds) - (thresholds[0] == 0)

    parts = parts_of(whole, channels)
    if not parts:
        return "The log is too short to leave parts of it out."
    kept = tuple(np.zeros(len(one), dtype=bool) for one in older_runs)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ModelWarning)
            pairs = [(old.simulate(log).matrix(outputs), log.matrix(outputs)) for log in whole]
            before = [modelled - measured for modelled, measured in pairs]
            refit = estimator(**settings).fit([*whole, *older_runs])
            found = refit.held_out([*whole, *older_runs], [(*part, *kept) for part in parts])
    except MckibbenError as error:
        return f"No model could be fitted to the log: {error}"
    if found is None:
        return "The model has too many parameters to leave parts of the log out."
    new = refit.fitted
    # older recordings come last
    after = [table - measured for table, (_, measured) in zip(found, pairs, strict=False)]
    if not any(errors.any() for errors in before):
        return "The model has no error on the log."
    spans = np.ptp(np.concatenate([measured for _, measured in pairs]), axis=0)
    sizes = spans if len(outputs) > 1 else np.ones(1)
    squares = [((errors / sizes) ** 2).mean(axis=1) for errors in after]
    bootstrap = BlockBootstrap([len(log) for log in whole], seed, correlation_length(squares))
    errors = [np.concatenate(each) / sizes for each in (before, after)]
    of_old, of_new = (bootstrap.rmse(each) for each in errors)
    ratio = interval(of_new / np.maximum(of_old, np.finfo(float).tiny))
    missed_by = [float(np.sqrt((each**2).mean(axis=0)).mean()) for each in errors]
    return Refit(new, missed_by[0], missed_by[1], ratio, len(parts), len(older_runs))


def _kinds(block: Block) -> list[str]:
    """Return the kinds of a model's parts in their order."""
    if isinstance(block, Series):
        return [kind for part in block.parts for kind in _kinds(part)]
    return [f"{block.forward.kind}-inverse" if isinstance(block, Inverse) else block.kind]
