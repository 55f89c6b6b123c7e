"""Jobs that write what is taken away, into ``takeaway/``, and the script that does everything again."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mckibben.app.following import made, pace
from mckibben.app.jobs import Tell
from mckibben.app.workspace import Role, Workspace
from mckibben.errors import DataError

FIGURES = {
    "loops": "Measured and modelled loops",
    "fit": "Measured and modelled over time",
    "residuals": "Residuals",
    "weights": "Weights over thresholds",
    "loop": "Loops of the recordings",
    "time": "Recordings over time",
}


def report(
    workspace: Workspace,
    tell: Tell,
    *,
    file: str,
    models: list[str],
    settings: dict[str, Any],
    inputs: list[str],
    outputs: list[str],
    load: str,
    heading: str,
) -> str:
    """Study the recordings with some models, and write the page."""
    from mckibben.report import write_report
    from mckibben.workflow import study

    if not models:
        raise DataError("no model is fitted to these recordings", remedy="fit one under Models")
    sides: dict[str, Any] = {"inputs": inputs, "outputs": outputs, "load": load or None}
    given: dict[str, Any] = {"models": models, "settings": settings, "title": heading}
    train, test = workspace.with_role("train"), workspace.with_role("test")
    found = study(train, test, **sides, **given, jobs=1, allow_early=True, progress=tell)
    write_report(found, workspace.path("takeaway", file), title=heading)
    return f"{file} is written"


def figure(
    workspace: Workspace,
    tell: Tell,
    *,
    file: str,
    kind: str,
    model: str,
    inputs: list[str],
    outputs: list[str],
) -> str:
    """Draw the test recordings, or else those for training, for print."""
    from mckibben.report.figures import write_figure

    tell(0.1)
    runs, path = workspace.with_role("test"), workspace.path("takeaway", file)
    runs = runs or workspace.with_role("train")
    if not runs:
        raise DataError("there is no recording to draw", remedy="add one under Data")
    if kind in ("loop", "time"):
        write_figure(runs, path, kind, input=inputs[0], output=outputs[0])
    elif kind == "weights":
        write_figure(workspace.model(model), path, kind)
    else:
        write_figure(workspace.model(model), path, kind, recording=runs)
    return f"{file} is written"


def block(
    workspace: Workspace, tell: Tell, *, file: str, model: str, form: str, settings: dict[str, Any]
) -> str:
    """Write a model, or what is made of it, as JSON."""
    tell(0.1)
    made(workspace, model, form, settings).save(workspace.path("takeaway", file))
    return f"{file} is written"


def code(
    workspace: Workspace,
    tell: Tell,
    *,
    file: str,
    model: str,
    form: str,
    settings: dict[str, Any],
    target: Any,
    options: dict[str, Any],
) -> str:
    """Export a model, or what is made of it, as code; a folder becomes a zip."""
    from mckibben.workflow import export

    tell(0.1)
    found = made(workspace, model, form, settings)
    told = {key: value for key, value in options.items() if key != "sample_time"}
    if found.rate_dependent:
        told["sample_time"] = options.get("sample_time") or pace(workspace, model)[0]
    path = workspace.path("takeaway", file)
    name = options.get("name") or "".join(c if c.isalnum() else "_" for c in path.stem).strip("_")
    told["name"] = name.lower() if target == "ros2" else name
    to = path if target == "fmu" else path.with_suffix("")
    export(found, to, target, force=True, **told)
    if to != path:
        _zip(workspace, file, {f"{to.name}/{p.relative_to(to).as_posix()}": p for p in _files(to)})
    return f"{file} is written"


def recordings(workspace: Workspace, tell: Tell, *, file: str, ending: str) -> str:
    """Write the recordings in use as they are after their steps, by role, as a zip."""
    from mckibben.files import write

    folder, found = workspace.path("takeaway", file).with_suffix(""), {}
    for role in ("train", "test"):
        (folder / role).mkdir(parents=True, exist_ok=True)
        for run in workspace.with_role(role):
            write(run, folder / role / f"{run.name}{ending}")
            tell(0.5)
    found = {p.relative_to(folder).as_posix(): p for p in _files(folder)}
    if not found:
        raise DataError("no recording is in use", remedy="add one under Data")
    _zip(workspace, file, found)
    return f"{file} is written"


def _files(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file() and not path.is_symlink()]


def _zip(workspace: Workspace, file: str, found: dict[str, Path]) -> None:
    from mckibben.export.folders import zipped
    from mckibben.system.atomic import replacing

    content = zipped({name: path.read_bytes() for name, path in found.items()})
    with replacing(workspace.path("takeaway", file)) as new:
        new.write_bytes(content)


# -- scripts ----------------------------------------------------------------------------------------


def fitted(workspace: Workspace) -> tuple[list[str], dict[str, Any]]:
    """Return the kinds of models that were fitted to the recordings as they are, with settings."""
    rows = [row for row in workspace.results() if row["current"] and row.get("model")]
    settings = {row["model"]: row["settings"] for row in reversed(rows) if row.get("settings")}
    return list(dict.fromkeys(row["model"] for row in rows)), settings


def python(
    workspace: Workspace, inputs: list[str], outputs: list[str], load: str, model: str, form: str
) -> str:
    """Return a Python script: read, compare, save, invert, export."""
    return "\n".join(_python(workspace, inputs, outputs, load, model, form))


def _python(
    workspace: Workspace, inputs: list[str], outputs: list[str], load: str, model: str, form: str
) -> Iterator[str]:
    yield from (
        '"""What was done in the workbench; run it in its folder."""',
        "",
        "import mckibben",
        "from mckibben import workflow",
        "",
    )
    roles: tuple[Role, Role] = ("train", "test")
    for role in roles:
        yield f"{role} = ["
        yield from (f"    {one.code()}," for one in workspace.entries() if one.role == role)
        yield "]"
    models, settings = fitted(workspace)
    told = f", settings={settings!r}" if settings else ""
    told += f", load={load!r}" if load else ""
    yield from ("board = mckibben.compare(", "    train,", "    test,")
    yield from (
        f"    inputs={inputs!r},",
        f"    outputs={outputs!r},",
        f"    models={models!r}{told},",
    )
    yield from (")", "print(board)")
    chosen = next(
        (r["model"] for r in workspace.results() if r["name"] == model), models[0] if models else ""
    )
    if not chosen:
        return
    yield f"model = next(row.block for row in board.rows if row.model == {chosen!r})"
    yield f'model.save("{chosen}.json")'
    flag = {
        "adaptive": ", adaptive=True",
        "predictive": ", predictive=True",
        "learned": ", learned=train",
    }
    flag |= {"force": ', wanted="force"', "inverse": ""}
    if form in flag:
        yield f"inverse = workflow.invert(model{flag[form]})"
        yield f'inverse.block.save("{chosen}-{form}.json")'
        yield f'workflow.export(inverse, "{chosen}-{form}-c", "c")'


def shell(
    workspace: Workspace, inputs: list[str], outputs: list[str], load: str, model: str, form: str
) -> str:
    """Return the same as commands, on the recordings as they are taken away."""
    models, settings = fitted(workspace)
    sides = [*(f"--input {name}" for name in inputs), *(f"--output {name}" for name in outputs)]
    told = " ".join(map(shlex.quote, " ".join(sides).split()))
    sets = " ".join(
        shlex.join(["--set", f"{of}.{key}={value}"])
        for of, own in settings.items()
        for key, value in own.items()
    )
    test = " ".join(
        f"--test recordings/test/{one.name}.csv"
        for one in workspace.entries()
        if one.role == "test"
    )
    more = " ".join(part for part in (f"--load {load}" if load else "", sets, test) if part)
    lines = ["# with recordings.zip (CSV) unpacked in the folder recordings"]
    lines += [
        f"mckibben compare recordings/train {more} {told} --models {','.join(models)} -o results"
    ]
    chosen = next((r["model"] for r in workspace.results() if r["name"] == model), "")
    if chosen:
        lines += [f"mckibben fit {chosen} recordings/train {told} -o {chosen}.json"]
        flag = {"adaptive": " --adaptive", "predictive": " --predictive", "force": " --for force"}
        flag |= {"inverse": "", "learned": " --learned recordings/train"}
        if form in flag:
            lines += [f"mckibben invert {chosen}.json{flag[form]} -o {chosen}-{form}.json"]
            lines += [f"mckibben export c {chosen}-{form}.json -o {chosen}-{form}-c"]
    return "\n".join(" ".join(line.split()) for line in lines) + "\n"
