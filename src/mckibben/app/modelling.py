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

VALIDATED = 1.2
"""Time of a fit with its cross-validation, relative to that of the fit."""

LEAST = 2000
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
    told = ("input", "output", "load")
    return [r for r in workspace.results() if tuple(r.get(key, "") for key in told) == named]


def against(rows: Sequence[Json]) -> str:
    """Return why no model of these is recommended; empty where one is."""

    def judged(row: Json) -> Any:
        error = (row.get("test") or {}).get("rmse", float("inf"))
        return SimpleNamespace(reason=None, skill_least=row.get("skill_least"), test_error=error)

    current = [row for row in rows if row["current"] and row.get("constant")]
    for first in current[:1]:
        mean = first["constant"]
        where = recommended([*map(judged, current)], judged(mean))[1]
        if where is not None:
            return words.not_recommended(where, first, mean, first["unit"])
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
    no = objections(items, [*train, *test], sides)
    no |= objections({n: item for n, item in items.items() if n not in no}, fitted, sides)
    left = (replace(n, models=tuple(m for m in n.models if m not in no)) for n in needs())
    others = {full_name(name): why for name, why in no.items()}
    work = max(sum(map(len, train)), LEAST) * len(sides.inputs) * len(sides.outputs) * VALIDATED
    return Offered(tuple(need for need in left if need.models), others, described, work)


def parts(workspace: Workspace, sides: Channels) -> dict[str, tuple[Recording, int | None, str]]:
    """Return the recordings that models are shown on, those tested on first.

    Each with its first sample that is tested on where it was fitted before that, and its use.
    """
    train, test = workspace.train_and_test()
    found: dict[str, tuple[Recording, int | None, str]] = {}
    with suppress(DataError):
        split = split_of(train, test, sides)
        for run, rows in zip(split.test, split.test_rows, strict=True):
            found[run.name] = run, tested_from(rows), "test"
    return found | {r.name: (r, None, "train") for r in [*test, *train] if r.name not in found}


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
    olds = {name: workspace.read("results", name) or {} for name in workspace.names("results")}
    same = (n for n, old in olds.items() if all(old.get(key) == about[key] for key in about))
    name = next(same, None) or workspace.new_name("models", model)
    whole = board.to_dict()
    copied = ("unit", "split", "chosen_by", "not_recommended", "shared")
    told = {key: whole[key] for key in copied}
    told["constant"] = None if board.constant is None else board.constant.to_dict()
    undone, refused = compensation(board, plan.data.split, seed)
    told["compensator"] = None if undone is None else undone.to_dict()
    told["no_compensator"] = refused.get(row.model, "")
    told["notes"] = [*board.notes, *row.diagnostics.get("notes", ())]
    workspace.save_model(name, row.block, row.to_dict() | about | told)
    by = "fit" if row.validation_rmse is None else board.chosen_by
    errors = [f"{numeral(x, 3)} {board.unit}".strip() for x in (row.chosen_by, row.test_error)]
    return f"{words.CHOICES[by][0]} {errors[0]}, test RMSE {errors[1]}"


def check(workspace: Workspace, tell: Tell, *, name: str) -> str:
    """Test whether a model is right on the test recordings, or else on those of its training."""
    train, tests = workspace.train_and_test()
    on = "test" if tests else "train"
    try:
        found = workflow.check(workspace.model(name), tests or train, progress=tell)
    except DataError:  # a short test tells too little
        if not (tests and train):
            raise
        on, found = "train", workflow.check(workspace.model(name), train, progress=tell)
    return _add(workspace, name, "check", results.check(found), on)


def _add(workspace: Workspace, name: str, what: str, items: Sequence[Item], on: str) -> str:
    """Write what is shown of a model beside the results of its fit; return its first sentence."""
    more = {"items": stored_items(items), "on": on, "data": workspace.digest()}
    workspace.write("results", name, (workspace.read("results", name) or {}) | {what: more})
    return next(one.sentences[0] for one in items if isinstance(one, Text))


def plan(workspace: Workspace, tell: Tell, **given: Any) -> str:
    """Plan what to record next, and write its commands as a file of inputs over time."""
    train, test = workspace.train_and_test()
    out = workspace.path("takeaway", f"{PLAN}.csv")
    found = workflow.plan([*train, *test], out=out, force=True, **given)
    workspace.write("takeaway", PLAN, {"items": stored_items(results.plan(found))})
    return words.plan_sentences(found)[0]


def last_plan(workspace: Workspace) -> tuple[Json, Path] | None:
    """Return the last plan, and the file of its commands."""
    said, path = workspace.read("takeaway", PLAN), workspace.path("takeaway", f"{PLAN}.csv")
    return (said, path) if said and path.is_file() else None


# -- what is shown of results, in files ------------------------------------------------------------

KINDS: Mapping[str, type[Text | Table | Figure]] = {"text": Text, "table": Table, "figure": Figure}


def stored_items(items: Iterable[Item]) -> list[Json]:
    """Return what is shown of a result as JSON."""
    return [asdict(one) for one in items if one is not None and one.kind in KINDS]


def restored(found: Mapping[str, Any]) -> list[Item]:
    """Return what `stored_items` wrote."""
    try:
        return [KINDS[one["kind"]](**one) for one in found["items"]]
    except (KeyError, TypeError):
        raise DataError("its file is damaged", remedy="do it again") from None
