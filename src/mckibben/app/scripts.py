"""The calls behind the clicks: what the workbench does, as Python and as a command."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from mckibben.app import edits
from mckibben.app.reading import options
from mckibben.app.recordings import Entry
from mckibben.app.workspace import Workspace


def read_call(path: str, given: Mapping[str, Any]) -> str:
    """Return the call that reads a file."""
    asked = "".join(f", {name}={value!r}" for name, value in given.items())
    return f"mckibben.read({path!r}{asked})"


def fit_call(
    model: str, channels: Mapping[str, Any], settings: Mapping[str, Any], seed: int
) -> str:
    """Return the call that fits and tests a model on the recordings in use."""
    given = f", settings={ {model: dict(settings)}!r}" if settings else ""
    return (
        f"mckibben.compare(train, test, {_given(channels)}, models=[{model!r}]{given}, seed={seed})"
    )


def _given(channels: Mapping[str, Any]) -> str:
    return ", ".join(f"{name}s={value!r}" for name, value in channels.items())


def script(workspace: Workspace, models: Sequence[str], channels: Mapping[str, Any]) -> str:
    """Return a Python script that does again what was done: read, fit, choose, invert, save."""
    lines = ['"""What was done in the workbench, as a script."""', "", "import mckibben", ""]
    for role in ("train", "test"):
        lines += [f"{role} = [", *(f"    {read}," for read in _reads(workspace, role)), "]"]
    lines += [
        "",
        f"board = mckibben.compare(train, test, {_given(channels)},",
    ]
    chosen = [row for row in workspace.results() if row["name"] in models]
    settings = {row["model"]: row["settings"] for row in chosen if row["settings"]}
    kinds = [row["model"] for row in chosen]
    lines.append(f"    models={kinds!r}, settings={settings!r})")
    lines += [
        'print(board.to_frame()[["model", "validation_rmse", "test.rmse"]])',
        "print(board.chosen)",
        "",
        "for row in board.rows:",
        "    if row.block is not None:",
        '        row.block.save(f"{row.model}.json")',
        "",
        "if board.best is None:",
        "    raise SystemExit(board.not_recommended)",
        "try:",
        "    inverse = board.best.block.inverse()",
        "except mckibben.ModelError as error:",
        "    print(error)",
        "else:",
        '    inverse.save("inverse.json")',
        "",
    ]
    return "\n".join(lines)


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
