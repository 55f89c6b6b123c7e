"""What a comparison holds: plain results, ready to be shown, saved or compared."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from mckibben.blocks.core.block import Block
from mckibben.comparison.banding import TestedBand
from mckibben.comparison.coverage import OffTraining
from mckibben.comparison.drift import Drift
from mckibben.comparison.limits import caution
from mckibben.comparison.recommending import CONSTANT, order, recommended
from mckibben.errors import MckibbenError
from mckibben.metrics import Scores

if TYPE_CHECKING:
    import pandas as pd

CHOICES = {
    "cross-validation": ("CV RMSE", "cross-validation on the training side"),
    "validation": (
        "validation RMSE",
        "the last part of the training data, left out of a fit for it",
    ),
    "given": ("validation RMSE", "runs given for it, to which nothing is fitted"),
    "fit": ("fit RMSE", "the error on the data fitted, for want of a validation"),
}
"""What a model may be chosen by: the heading of its figure, and in words. The test is not among them."""


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
    test_rank : int or None
        Place by test RMSE, from 1; nothing is chosen by it.
    rmse_interval : (float, float) or None
        95 % moving-block bootstrap interval of the test RMSE.
    difference_interval : (float, float) or None
        The same of its difference to the chosen model's test RMSE, paired on the same blocks.
    memory : Memory or None
        The memory test, on the test set.
    off_training : OffTraining or None
        How a model of local rules does where training has been on the test set, and where it has not.
    drift : Drift or None
        The slow part of the error on the test, of the output where it is largest; None of tests without
        time, or too short to tell.
    band : TestedBand or None
        How its band does on the test, of models that were best when they were done.
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
    test_rank: int | None = None
    rmse_interval: tuple[float, float] | None = None
    difference_interval: tuple[float, float] | None = None
    memory: Memory | None = None
    off_training: OffTraining | None = None
    drift: Drift | None = None
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
        return self.order[2]

    @property
    def order(self) -> tuple[bool, bool, float, str]:
        """What rows are sorted by."""
        fitted = None if self.train is None else self.train.rmse
        return order(self.model, self.validation_rmse, fitted)

    @cached_property
    def inverse(self) -> Block | None:
        """The model's inverse, or None where it has none."""
        try:
            return None if self.block is None else self.block.inverse()
        except MckibbenError:
            return None

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
        return {
            "model": self.model,
            "status": "baseline" if self.model == CONSTANT else "ok",
            "n_parameters": self.n_parameters,
            "fit_seconds": self.fit_seconds,
            "step_ns": self.step_ns,
            "train": train,
            "test": test,
            "validation_rmse": self.validation_rmse,
            "outputs": {
                name: asdict(scores) | {"validation_rmse": self.validation_by_output.get(name)}
                for name, scores in self.outputs.items()
            },
            "skill": _finite(self.skill),
            "skill_least": _finite(self.skill_least),
            "memory": None if self.memory is None else asdict(self.memory),
            "off_training": None if self.off_training is None else self.off_training.to_dict(),
            "drift": None if self.drift is None else self.drift.to_dict(),
            "band": None if self.band is None else self.band.to_dict(),
            "rate_dependent": self.block is not None and bool(self.block.rate_dependent),
            "invertible": self.inverse is not None,
            "caution": self.caution,
        }


@dataclass(frozen=True)
class Leaderboard:
    """Models chosen on the training side, and their errors on data not used to fit or to choose.

    Parameters
    ----------
    inputs, outputs : tuple of str
        Channels.
    unit : str
        Unit of the outputs and of every RMSE.
    rows : tuple of Row
        Sorted by what they are chosen by; those for which it failed behind, models that failed last.
    split : str
        In words: what was used to fit, to choose, and to test, and how memory was started.
    seed : int
        The seed of everything random.
    n_train, n_test : int
        Samples.
    chosen_by : {"cross-validation", "validation", "given", "fit"}
        What the model is chosen by, see `CHOICES`: never the test.
    left_out : mapping of str to str
        Models that were not asked for by name and have no place on these channels, and why.
    pending : tuple of str
        Models that were not finished when this was made.
    notes : tuple of str
        What was done to the recordings before.
    stopped : bool
        Whether the work was interrupted, be it after the last model.
    constant : Row or None
        The mean of the training output as a model: what every model has to beat.
    shared : tuple of str
        Where recordings to fit to and to test on are the same data, which the user insisted on.
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    unit: str
    rows: tuple[Row, ...]
    split: str
    seed: int
    n_train: int
    n_test: int
    chosen_by: str = "cross-validation"
    left_out: Mapping[str, str] = field(default_factory=dict)
    pending: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    stopped: bool = False
    constant: Row | None = None
    shared: tuple[str, ...] = ()

    @property
    def input(self) -> str:
        """The input, or all of them in words."""
        return ", ".join(self.inputs)

    @property
    def output(self) -> str:
        """The output, or all of them in words."""
        return ", ".join(self.outputs)

    @property
    def best(self) -> Row | None:
        """The model chosen: the first row that did not fail and beats the constant, or None.

        It has the least cross-validated error on the training side. One whose cross-validation failed
        is chosen only if every other's did. The test has no say, except that a model that cannot be
        run on it at all has failed, and that nothing is recommended where the choice is no better there
        than the constant; see `recommended`.
        """
        return recommended(self.rows, self.constant, self.unit)[0]

    @property
    def not_recommended(self) -> str:
        """Why no model is recommended though some worked; else empty."""
        return recommended(self.rows, self.constant, self.unit)[1]

    @property
    def off_training(self) -> tuple[str, ...]:
        """Why each model of local rules is to be trusted off its training, or is not."""
        return tuple(f"{r.model}: {r.off_training}" for r in self.rows if r.off_training)

    @property
    def drift(self) -> str:
        """How the chosen model's error drifts on the test, and what to do about it, if it does."""
        best = self.best
        if best is None or best.drift is None or not best.drift.certain:
            return ""
        better = [row for row in self.rows if row.test_error < best.test_error and row.drift]
        without = [row.model for row in better if row.drift and row.drift.foresees(best.drift)]
        foresaw = f"foreseen by {', '.join(without)}" if without else "which no model foresaw"
        return (
            f"{best.model}: {best.drift}, {foresaw}; {best.drift.advice(best.inverse is not None)}"
        )

    @property
    def of_models(self) -> tuple[str, ...]:
        """What is to be said of models: `off_training`, `drift`, and what the chosen one's fit said."""
        best = self.best
        drift = [self.drift] if self.drift else []
        if best is None:
            return (*self.off_training, *drift)
        said = [*([best.band] if best.band else []), *best.diagnostics.get("notes", ())]
        return (*self.off_training, *drift, *(f"{best.model}: {each}" for each in said))

    @property
    def ranking(self) -> tuple[Row, ...]:
        """The rows with the constant in its place."""
        if self.constant is None or not self.rows:
            return self.rows
        order = self.constant.order
        place = sum(row.test is not None and row.order <= order for row in self.rows)
        return (*self.rows[:place], self.constant, *self.rows[place:])

    @property
    def lowest(self) -> Row | None:
        """The row with the least test error, which is nothing to choose by, or None."""
        tested = [row for row in self.rows if row.test is not None]
        return min(tested, key=lambda row: row.test.rmse if row.test else 0.0, default=None)

    @property
    def chosen(self) -> str:
        """Which model is chosen and by what, and its test error, in words; empty where there is none.

        The test error of another model is told where it is lower.
        """
        best, lowest = self.best, self.lowest
        if best is None and self.not_recommended:
            return f"{self.not_recommended}."
        if best is None or best.test is None or best.train is None or lowest is None:
            return ""
        heading, by = CHOICES[self.chosen_by]
        value = best.validation_rmse
        if value is None and self.chosen_by != "fit":
            heading, by = CHOICES["fit"]
            by += " that did not fail"
        least = "" if lowest.test is None else f"{lowest.test.rmse:.3g} {self.unit}".strip()
        own = f"{best.test.rmse:.3g} {self.unit}".strip()
        said = (
            f"Chosen by {by}: {best.model}, {heading} "
            f"{best.train.rmse if value is None else value:.3g} {self.unit}".strip()
        )
        end = "".join(f" {one[0].upper()}{one[1:]}" for one in self.shared)
        if lowest.model == best.model:
            return f"{said}; its test RMSE: {own}, the lowest.{end}"
        return f"{said}; its test RMSE: {own}. Lowest test RMSE: {lowest.model}, {least}.{end}"

    def to_dict(self) -> dict[str, Any]:
        """Return the leaderboard as ``leaderboard.json`` holds it."""
        best, lowest = self.best, self.lowest
        return {
            "input": self.inputs[0] if len(self.inputs) == 1 else list(self.inputs),
            "output": self.outputs[0] if len(self.outputs) == 1 else list(self.outputs),
            "unit": self.unit,
            "split": self.split,
            "seed": self.seed,
            "n_train": self.n_train,
            "n_test": self.n_test,
            "chosen_by": self.chosen_by,
            "chosen": None if best is None else best.model,
            "not_recommended": self.not_recommended or None,
            "lowest_on_test": None if lowest is None else lowest.model,
            "left_out": dict(self.left_out),
            "pending": list(self.pending),
            "notes": [*self.notes, *self.of_models],
            "shared": list(self.shared),
            "rows": [row.to_dict() for row in self.ranking],
        }

    def to_frame(self) -> pd.DataFrame:
        """Return the leaderboard as a table, one row a model, nested names joined by dots.

        Where tests are shared with training, a column says so.
        """
        import pandas as pd

        table = pd.json_normalize([row.to_dict() for row in self.ranking])
        return table.assign(shared=" ".join(self.shared)) if self.shared else table


def _finite(value: float | None) -> float | None:
    return value if value is not None and np.isfinite(value) else None


def _listed(interval: tuple[float, float] | None) -> list[float] | None:
    return None if interval is None else list(interval)
