"""What the workbench does in processes of its own: calls of the library, and their results as files."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from mckibben.app.workspace import Workspace
from mckibben.errors import DataError, ModelError, ModelWarning
from mckibben.recording import Recording

Tell = Callable[[float, float], None]
"""Told the share of the work that is done, and the least cost so far."""


def fit(workspace: Workspace, given: dict[str, Any], tell: Tell) -> str:
    """Fit, validate and test a model as `mckibben.compare` does, and keep it with its figures."""
    from mckibben.comparison.ranking import compare

    train, test = workspace.with_role("train"), workspace.with_role("test")
    if not train:
        raise DataError("there is no recording to train on", remedy="give one the role 'train'")
    model = str(given["model"])
    board = compare(
        train,
        test,
        inputs=given["input"],
        outputs=given["output"],
        models=[model],
        settings={model: given.get("settings", {})},
        seed=int(given.get("seed", 0)),
        jobs=1,
        allow_shared=bool(given.get("allow_shared", False)),
        watch=lambda _, share, cost: tell(share, cost),
    )
    (row,) = board.rows
    if row.reason is not None or row.block is None:
        raise ModelError(row.reason or "it gave no model. Remedy: try other settings.")
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
        "unit": board.unit,
        "split": board.split,
        "chosen_by": board.chosen_by,
        "constant": None if board.constant is None else board.constant.to_dict(),
        "not_recommended": board.not_recommended,
        "shared": list(board.shared),
        "settings": given.get("settings", {}),
        "call": given.get("call", ""),
    }
    workspace.write_json("results", name, result)
    validated = "none" if row.validation_rmse is None else f"{row.validation_rmse:.4g} {board.unit}"
    tested = "none" if row.test is None else f"{row.test.rmse:.4g} {board.unit}"
    told = [f"CV RMSE {validated}, test RMSE {tested}", board.not_recommended, *board.shared]
    return ". ".join(sentence for sentence in told if sentence)


def loop(workspace: Workspace, given: dict[str, Any], tell: Tell) -> str:
    """Let a controller follow a reference on a model or a virtual rig, and keep the recording."""
    from mckibben.blocks.core.block import Block
    from mckibben.control import before, control_law, track, tune_pid
    from mckibben.files import read, write
    from mckibben.rigs import load_rig

    inverse, own = workspace.model(given["model"]).inverse(), given.get("plant")
    plant = workspace.twin(own) if own else load_rig(given["rig"])
    (reference,) = read(workspace.path("runs", given["reference"]), informative=False)
    kind = given["controller"]
    step = reference.sample_time or 0.02
    controller = control_law(kind, inverse, lambda: tune_pid(plant, sample_time=step))
    found = track(
        controller, plant, reference, progress=lambda share: tell(0.5 * share, float("nan"))
    )
    without = before(
        inverse,
        plant,
        reference,
        progress=lambda share: tell(0.5 + 0.5 * share, float("nan")),
    )
    name = str(given["name"])
    recording = without.beside(found.recording).with_meta(name=name)
    write(recording, workspace.path("runs", f"{name}.csv"))
    errors = {channel: float(value) for channel, value in found.rmse.items()}
    workspace.write_json(
        "runs",
        name,
        {
            "model": given["model"],
            "rig": given.get("rig") or "",
            "plant": own or "",
            "controller": kind,
            "rmse": errors,
            "largest": {channel: float(value) for channel, value in found.largest.items()},
            "uncompensated": {} if without.tracked is None else dict(without.tracked.rmse),
            "notes": list(without.notes),
            "clipped": int(found.clipped),
            "step_us": 1e6 * float(found.step_time[0]),
            "call": given.get("call", ""),
        },
    )
    if isinstance(controller, Block):
        controller.save(workspace.path("models", f"{name}-controller.json"))
    return ", ".join(f"{channel} RMSE {value:.3g} mm" for channel, value in errors.items())


def report(workspace: Workspace, given: dict[str, Any], tell: Tell) -> str:
    """Study the recordings with chosen models, and write the report."""
    from mckibben.report import write_report
    from mckibben.studying.study import study

    found = study(
        workspace.with_role("train"),
        workspace.with_role("test"),
        inputs=given["input"],
        outputs=given["output"],
        models=given["models"],
        settings=given.get("settings") or None,
        seed=int(given.get("seed", 0)),
        jobs=1,
        allow_shared=bool(given.get("allow_shared", False)),
        progress=lambda standing: tell(standing.done / standing.total, float("nan")),
    )
    path = workspace.path("takeaway", "report.html")
    write_report(found, path)
    return f"written: {path}"


def record(workspace: Workspace, given: dict[str, Any], tell: Tell) -> str:
    """Run one run of a protocol on a virtual rig, and keep the recording."""
    from mckibben.rigs import load_rig
    from mckibben.rigs import record as record_runs
    from mckibben.signals.protocol import protocol

    plan = protocol(given["protocol"])
    runs = list(given["runs"])
    rig = load_rig(given.get("rig") or plan.rig)
    for done, (run, recording) in enumerate(
        record_runs(plan, rig, runs=runs, seed=int(given.get("seed", 0)), jobs=1), start=1
    ):
        role = run.role if run.role in ("train", "test") else "train"
        workspace.add(
            recording,
            origin=f"rig {rig.name}, protocol {plan.name}, run {run.name}",
            call=given.get("call", ""),
            role=role,
            name=run.name,
        )
        tell(done / len(runs), float("nan"))
    return f"{len(runs)} recording(s)"


def reference_recording(points: list[tuple[float, float]], step: float, channel: str) -> Recording:
    """Return straight lines through points of time [s] and displacement [mm].

    Raises
    ------
    DataError
        If there are fewer than two points, or their times do not increase.
    """
    if len(points) < 2:
        raise DataError("a reference needs two points or more", remedy="draw some")
    times, values = np.array(points, dtype=float).T
    if np.any(np.diff(times) <= 0) or not np.isfinite(values).all():
        raise DataError(
            "the times of the reference do not increase", remedy="give points from left to right"
        )
    if (times[-1] - times[0]) / step > 1_000_000:
        raise DataError("the reference is too long", remedy="shorten it, or take longer steps")
    grid = np.arange(times[0], times[-1] + 0.5 * step, step)
    return Recording({channel: np.interp(grid, times, values)}, step)


def compensated(
    workspace: Workspace, model: str, reference: Recording
) -> tuple[Recording, list[str]]:
    """Return the pressures of a model's inverse for a reference, and what it says of them."""
    inverse = workspace.model(model).inverse()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        given = inverse.simulate(reference, sample_time=None)
    return given, [str(one.message) for one in caught if issubclass(one.category, ModelWarning)]


WORK: dict[str, Callable[[Workspace, dict[str, Any], Tell], str]] = {
    "fit": fit,
    "loop": loop,
    "record": record,
    "report": report,
}
"""Kinds of jobs."""
