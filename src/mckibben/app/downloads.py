"""What can be taken away, the jobs that write it into ``takeaway/``, and the script that repeats it.

Every job is given its file, its options, and what all have in common: ``model``, ``use`` and
``settings``, of which `compensators.block_for_use` makes a block, and ``inputs``, ``outputs``
and ``load``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from mckibben.app.compensators import block_for_use
from mckibben.app.jobs import Tell
from mckibben.app.modelling import Json
from mckibben.app.motions import step_and_cycle
from mckibben.app.workspace import Workspace
from mckibben.errors import DataError
from mckibben.options import COptions, ExportOptions, FMUOptions, MJCFOptions, StudyOptions

SCRIPT_ARGUMENTS = {
    "inverse": "",
    "adaptive": ", adaptive=True",
    "predictive": ", predictive=True",
    "learned": ", learned=train",
    "force": ', wanted="force"',
}
"""What makes a compensator of a model in a script."""


# -- jobs -------------------------------------------------------------------------------------------


def report(workspace: Workspace, tell: Tell, *, file: str, options: Json, of: Json) -> str:
    """Study the recordings with the models that were fitted, and write the page."""
    from mckibben.report import write_report
    from mckibben.workflow import study

    models = fitted(workspace)
    if not models:
        raise DataError("no model is fitted to these recordings", remedy="fit one under Models")
    settings = {"input": of["inputs"], "output": of["outputs"], "load": of["load"] or None}
    settings |= {"models": models, "jobs": 1} | options
    train, test = workspace.with_role("train"), workspace.with_role("test")
    result = study(train, test, **settings, progress=tell)
    write_report(result, workspace.path("takeaway", file), title=options.get("title", ""))
    return f"{file} is written"


def code(
    workspace: Workspace, tell: Tell, *, file: str, options: Json, of: Json, target: Any = "json"
) -> str:
    """Write a model, or what is made of it, as JSON or code; a folder becomes a zip."""
    from mckibben.workflow import export

    block, path = block_for_use(workspace, of["model"], of["use"], of["settings"]), Path(file)
    target_path = workspace.path("takeaway", file)
    if target == "json":
        block.save(target_path)
        return f"{file} is written"
    if target == "mjcf":
        export(block, target_path, target, force=True, **options)
        return f"{file} is written"
    name = "".join(c if c.isalnum() else "_" for c in path.stem).strip("_")
    settings: Json = {"name": name.lower() if target == "ros2" else name, "force": True} | options
    settings["sample_time"] = None
    if block.rate_dependent:
        settings["sample_time"] = (
            options.get("sample_time") or step_and_cycle(workspace, of["model"])[0]
        )
    if target == "fmu":
        export(block, target_path, target, **settings)
    else:
        _zip(target_path, lambda folder: export(block, folder / path.stem, target, **settings))
    return f"{file} is written"


def recordings(workspace: Workspace, tell: Tell, *, file: str, options: Json, of: Json) -> str:
    """Write the recordings in use as they are after their steps, by role, as a zip."""
    from mckibben.files import write

    def fill(folder: Path) -> None:
        for role in ("train", "test"):
            (folder / role).mkdir()
            for run in workspace.with_role(role):
                write(run, folder / role / f"{run.name}.csv")

    _zip(workspace.path("takeaway", file), fill)
    return f"{file} is written"


def _zip(path: Path, fill: Callable[[Path], Any]) -> None:
    from mckibben.exporting.folders import zipped
    from mckibben.system.atomic import replacing

    with TemporaryDirectory() as folder:
        fill(Path(folder))
        files = [file for file in Path(folder).rglob("*") if file.is_file()]
        contents = {file.relative_to(folder).as_posix(): file.read_bytes() for file in files}
    if not contents:
        raise DataError("no recording is in use", remedy="add one under Data")
    with replacing(path) as new:
        new.write_bytes(zipped(contents))


# -- the list ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Thing:
    """Something to take away: what it is and what for, the job, and its options that are asked for.

    The name of its file has ``{stem}`` where it is of a model; ``more`` is given to the job.
    """

    title: str
    purpose: str
    work: Callable[..., str]
    file: str
    kind: type | None = None
    fields: tuple[str, ...] = ()
    more: Mapping[str, str] = field(default_factory=dict)


THINGS = {
    "report": Thing(
        "Report",
        "What the muscle does, the models, their test and inverse: one page that opens anywhere.",
        *(report, "report.html", StudyOptions, ("title",)),
    ),
    "json": Thing("JSON", "For this library again: mckibben.load(file).", code, "{stem}.json"),
    "c": Thing(
        "C99", "For a microcontroller or a PC: compiles as it is, with a self-test.",
        *(code, "{stem}-c.zip", COptions),
        ("name", "sample_time", "single", "check", "emulate", "link", "limits", "safe", "watchdog"),
        {"target": "c"},
    ),
    "fmu": Thing(
        "FMU", "For Simulink and other tools; it is compiled here, up to a minute.",
        *(code, "{stem}.fmu", FMUOptions, ("name", "sample_time", "library"), {"target": "fmu"}),
    ),
    "ros2": Thing(
        "ROS 2", "A controller of ros2_control, to be built by colcon.",
        *(code, "{stem}-ros2.zip", ExportOptions, ("name", "sample_time"), {"target": "ros2"}),
    ),
    "mjcf": Thing(
        "MuJoCo", "A muscle as plain XML, of a balance fitted within what MJCF carries.",
        *(code, "{stem}.xml", MJCFOptions),
        ("rest_length", "site_from", "site_to", "example", "lag"),
        {"target": "mjcf"},
    ),
    "recordings": Thing(
        "Recordings", "As they are after cuts and filters, by role, with units.",
        *(recordings, "recordings.zip"),
    ),
}  # fmt: skip


# -- the script -------------------------------------------------------------------------------------


def fitted(workspace: Workspace) -> list[str]:
    """Return the kinds of models that were fitted to the recordings as they are."""
    rows = [row for row in workspace.results() if row["current"] and row.get("model")]
    return list(dict.fromkeys(row["model"] for row in rows))


def script(workspace: Workspace, of: Json) -> str:
    """Return a Python script: read, compare, save, invert, export."""
    models = fitted(workspace)
    lines = ['"""What was done in the workbench; run it in its folder."""', ""]
    lines += ["import mckibben", ""]
    for role in ("train", "test"):
        runs = [f"    {entry.code()}," for entry in workspace.entries() if entry.role == role]
        lines += [f"{role} = [", *runs, "]"]
    settings = {"input": of["inputs"], "output": of["outputs"], "load": of["load"]}
    settings = {key: value for key, value in settings.items() if value} | {"models": models}
    lines += ["board = mckibben.compare(", "    train,", "    test,"]
    lines += [*(f"    {key}={value!r}," for key, value in settings.items()), ")", "print(board)"]
    for kind in (row["model"] for row in workspace.results() if row["name"] == of["model"]):
        lines.append(f"model = next(row.block for row in board.rows if row.model == {kind!r})")
        lines.append(f'model.save("{kind}.json")')
        if (use := of["use"]) in SCRIPT_ARGUMENTS:
            lines.append(f"inverse = mckibben.invert(model{SCRIPT_ARGUMENTS[use]})")
            lines.append(f'inverse.model.save("{kind}-{use}.json")')
            step = ", sample_time=train[0].sample_time"
            lines.append(f'mckibben.export(inverse, "{kind}-{use}-c", "c"{step})')
    return "\n".join(lines) + "\n"
