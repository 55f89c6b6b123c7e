"""What a comparison holds: plain results, ready to be shown, saved or compared."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

from mckibben.comparison.choosing import Choice
from mckibben.comparison.recommending import recommended
from mckibben.comparison.row import Row
from mckibben.system.showing import DrawsItself

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

NOT_TOLD = "not told apart from the chosen model on this test"
"""Of a model that is `level`: too few data, or as good."""


@dataclass(frozen=True, repr=False)
class Leaderboard(DrawsItself):
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
    apart : str
        Why one model cannot follow some recordings: their signs, zeros, muscles; empty where it can.
    choice : Choice or None
        What choosing among so many costs; None without a cross-validation to resample.
    """

    face: ClassVar[str] = "leaderboard"

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
    apart: str = ""
    choice: Choice | None = None

    def __repr__(self) -> str:
        return str(self)

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
        return recommended(self.rows, self.constant, self.unit, self.apart)[0]

    @property
    def level(self) -> tuple[str, ...]:
        """The models that the test cannot tell from the chosen one."""
        best = self.best
        return tuple(r.model for r in self.rows if best is not None and r is not best and r.level)

    @property
    def not_recommended(self) -> str:
        """Why no model is recommended though some worked; else empty."""
        return recommended(self.rows, self.constant, self.unit, self.apart)[1]

    @property
    def off_training(self) -> tuple[str, ...]:
        """Why each model of local rules is to be trusted off its training, or is not."""
        return tuple(f"{r.model}: {r.off_training}" for r in self.rows if r.off_training)

    @property
    def drift(self) -> str:
        """How the chosen model's error drifts on the test, and what to do about it, if it does.

        What lies between recordings that do not belong together is no drift.
        """
        best = self.best
        if self.apart or best is None or best.drift is None or not best.drift.certain:
            return ""
        better = [row for row in self.rows if row.test_error < best.test_error and row.drift]
        without = [row.model for row in better if row.drift and row.drift.foresees(best.drift)]
        foresaw = f"foreseen by {', '.join(without)}" if without else "which no model foresaw"
        return (
            f"{best.model}: {best.drift}, {foresaw}; {best.drift.advice(best.inverse is not None)}"
        )

    @property
    def of_models(self) -> tuple[str, ...]:
        """What is to be said: `choice`, `off_training`, `drift`, of the chosen one's test and fit."""
        best = self.best
        drift = [self.drift] if self.drift else []
        if best is None:
            return (*self.off_training, *drift)
        price = [] if self.choice is None else [self.choice.said(self.unit)]
        said = [*filter(None, (best.start,)), *best.diagnostics.get("notes", ())]
        return (
            *filter(None, price),
            *self.off_training,
            *drift,
            *(f"{best.model}: {each}" for each in said),
        )

    @property
    def ranking(self) -> tuple[Row, ...]:
        """The rows with the constant in its place: behind all that are known to say more."""
        if self.constant is None or not self.rows:
            return self.rows
        order = self.constant.order
        place = sum(
            row.test is not None and ((row.skill_least or 0) > 0 or row.order <= order)
            for row in self.rows
        )
        return (*self.rows[:place], self.constant, *self.rows[place:])

    @property
    def failures(self) -> dict[str, list[str]]:
        """Every reason for which models failed, once, with those models."""
        found: dict[str, list[str]] = {}
        for row in self.rows:
            if row.reason is not None or row.test is None or row.train is None:
                found.setdefault(row.reason or "no scores", []).append(row.model)
        return found

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
            "choice": None if self.choice is None else self.choice.to_dict(),
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
