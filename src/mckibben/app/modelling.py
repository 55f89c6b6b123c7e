"""What is modelled, the models on offer for it, and the jobs that fit, check and plan."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from mckibben import registry, workflow
from mckibben.app.jobs import Tell
from mckibben.app.workspace import Workspace
from mckibben.channels import Channels, channels_of
from mckibben.comparison.leaderboard import recommended
from mckibben.comparison.planning import Candidate, objections, plan_of
from mckibben.comparison.ranking import ranked
from mckibben.errors import DataError, ModelError
from mckibben.estimators.catalogue import Need, declared, full_name, needs
from mckibben.estimators.core.data import training_data
from mckibben.numerals import numeral
from mckibben.recording import Recording
from mckibben.report import results, words
from mckibben.report.builder import Figure, Item, Table, Text
from mckibben.splits import split_of, tested_from
from mckibben.studying.inverting import compensation

TIME_WITH_VALIDATION = 1.2
"""Time of a fit with its cross-validation, relative to that of the fit."""

FEWEST_SAMPLES = 2000
"""Samples below which a fit gets no quicker."""

PLAN = "next-recording"
"""Name of the plan among the files to take away."""

Json = dict[str, Any]


def sides_of(
    workspace: Workspace, inputs: Sequence[str], outputs: Sequence[str], load: str = ""
) -> Channels:
    """Return what is modelled, as `compare` of these channels does."""
    if not (inputs and outputs):
        return Channels(tuple(inputs), tuple(outputs))
    recordings = workspace.with_role("train") or list(workspace.used().values())
    return channels_of(recordings, inputs, outputs, load or None)


def comparable(workspace: Workspace, sides: Channels) -> list[Json]:
    """Return the results of models of these channels, best first: other errors do not compare."""
    named = tuple(map(", ".join, (sides.inputs, sides.outputs, sides.scheduling)))
    keys = ("input", "output", "load")
    return [row for row in workspace.results() if tuple(row.get(key, "") for key in keys) == named]


def against(rows: Sequence[Json]) -> str:
    """Return why no model of these is recommended; empty where one is."""

    def as_scores(row: Json) -> Any:
        error = (row.get("test") or {}).get("rmse", float("inf"))
        return SimpleNamespace(reason=None, skill_least=row.get("skill_least"), test_error=error)

    current = [row for row in rows if row["current"] and row.get("constant")]
    for first in current[:1]:
        mean = first["constant"]
        problem = recommended([*map(as_scores, current)], as_scores(mean))[1]
        if problem is not None:
            return words.not_recommended(problem, first, mean, first["unit"])
    return ""


@dataclass(frozen=True)
class Offered:
    """The models that apply to the recordings by what they are for, and why the others do not."""

    needs: tuple[Need, ...]
    others: dict[str, str]
    split: str  # what is fitted to, and tested on
    work: float  # samples of a fit with its cross-validation, times inputs and outputs

    @property
    def models(self) -> list[str]:
        """All that apply."""
        return [name for need in self.needs for name in need.models]

    @property
    def quick(self) -> list[str]:
        """The models of the quick choice."""
        return [name for name in self.models if declared(name).quick]

    def seconds(self, model: str) -> float:
        """Return about how long a fit takes."""
        return declared(model).effort * self.work / 10_000


def offered(workspace: Workspace, sides: Channels) -> Offered:
    """Return the models for what is modelled.

    Raises
    ------
    DataError
        Where nothing can be fitted to the recordings as they are.
    """
    if not (sides.inputs and sides.outputs):
        problem = "no input, or no output, of all recordings in use is chosen"
        remedy = "choose them under Data, or set recordings without them to Unused"
        raise DataError(problem, remedy=remedy)
    train, test = workspace.train_and_test()
    if not train:
        raise DataError("there is no recording to train on", remedy="give one the role Train")
    training_data([*train, *test], sides.inputs, sides.outputs, one_rate=sides.single)
    names, described = registry.names("estimators"), ""
    fitted: Sequence[Recording] = train
    with suppress(DataError):  # too little to hold anything out: the fit will say so
        split = split_of(train, test, sides)
        fitted, described = split.train, split.described
    items = {name: Candidate(name) for name in names}
    reasons = objections(items, [*train, *test], sides)
    reasons |= objections(
        {name: item for name, item in items.items() if name not in reasons}, fitted, sides
    )
    remaining = (
        replace(need, models=tuple(model for model in need.models if model not in reasons))
        for need in needs()
    )
    others = {full_name(name): why for name, why in reasons.items()}
    work = (
        max(sum(map(len, train)), FEWEST_SAMPLES)
        * len(sides.inputs)
        * len(sides.outputs)
        * TIME_WITH_VALIDATION
    )
    return Offered(tuple(need for need in remaining if need.models), others, described, work)


def parts(workspace: Workspace, sides: Channels) -> dict[str, tuple[Recording, int | None, str]]:
    """Return the recordings that models are shown on, those tested on first.

    Each with its first sample that is tested on where it was fitted before that, and its use.
    """
    train, test = workspace.train_and_test()
    runs: dict[str, tuple[Recording, int | None, str]] = {}
    with suppress(DataError):
        split = split_of(train, test, sides)
        for run, rows in zip(split.test, split.test_rows, strict=True):
            runs[run.name] = run, tested_from(rows), "test"
    return runs | {
        run.name: (run, None, "train") for run in [*test, *train] if run.name not in runs
    }


# -- jobs ------------------------------------------------------------------------------------------


def fit(
    workspace: Workspace,
    tell: Tell,
    *,
    model: str,
    inputs: list[str],
    outputs: list[str],
    load: str = "",
    allow_shared: bool = False,
    seed: int = 0,
) -> str:
    """Fit, validate and test a model as `mckibben.compare` does, in place of one on the same data."""
    (train, test), data = workspace.train_and_test(), workspace.digest()
    plan = plan_of(
        *(train, test),
        input=inputs, output=outputs, load=load or None, models=[model],
        seed=seed, allow_shared=allow_shared,
    )  # fmt: skip
    *_, last = ranked(plan, jobs=1, watch=lambda _, share, cost: tell(share, cost))
    board, (row,) = last.board, last.board.rows
    if row.reason is not None or row.block is None:
        raise ModelError((row.reason or "it gave no model: try other settings").rstrip("."))
    about: Json = {"model": model, "input": board.input, "output": board.output, "data": data}
    about["load"] = ", ".join(board.loads)
    earlier = {name: workspace.read("results", name) or {} for name in workspace.names("results")}
    same_names = (
        n for n, result in earlier.items() if all(result.get(key) == about[key] for key in about)
    )
    name = next(same_names, None) or workspace.new_name("models", model)
    board_numbers = board.to_dict()
    copied = ("unit", "split", "chosen_by", "not_recommended", "shared")
    numbers = {key: board_numbers[key] for key in copied}
    numbers["constant"] = None if board.constant is None else board.constant.to_dict()
    compensator, refusals = compensation(board, plan.data.split, seed)
    numbers["compensator"] = None if compensator is None else compensator.to_dict()
    numbers["no_compensator"] = refusals.get(row.model, "")
    numbers["notes"] = [*board.notes, *row.diagnostics.get("notes", ())]
    workspace.save_model(name, row.block, row.to_dict() | about | numbers)
    chosen_by = "fit" if row.validation_rmse is None else board.chosen_by
    errors = [f"{numeral(x, 3)} {board.unit}".strip() for x in (row.chosen_by, row.test_error)]
    return f"{words.CHOICES[chosen_by][0]} {errors[0]}, test RMSE {errors[1]}"


def check(workspace: Workspace, tell: Tell, *, name: str) -> str:
    """Test whether a model is right on the test recordings, or else on those of its training."""
    train, tests = workspace.train_and_test()
    role = "test" if tests else "train"
    try:
        validation = workflow.check(workspace.model(name), tests or train, progress=tell)
    except DataError:  # a short test tells too little
        if not (tests and train):
            raise
        role, validation = "train", workflow.check(workspace.model(name), train, progress=tell)
    return _add(workspace, name, "check", results.check(validation), role)


def _add(workspace: Workspace, name: str, what: str, items: Sequence[Item], on: str) -> str:
    """Write what is shown of a model beside the results of its fit; return its first sentence."""
    more = {"items": stored_items(items), "on": on, "data": workspace.digest()}
    workspace.write("results", name, (workspace.read("results", name) or {}) | {what: more})
    return next(one.sentences[0] for one in items if isinstance(one, Text))


def plan(workspace: Workspace, tell: Tell, **options: Any) -> str:
    """Plan what to record next, and write its commands as a file of inputs over time."""
    train, test = workspace.train_and_test()
    out = workspace.path("takeaway", f"{PLAN}.csv")
    experiment = workflow.plan([*train, *test], out=out, force=True, **options)
    workspace.write("takeaway", PLAN, {"items": stored_items(results.plan(experiment))})
    return words.plan_sentences(experiment)[0]


def last_plan(workspace: Workspace) -> tuple[Json, Path] | None:
    """Return the last plan, and the file of its commands."""
    content, path = workspace.read("takeaway", PLAN), workspace.path("takeaway", f"{PLAN}.csv")
    return (content, path) if content and path.is_file() else None


# -- what is shown of results, in files ------------------------------------------------------------

KINDS: Mapping[str, type[Text | Table | Figure]] = {"text": Text, "table": Table, "figure": Figure}


def stored_items(items: Iterable[Item]) -> list[Json]:
    """Return what is shown of a result as JSON."""
    return [asdict(item) for item in items if item is not None and item.kind in KINDS]


def restored(stored: Mapping[str, Any]) -> list[Item]:
    """Return what `stored_items` wrote."""
    try:
        return [KINDS[item["kind"]](**item) for item in stored["items"]]
    except (KeyError, TypeError):
        raise DataError("its file is damaged", remedy="do it again") from None
