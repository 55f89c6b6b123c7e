"""The calls behind the clicks: what the workbench does, as Python and as a command."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from typing import Any

from mckibben.app import edits, forms
from mckibben.app.reading import options
from mckibben.app.recordings import Entry
from mckibben.app.workspace import Workspace


def read_call(path: str, given: Mapping[str, Any]) -> str:
    """Return the call that reads a file."""
    asked = "".join(f", {name}={value!r}" for name, value in given.items())
    return f"mckibben.read({path!r}{asked})"


def fit_call(
    model: str,
    channels: Mapping[str, Any],
    settings: Mapping[str, Any],
    seed: int,
    allow_shared: bool,
) -> str:
    """Return the call that fits and tests a model on the recordings in use."""
    asked = _asked([model], {model: dict(settings)} if settings else {}, allow_shared)
    return f"mckibben.compare(train, test, {_given(channels)}, {asked}, seed={seed})"


def report_call(
    models: Sequence[str],
    channels: Mapping[str, Any],
    settings: Mapping[str, Mapping[str, Any]],
    allow_shared: bool,
) -> str:
    """Return the calls that study the recordings in use, and write the report."""
    told = {model: dict(given) for model, given in settings.items() if given}
    asked = f"{_given(channels)}, {_asked(models, told, allow_shared)}"
    return (
        f"study = mckibben.study(train, test, {asked})\nmckibben.write_report(study, 'report.html')"
    )


def twin_call(workspace: Workspace, name: str) -> str:
    """Return the call that gives a model as a plant."""
    folder, limits = workspace.twin_of(name)
    asked = f", limits={limits!r}" if limits else ""
    return f"mckibben.control.Twin(mckibben.load('{folder}/{name}.json'){asked})"


def track_call(law: str, compensator: str, plant: str, reference: str) -> str:
    """Return the calls that let a controller follow a reference, in a file, on a plant."""
    tuned = (
        "mckibben.control.tune_pid(plant, sample_time=reference.sample_time, scheduled=held, "
        "references=compensator.inputs)"
    )
    return "\n".join(
        [
            *_assigned("compensator", compensator),
            f"plant = {plant}",
            f"(reference,) = {read_call(reference, {})}",
            "held = {name: reference[name][0] for name in plant.inputs if name in reference}",
            f"law = mckibben.control.control_law({law!r}, compensator, lambda: {tuned})",
            "mckibben.control.track(law, plant, reference)",
        ]
    )


def plot_call(
    workspace: Workspace, role: str, model: str, kind: str, sides: Sequence[str], target: str
) -> str:
    """Return the command that draws the recordings of a role: their sides, or else a model on them."""
    files = [entry.path for entry in workspace.entries() if entry.role == role]
    words = ["mckibben", "plot", *(str(path.relative_to(workspace.folder)) for path in files)]
    if sides:
        words += ["--input", sides[0], "--output", sides[1]]
    else:
        words += ["--model", f"models/{model}.json"]
    return shlex.join([*words, "--kind", kind, "-o", target])


def simulate_call(block: str, file: str) -> str:
    """Return the calls that run a block over a recording in a file."""
    return "\n".join(
        [
            *_assigned("block", block),
            f"(recording,) = {read_call(file, {})}",
            "block.simulate(recording.select([channel.name for channel in block.inputs]))",
        ]
    )


def _assigned(name: str, call: str) -> list[str]:
    """Return the lines of a call, the last of them with a name for what it gives."""
    *before, last = call.splitlines()
    return [*before, f"{name} = {last}"]


def _given(channels: Mapping[str, Any]) -> str:
    names = {"input": "inputs", "output": "outputs"}
    return ", ".join(f"{names.get(key, key)}={value!r}" for key, value in channels.items())


def _asked(models: Sequence[str], settings: Mapping[str, Any], allow_shared: bool) -> str:
    told = f", settings={settings!r}" if settings else ""
    return f"models={list(models)!r}{told}{', allow_shared=True' if allow_shared else ''}"


def script(
    workspace: Workspace,
    results: Sequence[Mapping[str, Any]],
    channels: Mapping[str, Any],
    compensator: tuple[str, str, Mapping[str, Any], float] | None = None,
) -> str:
    """Return a Python script that does again what was done: read, fit, choose, invert, save.

    Parameters
    ----------
    workspace : Workspace
    results : sequence of mapping
        What came of fits, best first. Of those of one model, the chosen or the best is fitted again.
    channels : mapping
        Input and output.
    compensator : (str, str, mapping, float), optional
        Model, use, settings and step of what was chosen; default the inverse of the best model.
    """
    name, form, used, _ = compensator or ("", "inverse", {}, 0.0)
    lines = ['"""What was done in the workbench, as a script."""', "", "import mckibben", ""]
    for role in ("train", "test"):
        lines += [f"{role} = [", *(f"    {read}," for read in _reads(workspace, role)), "]"]
    fitted, said = _of_one_split(results)
    chosen = [row for row in fitted if row["name"] == name]
    best: dict[str, Mapping[str, Any]] = {}
    for row in (*chosen, *fitted):
        best.setdefault(row["model"], row)
    settings = {model: row["settings"] for model, row in best.items() if row["settings"]}
    shared = any(row["shared"] for row in best.values())
    lines += [
        "",
        *said,
        f"board = mckibben.compare(train, test, {_given(channels)},",
        f"    {_asked(list(best), settings, shared)})",
        'print(board.to_frame()[["model", "validation_rmse", "test.rmse"]])',
        "print(board)",
        "",
        "for row in board.rows:",
        "    if row.block is not None:",
        '        row.block.save(f"{row.model}.json")',
        "",
    ]
    if name in workspace.models():
        saved = f"{chosen[0]['model']}.json" if chosen else workspace.path("models", f"{name}.json")
        lines += [f"model = mckibben.load({str(saved)!r})"]
        lines += forms.in_python(workspace.model(name), form, used)
        lines += ['inverse.save("inverse.json")']
    else:
        lines += [
            "if board.best is None:",
            "    raise SystemExit('No model is recommended.')",
            "try:",
            "    inverse = board.best.block.inverse()",
            "except mckibben.ModelError as error:",
            "    print(error)",
            "else:",
            '    inverse.save("inverse.json")',
        ]
    return "\n".join([*lines, ""])


def _of_one_split(
    results: Sequence[Mapping[str, Any]],
) -> tuple[Sequence[Mapping[str, Any]], list[str]]:
    """Return what was fitted and tested on the recordings as they are; if nothing was, all, and that."""
    same = [row for row in results if row["current"]]
    if same or not results:
        return same, []
    return results, ["# These models were fitted to, or tested on, other data than is in use now."]


def _reads(workspace: Workspace, role: str) -> list[str]:
    """Return the calls that read the recordings of a role, and do again what was done to them."""
    return [_read(workspace, entry) for entry in workspace.entries() if entry.role == role]


def _read(workspace: Workspace, entry: Entry) -> str:
    if not entry.upload:
        base = read_call(str(entry.base or entry.path), {"informative": False}) + "[0]"
        return edits.call(base, entry.steps)
    path = workspace.path("uploads", entry.upload)
    given = options(entry.reading) | {"informative": False}
    read = f"{read_call(str(path), given)}[{entry.part}]"
    if entry.reading.channels is not None:
        read += f".select({entry.reading.channels!r})"
    return edits.call(read, entry.steps)
