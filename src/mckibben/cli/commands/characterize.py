"""Measure loop width, asymmetry, dead zone, creep and rate dependence of a muscle."""

from __future__ import annotations

from typing import Annotated

from mckibben.cli.output import show
from mckibben.cli.parameters import Files, Json, command
from mckibben.options import Option, ReadOptions


@command
def characterize(
    files: Files,
    reading: ReadOptions,
    input: Annotated[str | None, Option("Input. Default: by name.", "CHANNEL")] = None,  # noqa: A002
    output: Annotated[str | None, Option("Output. Default: by name.", "CHANNEL")] = None,
    scheduling: Annotated[
        tuple[str, ...],
        Option("Other input: use only samples where it is constant; repeatable.", "CHANNEL"),
    ] = (),
    as_json: Json = False,
) -> None:
    from mckibben.diagnosis.characterization import characterize as find
    from mckibben.reading import read_loop
    from mckibben.recording import notes_by_file, reading_notes
    from mckibben.report import results, text

    recordings, *pair = read_loop(files, input, output, reading, scheduling)
    found = find(recordings, *pair, scheduling=scheduling)
    about = found.to_dict() | {"notes": notes_by_file(recordings)}
    show(
        about,
        lambda: text.lines(results.characterization(found)),
        as_json,
        reading_notes(recordings),
    )
