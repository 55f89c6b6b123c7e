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
    declared: dict[str, tuple[Any, Any]] = {}
    for key, content in operation.arguments.items():
        default = parameters[key].default
        kind: Any = content.kind if isinstance(content, Argument) else Path
        several = content.several if isinstance(content, Argument) else default == ()
        declared[key] = (Annotated[tuple[Path, ...] if several else kind, content], default)
    if operation.options is not None:
        declared["options"] = (operation.options, None)
    if operation.reads:
        declared["reading"] = (ReadOptions, None)
    if operation.out is not None:
        default = parameters["out"].empty if operation.must_write else None
        declared["out"] = (Annotated[Path | None, operation.out], default)
        declared["force"] = (Force, False)
    declared["as_json"] = (Json, False)
    progress = {"progress": True} if "progress" in parameters else {}

    def run(*, as_json: bool, **values: Any) -> int:
        from mckibben.files.notices import observed
        from mckibben.report import text

        out = values.get("out")
        with stoppable(out if operation.writes else None), observed() as read:
            result = operation.run(**values, **progress)
            stop_short(result, out)
        content = {"folder" if operation.writes else "file": str(out)} if out else {}
        if result is not None:
            content |= result.to_dict()
        written = [out / file for file in operation.writes] if out and operation.writes else [out]
        notes = getattr(result, "notes", ())
        lines = () if result is None else text.lines_of_result(result)
        show(content, lambda: lines, as_json, notes, written, read)
        return NO_RESULT if getattr(result, "failed", False) else 0

    return command_of(name, _help(operation.run), run, declared)


def _help(run: Any) -> str:
    """Return what a function does, without its parameters."""
    text: str = run.__doc__ or ""
    return text.partition("\n    Parameters\n")[0]
