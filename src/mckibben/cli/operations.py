"""Operations as commands: arguments, flags and help from their declarations, and what they print."""

from __future__ import annotations

from inspect import signature
from pathlib import Path
from typing import Annotated, Any

import click

from mckibben.cli.output import show
from mckibben.cli.parameters import Force, Json, command_of
from mckibben.cli.stopping import stop_short, stoppable
from mckibben.options import Argument, ReadOptions
from mckibben.workflow import OPERATIONS

NO_RESULT = 1
"""Exit code if nothing worked, such as no model of a comparison."""


def operation_command(name: str) -> click.Command:
    """Return the command of an operation."""
    operation = OPERATIONS[name]
    parameters = signature(operation.run).parameters
    taken: dict[str, tuple[Any, Any]] = {}
    for key, about in operation.arguments.items():
        default = parameters[key].default
        single: Any = about.kind if isinstance(about, Argument) else Path
        many = about.several if isinstance(about, Argument) else default == ()
        taken[key] = (Annotated[tuple[Path, ...] if many else single, about], default)
    if operation.options is not None:
        taken["options"] = (operation.options, None)
    if operation.reads:
        taken["reading"] = (ReadOptions, None)
    if operation.out is not None:
        default = parameters["out"].empty if operation.must_write else None
        taken["out"] = (Annotated[Path | None, operation.out], default)
        taken["force"] = (Force, False)
    taken["as_json"] = (Json, False)
    progress = {"progress": True} if "progress" in parameters else {}

    def run(*, as_json: bool, **given: Any) -> int:
        from mckibben.files.notices import observed
        from mckibben.report import text

        out = given.get("out")
        with stoppable(out if operation.writes else None), observed() as read:
            found = operation.run(**given, **progress)
            stop_short(found, out)
        about = {"folder" if operation.writes else "file": str(out)} if out else {}
        if found is not None:
            about |= found.to_dict()
        written = [out / one for one in operation.writes] if out and operation.writes else [out]
        notes = getattr(found, "notes", ())
        lines = () if found is None else text.lines_of_result(found)
        show(about, lambda: lines, as_json, notes, written, read)
        return NO_RESULT if getattr(found, "failed", False) else 0

    return command_of(name, _help(operation.run), run, taken)


def _help(run: Any) -> str:
    """Return what a function does, without its parameters."""
    text: str = run.__doc__ or ""
    return text.partition("\n    Parameters\n")[0]
