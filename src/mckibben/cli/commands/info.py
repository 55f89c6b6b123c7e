"""Show the contents of files and their data gaps, list the models, or show versions."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from mckibben.cli.output import show
from mckibben.cli.parameters import Json, command
from mckibben.options import Argument, Inputs, Option, Outputs, ReadOptions


@command
def info(
    reading: ReadOptions,
    files: Annotated[
        tuple[Path, ...], Argument("[FILES]...", "Recordings, or a model saved as JSON.")
    ] = (),
    models: Annotated[bool, Option("List the models and settings.")] = False,
    input: Inputs = None,  # noqa: A002
    output: Outputs = None,
    as_json: Json = False,
) -> None:
    from mckibben import workflow
    from mckibben.blocks.saving import is_saved, load
    from mckibben.blocks.setting import summary
    from mckibben.estimators.catalogue import described
    from mckibben.report import results, text
    from mckibben.version import versions

    if models:
        descriptions: dict[str, Any] = described()
        show(descriptions, lambda: text.lines(results.models(descriptions)), as_json)
        return
    if not files:
        installed = versions()
        show(installed, lambda: text.lines(results.versions(installed)), as_json)
        return
    if len(files) == 1 and files[0].suffix.lower() == ".json" and is_saved(files[0]):
        content = summary(load(files[0]))
        show(content, lambda: text.lines(results.model(content)), as_json)
        return
    contents = workflow.info(files, reading=reading, input=input, output=output)
    show(contents, lambda: text.lines_of_result(contents), as_json, read=contents.recordings)
