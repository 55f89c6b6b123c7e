"""Show the contents of files and their data gaps, list the models, or show versions."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from mckibben.cli.output import show
from mckibben.cli.parameters import Argument, Json, command
from mckibben.options import Inputs, Option, Outputs, ReadOptions


@command
def info(
    reading: ReadOptions,
    files: Annotated[
        tuple[Path, ...], Argument("[FILES]...", "Recordings, or a model saved as JSON.")
    ] = (),
    models: Annotated[bool, Option("List the models and settings.")] = False,
    inputs: Inputs = None,
    outputs: Outputs = None,
    as_json: Json = False,
) -> None:
    from mckibben import registry
    from mckibben.blocks.saving import load
    from mckibben.blocks.setting import summary
    from mckibben.errors import DataError
    from mckibben.estimators.catalogue import described
    from mckibben.reading import look
    from mckibben.report import results, text
    from mckibben.version import versions

    if models:
        every: dict[str, Any] = described()
        show(every, lambda: text.lines(results.models(every)), as_json)
        return
    if not files:
        installed = versions()
        show(installed, lambda: text.lines(results.versions(installed)), as_json)
        return
    known = {*registry.names("estimators"), *registry.names("blocks")}
    if named := [str(one) for one in files if str(one) in known and not one.exists()]:
        raise DataError(
            f"{named[0]!r} is a model, and there is no file of that name",
            remedy="list the models with `models`, or give a file",
        )
    if len(files) == 1 and files[0].suffix.lower() == ".json":
        about = summary(load(files[0]))
        show(about, lambda: text.lines(results.model(about)), as_json)
        return
    found = look(files, reading, inputs, outputs)
    show(found, lambda: text.lines(results.contents(found)), as_json)
