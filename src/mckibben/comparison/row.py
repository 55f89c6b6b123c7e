"""One model of a leaderboard: what was found of it, plain results."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Literal

import numpy as np

from mckibben.blocks.base import Block
from mckibben.blocks.force.feedforward import compensator
from mckibben.blocks.inverse import Inverse
from mckibben.comparison.coverage import OffTraining
from mckibben.comparison.drift import Drift
from mckibben.comparison.offered import caution
from mckibben.comparison.recommending import CONSTANT, order
from mckibben.comparison.starts import Start
from mckibben.diagnosis.bands import TestedBand
from mckibben.errors import MckibbenError
from mckibben.metrics import Scores


@dataclass(frozen=True)
class Memory:
    """Whether a model keeps the branches apart as the data do.

    Parameters
    ----------
    gap_ratio : float or None
        Slope of the model's branch gaps over the measured ones, at instants with the same input
        reached from opposite directions: 1 is perfect, 0 means that the model forgot. None where the
        data have no such pairs.
    n_pairs : int
        Number of pairs of instants behind it.
    hold_ratio : float or None
        Share of the model's own branch gap that survives a synthetic hold on each branch; 1 for a
        model that remembers.
    """

    gap_ratio: float | None
    n_pairs: int
    hold_ratio: float | None


@dataclass(frozen=True)
class Row:
    """One model of a leaderboard.

    Parameters
    ----------
    model : str
        Short name of the model.
    reason : str or None
        Why it failed, or None where it did not.
    n_parameters : int
        Numbers identified.
    fit_seconds : float
        Wall time of the fit on the whole training set.
    step_ns : float
        Time of one sample in a long simulation [ns].
    train, test : Scores or None
        Free-running scores, in the unit of the output; test is on data not used to fit or choose. Of
        several outputs, the means of theirs, and the largest of their largest errors.
    outputs : mapping of str to Scores
        The same on the test data, of every output.
    validation_rmse : float or None
        Cross-validated RMSE within the training set, by which models are chosen; None where that
        failed or was not asked for. Of several outputs, the mean of theirs.
    validation_by_output : mapping of str to float
        The same of every output.
    skill : float or None
        Share of the squared error of the constant, the mean of what is fitted to, that the model removes
        in the cross-validation: 1 is perfect, 0 no better.
    skill_least : float or None
        What 99 % of resamples of its blocks exceed; a model is recommended only where that is above 0.
    squares : tuple of tuple of float
        Sums of squared errors of the cross-validation by piece and output; none where models are not
        validated on the same.
    test_rank : int or None
        Place by test RMSE, from 1; nothing is chosen by it.
    rmse_interval : (float, float) or None
        95 % moving-block bootstrap interval of the test RMSE.
    difference_interval : (float, float) or None
        Of its test RMSE less the chosen model's, paired on the same blocks; the intervals of all models
        hold at once in 95 %.
    memory : Memory or None
        The memory test, on the test set.
    off_training : OffTraining or None
        How a model of local rules does where training has been on the test set, and where it has not.
    drift : Drift or None
        The slow part of the error on the test, of the output where it is largest; None of tests without
        time, or too short to tell.
    start : Start or None
        The start of the test, where most of the error lies there.
    band : TestedBand or None
        How its band does on the test, of the chosen model.
    block, banded : Block or None
        The model identified, and with that band.
    diagnostics : mapping
        What the estimator says of the fit.
    """

    __pydantic_config__: ClassVar[dict[str, bool]] = {"arbitrary_types_allowed": True}

    model: str
    reason: str | None = None
    n_parameters: int = 0
    fit_seconds: float = float("nan")
    step_ns: float = float("nan")
    train: Scores | None = None
    test: Scores | None = None
    outputs: Mapping[str, Scores] = field(default_factory=dict)
    validation_rmse: float | None = None
    validation_by_output: Mapping[str, float] = field(default_factory=dict)
    skill: float | None = None
    skill_least: float | None = None
    squares: tuple[tuple[float, ...], ...] = field(default=(), repr=False)
    test_rank: int | None = None
    rmse_interval: tuple[float, float] | None = None
    difference_interval: tuple[float, float] | None = None
    memory: Memory | None = None
    off_training: OffTraining | None = None
    drift: Drift | None = None
    start: Start | None = None
    band: TestedBand | None = None
    block: Block | None = field(default=None, repr=False)
    banded: Block | None = field(default=None, repr=False)
    diagnostics: Mapping[str, Any] = field(default_factory=dict, repr=False)

    @property
    def sound(self) -> bool:
        """Whether there is a model with finite scores."""
        return (
            self.reason is None
            and self.block is not None
            and self.train is not None
            and self.test is not None
            and bool(np.isfinite([self.train.rmse, self.test.rmse]).all())
        )

    @property
    def test_error(self) -> float:
        """RMSE on the test data, infinite where there is none."""
        return float("inf") if self.test is None else self.test.rmse

    @property
    def chosen_by(self) -> float:
        """The error that the model is chosen by: the validated one, else that of the fit."""
        return self.order[3]

    @property
    def order(self) -> tuple[bool, bool, bool, float, str]:
        """What rows are sorted by."""
        fitted = None if self.train is None else self.train.rmse
        return order(self.model, self.validation_rmse, fitted, self.skill_least)

    @cached_property
    def inverse(self) -> Block | None:
        """What undoes the model, or None where nothing does."""
        try:
            return None if self.block is None else compensator(self.block)
        except MckibbenError:
            return None

    @property
    def level(self) -> bool:
        """Whether the test cannot tell the model from the chosen one."""
        ends = self.difference_interval
        return self.reason is None and ends is not None and ends[0] <= 0 <= ends[1]

    @property
    def invalid(self) -> str | None:
        """Why a part of the cross-validation failed, or None."""
        found: str | None = self.diagnostics.get("validation_failed")
        return found

    @property
    def caution(self) -> str | None:
        """Why the model is good only near what it was trained on, or None."""
        return caution(self.model)

    def to_dict(self) -> dict[str, Any]:
        """Return the row as the leaderboard files hold it."""
        if self.reason is not None:
            return {"model": self.model, "status": "failed", "reason": self.reason}
        train = None if self.train is None else asdict(self.train)
        test = None if self.test is None else asdict(self.test)
        if test is not None:
            test["rank"] = self.test_rank
            test["rmse_interval"] = _listed(self.rmse_interval)
            test["difference_to_chosen_interval"] = _listed(self.difference_interval)
            test["level_with_chosen"] = self.level
        return {
            "model": self.model,
            "status": "baseline" if self.model == CONSTANT else "ok",
            "n_parameters": self.n_parameters,
            "fit_seconds": self.fit_seconds,
            "step_ns": self.step_ns,
            "train": train,
            "test": test,
            "validation_rmse": self.validation_rmse,
            "validation_failed": self.invalid,
            "outputs": {
                name: asdict(scores) | {"validation_rmse": self.validation_by_output.get(name)}
                for name, scores in self.outputs.items()
            },
            "skill": _finite(self.skill),
            "skill_least": _finite(self.skill_least),
            "memory": None if self.memory is None else asdict(self.memory),
            "off_training": None if self.off_training is None else self.off_training.to_dict(),
            "drift": None if self.drift is None else self.drift.to_dict(),
            "start": None if self.start is None else self.start.to_dict(),
            "band": None if self.band is None else self.band.to_dict(),
            "rate_dependent": self.block is not None and bool(self.block.rate_dependent),
            "invertible": self.inverse is not None,
            "inverse": inverse_of(self.inverse),
            "caution": self.caution,
        }


def inverse_of(inverse: Block | None) -> Literal["exact", "solved", "none"]:
    """Return how an inverse is found: by a formula, by solving in every step, or not at all.

    Parameters
    ----------
    inverse : Block or None
        Of a model; None where it has none.
    """
    if inverse is None:
        return "none"
    return "solved" if _solves(inverse) else "exact"


def _solves(block: Block) -> bool:
    if isinstance(block, Inverse):
        return block.forward.solved
    parts = [getattr(block, name, None) for name in block.parameters]
    nested = [part for some in parts for part in (some if isinstance(some, tuple) else (some,))]
    return any(_solves(part) for part in nested if isinstance(part, Block))


def _finite(value: float | None) -> float | None:
    return value if value is not None and np.isfinite(value) else None


def _listed(interval: tuple[float, float] | None) -> list[float] | None:
    return None if interval is None else list(interval)
