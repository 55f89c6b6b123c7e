"""Plot recordings, or a saved model and recordings, for publication."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from mckibben.cli.output import say
from mckibben.cli.parameters import Files, Force, command
from mckibben.options import Option, ReadOptions


@command
def plot(
    files: Files,
    reading: ReadOptions,
    out: Annotated[Path, Option("Figure to write: .png, .svg or .pdf.", "FILE", "-o")],
    model: Annotated[
        Path | None, Option("Saved model to draw against the recordings.", "MODEL")
    ] = None,
    kind: Annotated[
        str | None,
        Option("time, loop (default); with --model also fit (default), loops, residuals."),
    ] = None,
    input: Annotated[str | None, Option("Input. Default: by name.", "CHANNEL")] = None,  # noqa: A002
    output: Annotated[str | None, Option("Output. Default: by name.", "CHANNEL")] = None,
    force: Force = False,
) -> None:
    from mckibben.blocks.saving import load
    from mckibben.outputs import claim
    from mckibben.reading import read_loop
    from mckibben.report.figures import write_figure
    from mckibben.report.printed import format_of

    format_of(out)  # another ending is refused now
    claim(out, inputs=[*files, *([] if model is None else [model])], force=force)
    recordings, given, moved = read_loop(files, input, output, reading)
    if model is None:
        write_figure(recordings, out, kind, input=given, output=moved)
    else:
        write_figure(load(model), out, kind or "fit", recording=recordings)
    say(f"Written: {out}")
