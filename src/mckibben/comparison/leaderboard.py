"""Results of a comparison: one row per model, in the order of the choice, and doubts about it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.force.feedforward import compensator
from mckibben.blocks.inverse import Inverse
from mckibben.diagnosis.bands import TestedBand
from mckibben.diagnosis.branch_gaps import Memory
from mckibben.errors import MckibbenError, ModelError
from mckibben.metrics import Scores
from mckibben.numerics.statistics import half_interval
from mckibben.simulation import Simulates
from mckibben.splits import Span
from mckibben.system.atomic import Numbers, plain
from mckibben.system.showing import Result

if TYPE_CHECKING:
    import pandas as pd
from typing import Protocol, TypeVar

from mckibben.metrics import useful

CONSTANT = "constant"
"""Name of the row that predicts the mean of the training output, whatever the input: never chosen."""

CAUTION = 2.0
"""Factor on the ranking error of a model that is reliable only near its training data, or whose error is
that of the fit.
"""

Against = Literal["validation", "test"]
"""The data on which no model is clearly better than the constant, so that none is recommended."""


class Ranked(Protocol):
    """A row of a ranking."""

    @property
    def reason(self) -> str | None:
        """Reason of a failure, or None."""

    @property
    def skill_least(self) -> float | None:
        """Lower bound of the skill over the constant in the cross-validation."""

    @property
    def test_error(self) -> float:
        """RMSE on the test data, infinite if there is none."""


R = TypeVar("R", bound=Ranked)


def order(
    model: str,
    validated: float | None,
    fitted: float | None,
    skill_least: float | None = None,
    *,
    doubted: bool = False,
) -> tuple[bool, bool, float, str]:
    """Return the sort key of models: validated ones first, by their error; independent of the test.

    The others are sorted by the error on the data fitted. Those that are known to be no better than the
    constant come last. Parts of the same motion cannot show how a model extrapolates, so a doubted error
    counts `CAUTION` times.
    """
    error = fitted if validated is None else validated
    counted = float("inf") if error is None else error * (CAUTION if doubted else 1.0)
    idle = skill_least is not None and not skill_least > 0
    return validated is None, idle, counted, model


def recommended(rows: Sequence[R], constant: Ranked | None) -> tuple[R | None, Against | None]:
    """Return the recommended model, or None and the data on which it is no better than the constant.

    It is the first in the order of the choice that beats the constant in the cross-validation beyond
    chance. The test does not choose, but it may take the recommendation away: no other is chosen in
    its place, since that would be a choice by the test. Without the constant's row, the first that did
    not fail is recommended.
    """
    working = [row for row in rows if row.reason is None]
    if not working:
        return None, None
    skills = [row.skill_least for row in working if row.skill_least is not None]
    if skills and max(skills) <= 0:
        return None, "validation"
    first = next((row for row in working if (row.skill_least or 0.0) > 0), working[0])
    return (None, "test") if constant and not _beats(first, constant) else (first, None)


def acceptable(row: Ranked, constant: Ranked | None) -> bool:
    """Return whether a row has no known defect compared with a recommended one."""
    if row.reason is not None or constant is None:
        return row.reason is None
    return (row.skill_least is None or row.skill_least > 0) and _beats(row, constant)


def _beats(row: Ranked, constant: Ranked) -> bool:
    return useful(row.test_error, constant.test_error)


BAD_PART = 3.0
"""Error on a part, relative to the cross-validated error, above which it is bad."""

FEWEST_PARTS = 3
"""Smallest number of parts on which two models are compared."""

LEVEL = 0.95
"""Confidence level of the interval of two models' ratio of errors."""

Validated = Literal["step", "given", "fit"]
"""How the error on a part was found; see `Row`."""


@dataclass(frozen=True)
class Row(Numbers):
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
        Free-running scores, in the unit of the output. Of several outputs, the means of theirs, and the
        largest of their largest errors.
    outputs : mapping of str to Scores
        Those on the test data, of every output.
    validation_rmse : float or None
        Cross-validated RMSE, by which models are chosen: the geometric mean over parts that are left out
        in turn, of several outputs their mean; None where that failed, or there are too few data.
    validation_by_output : mapping of str to float
        The same of every output.
    validation_by_part : tuple of float
        RMSE on every part, of several outputs their mean.
    validation_failed : str or None
        Why the cross-validation failed, or None.
    validated : {"step", "given", "fit"}
        How these errors were found: of the model as it would be without the part; on validation
        recordings; or, of a model with too many parameters for a step, of the fit to all, and counted
        `CAUTION` times.
    caution : str or None
        Why the model is reliable only near its training data, or None.
    skill, skill_least : float or None
        Share of the constant's squared error that the model removes in the cross-validation, and what
        99 % of resamples of its pieces exceed.
    memory : Memory or None
        The memory test, on the test set.
    band : TestedBand or None
        Its band, the share of the test inside, and whether it is known; of the chosen model.
    block, banded : Block or None
        The model identified, and with that band if it is known.
    diagnostics : mapping
        What the estimator reports of the fit.
    test_rank : int or None
        Place by test RMSE, from 1; nothing is chosen by it.
    rmse_interval : (float, float) or None
        95 % moving-block bootstrap interval of the test RMSE.
    difference_interval : (float, float) or None
        Of its test RMSE less the chosen model's, paired on the same blocks; the intervals of all models
        hold at once in 95 %.
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
    validation_by_part: tuple[float, ...] = ()
    validation_failed: str | None = None
    validated: Validated = "step"
    caution: str | None = None
    skill: float | None = None
    skill_least: float | None = None
    memory: Memory | None = None
    band: TestedBand | None = None
    block: Block | None = field(default=None, repr=False)
    banded: Block | None = field(default=None, repr=False)
    diagnostics: Mapping[str, Any] = field(default_factory=dict, repr=False)
    test_rank: int | None = None
    rmse_interval: tuple[float, float] | None = None
    difference_interval: tuple[float, float] | None = None

    @property
    def sound(self) -> bool:
        """Whether there is a model with finite scores."""
        has_model = self.reason is None and self.block is not None
        scores = [side.rmse for side in (self.train, self.test) if side is not None]
        return has_model and len(scores) == 2 and bool(np.isfinite(scores).all())

    @property
    def test_error(self) -> float:
        """RMSE on the test data, infinite if there is none."""
        return float("inf") if self.test is None else self.test.rmse

    @property
    def chosen_by(self) -> float:
        """The error used for the choice: cross-validated, else of the fit."""
        fitted = float("inf") if self.train is None else self.train.rmse
        return fitted if self.validation_rmse is None else self.validation_rmse

    @property
    def order(self) -> tuple[bool, bool, float, str]:
        """Sort key of the row."""
        fitted = None if self.train is None else self.train.rmse
        return order(
            self.model, self.validation_rmse, fitted, self.skill_least, doubted=self.doubted
        )

    @property
    def doubted(self) -> bool:
        """Whether the error counts `CAUTION` times in the choice."""
        too_large = self.validated == "fit" and bool(self.validation_by_part)
        return self.caution is not None or too_large

    @cached_property
    def inverse(self) -> Block | None:
        """The inverse of the model, or None."""
        try:
            return None if self.block is None else compensator(self.block)
        except MckibbenError:
            return None

    @property
    def level(self) -> bool:
        """Whether the interval of the difference to the chosen model contains 0."""
        ends = self.difference_interval
        return self.reason is None and ends is not None and ends[0] <= 0 <= ends[1]

    def to_dict(self) -> dict[str, Any]:
        """Return the row as in the leaderboard files."""
        if self.reason is not None:
            return {"model": self.model, "status": "failed", "reason": self.reason}
        test = None
        if self.test is not None:
            test = plain(self.test) | {
                "rank": self.test_rank,
                "rmse_interval": plain(self.rmse_interval),
                "difference_to_chosen_interval": plain(self.difference_interval),
                "level_with_chosen": self.level,
            }
        copied = (
            *("n_parameters", "fit_seconds", "step_ns", "train", "validation_rmse"),
            *("validation_by_part", "validation_failed", "validated", "skill", "skill_least"),
            *("memory", "band", "caution", "doubted"),
        )
        return {
            "model": self.model,
            "status": "baseline" if self.model == CONSTANT else "ok",
            **{name: plain(getattr(self, name)) for name in copied},
            "test": test,
            "outputs": {
                name: plain(scores) | {"validation_rmse": self.validation_by_output.get(name)}
                for name, scores in self.outputs.items()
            },
            "rate_dependent": self.block is not None and bool(self.block.rate_dependent),
            "invertible": self.inverse is not None,
            "inverse": inverse_of(self.inverse),
        }


def inverse_of(inverse: Block | None) -> Literal["exact", "solved", "none"]:
    """Return the kind of inverse: closed form, solved in every step, or none."""
    if inverse is None:
        return "none"
    return "solved" if _solves(inverse) else "exact"


def _solves(block: Block) -> bool:
    if isinstance(block, Inverse):
        return block.forward.solved
    parts = [getattr(block, name, None) for name in block.parameters]
    nested = [part for value in parts for part in (value if isinstance(value, tuple) else (value,))]
    return any(_solves(part) for part in nested if isinstance(part, Block))


@dataclass(frozen=True)
class Doubt(Numbers):
    """What is doubtful, and the data that would decide.

    Parameters
    ----------
    kind : {"test", "part", "level"}
        Another model is better on the test, beyond its interval; the chosen model is bad on one part; or
        another one is level with it in the cross-validation.
    model : str
        That model: another one, or of a bad part the chosen one.
    ratio : float
        Error of the chosen model over the other's on the test; of a bad part, over its cross-validated
        error; of a level model, its error over the chosen one's in the cross-validation, as they count
        in the choice.
    interval : (float, float) or None
        95 % interval of the last.
    spans : tuple of Span
        The bad part, or that on which two level models differ most; empty where the test is meant.
    """

    kind: Literal["test", "part", "level"]
    model: str
    ratio: float
    interval: tuple[float, float] | None = None
    spans: tuple[Span, ...] = ()


@dataclass(frozen=True, repr=False)
class Leaderboard(Simulates, Result):
    """Models chosen on training data, and their errors on independent test data.

    Parameters
    ----------
    inputs, outputs : tuple of str
        Channels.
    unit : str
        Unit of the outputs and of every RMSE.
    rows : tuple of Row
        In the order of the choice; models that failed last.
    split : str
        What was used to fit, to choose, and to test.
    seed : int
        The seed of everything random.
    n_train, n_test : int
        Samples.
    chosen_by : {"cross-validation", "given", "fit"}
        What the model is chosen by: parts of the training data left out in turn, recordings given for
        it, or, for want of these, the error on the data fitted; never the test.
    left_out : mapping of str to str
        Models that were not asked for by name and do not apply to these channels, and why.
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
    loads : tuple of str
        Further input channels of models, which are never commanded.
    offered : tuple of str
        Further input channels of the models that can take them.
    ignored : tuple of str
        Channels that vary in the recordings and that no model is given.
    outside : mapping of str to float
        Channel to the share of the samples tested on that are outside of its range in training.
    parts : tuple of tuple of Span
        What is left out in turn to choose, in the order of ``validation_by_part``.
    """

    face: ClassVar[str] = "leaderboard"

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    unit: str
    rows: tuple[Row, ...]
    split: str
    n_train: int
    n_test: int
    seed: int = 0
    chosen_by: str = "cross-validation"
    left_out: Mapping[str, str] = field(default_factory=dict)
    pending: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    stopped: bool = False
    constant: Row | None = None
    shared: tuple[str, ...] = ()
    loads: tuple[str, ...] = ()
    offered: tuple[str, ...] = ()
    ignored: tuple[str, ...] = ()
    outside: Mapping[str, float] = field(default_factory=dict)
    parts: tuple[tuple[Span, ...], ...] = ()

    @property
    def input(self) -> str:
        """The input, or all inputs."""
        return ", ".join(self.inputs)

    @property
    def output(self) -> str:
        """The output, or all outputs."""
        return ", ".join(self.outputs)

    @property
    def best(self) -> Row | None:
        """The chosen model, or None if none is recommended; see `recommended`.

        It has the least cross-validated error on the training side. One whose cross-validation failed
        is chosen only if every other's did. The test has no part in it, except that nothing is
        recommended where the choice is no better there than the constant.
        """
        return recommended(self.rows, self.constant)[0]

    @property
    def model(self) -> Block:
        """The chosen model, fitted to the training recordings.

        Raises
        ------
        ModelError
            If none is recommended.
        """
        best = self.best
        if best is None or best.block is None:
            problem = "no model is recommended"
            raise ModelError(problem, remedy="see the rows, each with its error and its block")
        return best.block

    @property
    def failed(self) -> bool:
        """Whether no model worked."""
        return bool(self.rows) and sum(map(len, self.failures.values())) == len(self.rows)

    @property
    def not_recommended(self) -> Against | None:
        """The data on which no model is better than the constant, so that none is recommended."""
        return recommended(self.rows, self.constant)[1]

    @cached_property
    def doubts(self) -> tuple[Doubt, ...]:
        """What is doubtful about the choice, most important first; empty without a choice."""
        best = self.best
        if best is None:
            return ()
        return doubts_of(best, [row for row in self.rows if row is not best], self.parts)

    @property
    def level(self) -> tuple[str, ...]:
        """The models that the test does not distinguish from the chosen one."""
        best = self.best
        return tuple(r.model for r in self.rows if best is not None and r is not best and r.level)

    @property
    def ranking(self) -> tuple[Row, ...]:
        """The rows including the constant, which follows all models known to be better."""
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
        """Every distinct reason of failure, with the models."""
        models_by_reason: dict[str, list[str]] = {}
        for row in self.rows:
            if row.reason is not None or row.test is None or row.train is None:
                models_by_reason.setdefault(row.reason or "no scores", []).append(row.model)
        return models_by_reason

    @property
    def lowest(self) -> Row | None:
        """The row of lowest test error (not a basis for the choice), or None."""
        tested = [row for row in self.rows if row.test is not None]
        return min(tested, key=lambda row: row.test_error, default=None)

    def to_dict(self) -> dict[str, Any]:
        """Return the leaderboard as in ``leaderboard.json``."""
        best, lowest = self.best, self.lowest
        copied = (
            *(
                "loads",
                "unit",
                "split",
                "seed",
                "n_train",
                "n_test",
                "chosen_by",
                "not_recommended",
            ),
            *("doubts", "left_out", "pending", "notes", "shared", "offered", "ignored", "outside"),
        )
        return {
            "input": self.inputs[0] if len(self.inputs) == 1 else list(self.inputs),
            "output": self.outputs[0] if len(self.outputs) == 1 else list(self.outputs),
            **{name: plain(getattr(self, name)) for name in copied},
            "chosen": None if best is None else best.model,
            "lowest_on_test": None if lowest is None else lowest.model,
            "rows": [row.to_dict() for row in self.ranking],
        }

    def to_frame(self) -> pd.DataFrame:
        """Return the leaderboard as a table, one row per model, nested names joined by dots.

        Where tests are shared with training, a column says so.
        """
        import pandas as pd

        rows = [row.to_dict() for row in self.ranking]
        table = pd.json_normalize(
            [{key: row[key] for key in row if key != "validation_by_part"} for row in rows]
        )
        return table.assign(shared=" ".join(self.shared)) if self.shared else table


def doubts_of(
    best: Row, others: Sequence[Row], parts: Sequence[tuple[Span, ...]]
) -> tuple[Doubt, ...]:
    """Return what is doubtful about a choice, most important first.

    The others are in the order of the choice, the parts those of the cross-validation.
    """
    sound = [row for row in others if row.sound]
    doubts = []
    better_on_test = [
        r for r in sound if r.difference_interval is not None and r.difference_interval[1] < 0
    ]
    if better_on_test:
        better = min(better_on_test, key=lambda row: row.test_error)
        doubts.append(Doubt("test", better.model, best.test_error / better.test_error))
    errors = np.array(best.validation_by_part)
    if best.validation_rmse and errors.size:
        worst = int(np.argmax(errors))
        ratio = float(errors[worst] / best.validation_rmse)
        if ratio > BAD_PART:
            doubts.append(Doubt("part", best.model, ratio, None, tuple(parts[worst])))
    second = next((row for row in sound if row.validation_rmse is not None), None)
    if second is not None and best.validation_rmse is not None and errors.size >= FEWEST_PARTS:
        ratios = np.log(_counted(second)) - np.log(_counted(best))
        half = half_interval(ratios, LEVEL)
        low, high = ratios.mean() - half, ratios.mean() + half
        if low <= 0:
            part = int(np.argmax(np.abs(ratios)))
            ends = float(np.exp(low)), float(np.exp(high))
            ratio = float(np.exp(ratios.mean()))
            doubts.append(Doubt("level", second.model, ratio, ends, tuple(parts[part])))
    return tuple(doubts)


def _counted(row: Row) -> Array:
    """Return the errors on all parts as they count in the choice."""
    smallest = np.finfo(float).tiny
    return np.asarray(
        np.maximum(row.validation_by_part, smallest) * (CAUTION if row.doubted else 1.0)
    )
