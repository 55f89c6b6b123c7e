"""What is modelled, the models on offer for it, and the jobs that fit, check and calibrate them."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from mckibben.app.jobs import Tell
from mckibben.app.workspace import Workspace
from mckibben.comparison.channels import Channels, dead_loads_told, loads_told
from mckibben.errors import DataError, ModelError
from mckibben.numerals import numeral
from mckibben.recording import Recording

FOLDS = 6
"""Fits of a model: one, and those of its cross-validation."""

LEAST = 2000
"""Samples below which a fit gets no quicker."""

Json = dict[str, Any]


def sides_of(
    workspace: Workspace, inputs: Sequence[str], outputs: Sequence[str], load: str = ""
) -> Channels:
    """Return what is modelled: a load is the one named, else what schedules by its name."""
    recordings = workspace.with_role("train") or list(workspace.used().values())
    if load:
        return Channels(tuple(inputs), tuple(outputs), (load,))
    found = loads_told(recordings, Channels(tuple(inputs), tuple(outputs)))
    return dead_loads_told(recordings, found)


def comparable(workspace: Workspace, sides: Channels) -> list[Json]:
    """Return the results of models of these channels, best first: other errors do not compare."""
    named = ", ".join(sides.inputs), ", ".join(sides.outputs), (sides.scheduling or ("",))[0]
    return [
        row
        for row in workspace.results()
        if (row.get("input", ""), row.get("output", ""), row.get("load", "")) == named
    ]


def against(results: Sequence[Json]) -> str:
    """Return why no model of these is recommended; empty where one is."""
    from mckibben.comparison.choosing import recommended
    from mckibben.report.words import not_recommended

    current = [row for row in results if row["current"] and row.get("constant")]
    if not current:
        return ""
    first = current[0]
    where = recommended([_Judged(row) for row in current], _Judged(first["constant"]))[1]
    return "" if where is None else not_recommended(where, first, first["constant"], first["unit"])


class _Judged:
    """A result as `recommended` judges it."""

    reason = None

    def __init__(self, row: Json) -> None:
        self.skill_least: float | None = row.get("skill_least")
        error = (row.get("test") or {}).get("rmse")
        self.test_error = float("inf") if error is None else float(error)


# -- what is on offer ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Offer:
    """A model that applies.

    Parameters
    ----------
    model, title : str
        Short and full name.
    need, about : str
        What it is for, as a title and in a sentence.
    can : str
        What it represents.
    usual : bool
        Whether it belongs to the quick choice.
    caution : str or None
        Why it is good only near its training.
    inverse : str
        How it is inverted.
    seconds : float
        About how long a fit takes, with its cross-validation.
    """

    model: str
    title: str
    need: str
    about: str
    can: str
    usual: bool
    caution: str | None
    inverse: str
    seconds: float


@dataclass(frozen=True)
class Offered:
    """The models that apply to the recordings; the others by full name, and why not; what is tested."""

    offers: tuple[Offer, ...]
    others: dict[str, str]
    split: str

    @property
    def quick(self) -> list[str]:
        """The models of the quick choice."""
        return [one.model for one in self.offers if one.usual]


def offered(workspace: Workspace, sides: Channels) -> Offered:
    """Return the models for what is modelled, by need, those tried first to the front.

    Raises
    ------
    DataError
        Where nothing can be fitted to the recordings as they are.
    """
    from mckibben import registry
    from mckibben.comparison.planning import objections
    from mckibben.comparison.splits import split_of
    from mckibben.estimators.catalogue import ability, declared, full_name, needs
    from mckibben.estimators.core.data import training_data

    train, test = workspace.with_role("train"), workspace.with_role("test")
    if not train:
        raise DataError("there is no recording to train on", remedy="give one the role Train")
    training_data([*train, *test], sides.inputs, sides.outputs, one_rate=sides.single)
    names, described = registry.names("estimators"), ""
    fitted: Sequence[Recording] = train
    with suppress(DataError):  # too little to hold anything out: the fit will say so
        split = split_of(train, test, sides)
        fitted, described = split.train, split.described
    no = objections(names, [*train, *test], sides)
    no = objections([name for name in names if name not in no], fitted, sides) | no
    work = max(sum(map(len, train)), LEAST) * len(sides.inputs) * len(sides.outputs)
    offers = []
    for need in needs():
        for name in need.models:
            if name not in no:
                kind = declared(name)
                said = kind.caution, str(kind.inverse_kind), kind.effort * work / 10_000 * FOLDS
                about = full_name(name), need.title, need.about, ability(name)
                offers.append(Offer(name, *about, kind.quick, *said))
    return Offered(tuple(offers), {full_name(name): why for name, why in no.items()}, described)


def parts(workspace: Workspace, sides: Channels) -> dict[str, tuple[Recording, int | None, str]]:
    """Return the recordings that models are shown on, those tested on first.

    Each with its first sample that is tested on where it was fitted before that, and its use.
    """
    from mckibben.comparison.splits import split_of, tested_from

    train, test = workspace.with_role("train"), workspace.with_role("test")
    found: dict[str, tuple[Recording, int | None, str]] = {}
    with suppress(DataError):
        split = split_of(train, test, sides)
        for run, rows in zip(split.test, split.test_rows, strict=True):
            found[run.name] = run, tested_from(rows), "test"
    for run in [*test, *train]:
        found.setdefault(run.name, (run, None, "train"))
    return found


# -- jobs ------------------------------------------------------------------------------------------


def fit(
    workspace: Workspace,
    tell: Tell,
    *,
    model: str,
    inputs: list[str],
    outputs: list[str],
    load: str = "",
    settings: Json | None = None,
    allow_shared: bool = False,
    seed: int = 0,
) -> str:
    """Fit, validate and test a model as `mckibben.compare` does; a fit done again takes its place."""
    from mckibben.comparison.planning import plan_of
    from mckibben.comparison.ranking import ranked
    from mckibben.report.words import CHOICES

    data = workspace.digest()
    plan = plan_of(
        workspace.with_role("train"),
        workspace.with_role("test"),
        inputs=inputs,
        outputs=outputs,
        load=load or None,
        models=[model],
        settings={model: settings or {}},
        seed=seed,
        allow_shared=allow_shared,
        allow_early=True,  # with a note
    )
    plan = replace(plan, items={model: plan.items[model]})  # without those of each load alone
    kept = plan.kept(None)
    *_, ranking = ranked(plan, jobs=1, kept=kept, watch=lambda _, share, cost: tell(share, cost))
    board = ranking.board
    (row,) = board.rows
    if row.reason is not None or row.block is None:
        raise ModelError(row.reason or "it gave no model", remedy="try other settings")
    about = {
        "input": board.input,
        "output": board.output,
        "load": load,
        "settings": settings or {},
    }
    result = row.to_dict() | about
    result |= {
        "unit": board.unit,
        "split": board.split,
        "chosen_by": board.chosen_by,
        "constant": None if board.constant is None else board.constant.to_dict(),
        "not_recommended": board.not_recommended,
        "shared": list(board.shared),
        "notes": [*board.notes, *row.diagnostics.get("notes", ())],
        "data": data,
    }
    name = next(
        (
            name
            for name in workspace.names("results")
            for old in [workspace.read("results", name) or {}]
            if old.get("model") == model and all(old.get(key) == about[key] for key in about)
        ),
        None,
    ) or workspace.new_name("models", model)
    if row.banded is None:
        workspace.delete("banded", name)
    workspace.save_model(name, row.block, result, row.banded)
    error = row.chosen_by, row.test_error
    heading = CHOICES["fit" if row.validation_rmse is None else board.chosen_by][0]
    said = [f"{numeral(value, 3)} {board.unit}".strip() for value in error]
    return f"{heading} {said[0]}, test RMSE {said[1]}"


def calibrate(workspace: Workspace, tell: Tell, *, name: str) -> str:
    """Give a model the band that its errors on the test recordings ask for."""
    from mckibben.diagnosis.bands import calibration
    from mckibben.report import results, text

    tests = workspace.with_role("test")
    if not tests:
        raise DataError(
            "a band is calibrated on recordings that the model was not fitted to",
            remedy="give a recording the role Test",
        )
    train = workspace.with_role("train")
    banded, found = calibration(workspace.model(name), tests, "auto", train, tell)
    banded.save(workspace.path("banded", f"{name}.json"))
    said = [*text.lines(results.calibration(found)[:1])]
    _add(workspace, name, calibrated=said)
    return " ".join(said)


def check(workspace: Workspace, tell: Tell, *, name: str) -> str:
    """Test whether a model is right on the test recordings, or else on those of its training."""
    from mckibben.report.words import check_sentences, check_verdict
    from mckibben.workflow import check as checked

    tests, train = workspace.with_role("test"), workspace.with_role("train")
    on = "test" if tests else "train"
    try:
        found = checked(workspace.model(name), tests or train, progress=tell)
    except DataError:  # a short test tells too little
        if not (tests and train):
            raise
        on, found = "train", checked(workspace.model(name), train, progress=tell)
    verdict = check_verdict(found)
    said = {"on": on, "verdict": verdict, "sentences": check_sentences(found)}
    _add(workspace, name, check=said | {"data": workspace.digest()})
    return verdict


def _add(workspace: Workspace, name: str, **more: Any) -> None:
    workspace.write("results", name, (workspace.read("results", name) or {}) | more)


def plan(
    workspace: Workspace,
    tell: Tell,
    *,
    minutes: float = 3.0,
    limits: dict[str, list[float | None]] | None = None,
    seed: int = 0,
) -> str:
    """Plan what to record next, and write its commands as a file of inputs over time."""
    from mckibben.report.words import plan_sentences
    from mckibben.workflow import plan as planned

    recordings = [*workspace.with_role("train"), *workspace.with_role("test")]
    own = {name: tuple(ends) for name, ends in (limits or {}).items()}
    found = planned(
        recordings, out=_commands(workspace), force=True, minutes=minutes, limits=own, seed=seed
    )
    said = plan_sentences(found)
    workspace.write("takeaway", PLAN, {"sentences": said, "minutes": minutes})
    return said[0]


PLAN = "next-recording"
"""Name of the plan among the files to take away."""


def _commands(workspace: Workspace) -> Path:
    return workspace.path("takeaway", f"{PLAN}.csv")


def last_plan(workspace: Workspace) -> tuple[Json, Path] | None:
    """Return what the last plan does, and the file of its commands."""
    said, path = workspace.read("takeaway", PLAN), _commands(workspace)
    return (said, path) if said and path.is_file() else None
