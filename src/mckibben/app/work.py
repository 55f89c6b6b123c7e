"""What the workbench does in processes of its own: calls of the library, and their results as files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from mckibben.app.following import Tell, estimate, look_back, loop
from mckibben.app.workspace import Workspace
from mckibben.errors import DataError, ModelError

TRAINED_ON = "On training recordings, which it was fitted to:"
"""Where there is nothing else to judge by."""


def fit(workspace: Workspace, given: dict[str, Any], tell: Tell) -> str:
    """Fit, validate and test a model as `mckibben.compare` does, and keep it with its figures."""
    from mckibben.comparison.planning import plan_of
    from mckibben.comparison.ranking import ranked
    from mckibben.report.words import CHOICES

    entries = workspace.entries()
    train, test = workspace.with_role("train", entries), workspace.with_role("test", entries)
    if not train:
        raise DataError("there is no recording to train on", remedy="give one the role 'train'")
    model, data = str(given["model"]), workspace.data(entries)
    plan = plan_of(
        train,
        test,
        inputs=given["input"],
        outputs=given["output"],
        load=given.get("load"),
        models=[model],
        settings={model: given.get("settings", {})},
        seed=int(given.get("seed", 0)),
        allow_shared=bool(given.get("allow_shared", False)),
        allow_early=True,  # with a note
    )
    plan = replace(plan, items={model: plan.items[model]})  # without those of each load alone
    (ranking,) = ranked(
        plan, jobs=1, kept=plan.kept(None), watch=lambda _, share, cost: tell(share, cost)
    )
    board = ranking.board
    (row,) = board.rows
    if row.reason is not None or row.block is None:
        raise ModelError(row.reason or "it gave no model", remedy="try other settings")
    name = str(given["name"])
    row.block.save(workspace.path("models", f"{name}.json"))
    banded = workspace.path("banded", f"{name}.json")  # with which it scatters as a plant
    if row.banded is None:
        banded.unlink(missing_ok=True)
    else:
        row.banded.save(banded)
    result = row.to_dict() | {
        "input": board.input,
        "output": board.output,
        "load": given.get("load") or "",
        "unit": board.unit,
        "split": board.split,
        "chosen_by": board.chosen_by,
        "constant": None if board.constant is None else board.constant.to_dict(),
        "not_recommended": board.not_recommended,
        "shared": list(board.shared),
        "settings": given.get("settings", {}),
        "data": data,
        "call": given.get("call", ""),
    }
    workspace.write_json("results", name, result)
    heading = CHOICES[board.chosen_by][0]
    validated = "none" if row.validation_rmse is None else f"{row.validation_rmse:.4g} {board.unit}"
    tested = "none" if row.test is None else f"{row.test.rmse:.4g} {board.unit}"
    doubt = ["not recommended: see the leaderboard"] if board.not_recommended else []
    return ". ".join([f"{heading} {validated}, test RMSE {tested}", *doubt, *board.shared])


def report(workspace: Workspace, given: dict[str, Any], tell: Tell) -> str:
    """Study the recordings with chosen models, and write the report."""
    from mckibben.report import write_report
    from mckibben.workflow import study

    found = study(
        workspace.with_role("train"),
        workspace.with_role("test"),
        inputs=given["input"],
        outputs=given["output"],
        load=given.get("load"),
        models=given["models"],
        settings=given.get("settings") or {},
        seed=int(given.get("seed", 0)),
        jobs=1,
        allow_shared=bool(given.get("allow_shared", False)),
        allow_early=True,  # with a note
        progress=lambda share, _: tell(share, float("nan")),
    )
    path = workspace.path("takeaway", "report.html")
    write_report(found, path)
    return f"written: {path}"


def check(workspace: Workspace, given: dict[str, Any], tell: Tell) -> str:
    """Judge a model by the test recordings, or else the training ones, and write the page."""
    from mckibben.report.check_page import check_page
    from mckibben.report.words import check_sentences, check_verdict
    from mckibben.system.atomic import write_text
    from mckibben.workflow import check as judged

    name = str(given["name"])
    model = workspace.model(name)
    tests, train = workspace.with_role("test"), workspace.with_role("train")
    if not tests and not train:
        raise DataError("there is no recording to judge by", remedy="add one under Data")
    recordings, on = (tests, "On test recordings:") if tests else (train, TRAINED_ON)
    try:
        found = judged(model, recordings)
    except DataError as error:  # a short test tells too little
        if not tests or not train:
            raise
        recordings, on = train, f"Test recordings tell too little: {error} {TRAINED_ON}"
        found = judged(model, recordings)
    tell(0.6, float("nan"))
    page = check_page(found, f"models/{name}.json")
    write_text(workspace.new_path("takeaway", str(given["file"])), page)
    return " ".join([on, check_verdict(found), *check_sentences(found)])


def plan(workspace: Workspace, given: dict[str, Any], tell: Tell) -> str:
    """Plan what to record next, and write it as a file of inputs over time."""
    from mckibben.report.words import plan_sentences
    from mckibben.workflow import plan as planned

    name = str(given.get("name") or "")
    found = planned(
        [*workspace.with_role("train"), *workspace.with_role("test")],
        model=workspace.model(name) if name else None,
        minutes=float(given.get("minutes", 3.0)),
        seed=int(given.get("seed", 0)),
        out=workspace.new_path("takeaway", str(given["file"])),
    )
    tell(1.0, float("nan"))
    return " ".join(plan_sentences(found))


def record(workspace: Workspace, given: dict[str, Any], tell: Tell) -> str:
    """Run one run of a protocol on a virtual rig, and keep the recording."""
    from mckibben.rigs import load_rig
    from mckibben.rigs import record as record_runs
    from mckibben.signals.protocol import protocol

    plan = protocol(given["protocol"])
    runs = list(given["runs"])
    rig = load_rig(given.get("rig") or plan.rig)
    recorded = record_runs(plan, rig, runs=runs, seed=int(given.get("seed", 0)), jobs=1)
    with workspace.adding(f"record {plan.name}") as added:
        for done, (run, recording) in enumerate(recorded, start=1):
            entry = workspace.add(
                recording,
                origin=f"rig {rig.name}, protocol {plan.name}, run {run.name}",
                call=given.get("call", ""),
                role=run.role if run.role in ("train", "test") else "train",
                name=run.name,
            )
            added.append(entry.name)
            tell(done / len(runs), float("nan"))
    return f"{len(runs)} recording(s)"


WORK: dict[str, Callable[[Workspace, dict[str, Any], Tell], str]] = {
    "check": check,
    "fit": fit,
    "force": estimate,
    "loop": loop,
    "plan": plan,
    "record": record,
    "report": report,
    "review": look_back,
}
"""Kinds of jobs."""
