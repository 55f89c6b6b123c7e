"""Draw recordings, or a saved model against them, for print."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from mckibben.cli.output import say
from mckibben.cli.parameters import Files, Force, command
from mckibben.options import Option
from mckibben.reading import ReadOptions


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
        Option("time, loop (default); with --model also fit (default), loops, residuals, weights."),
    ] = None,
    input: Annotated[str | None, Option("Input. Default: by name.", "CHANNEL")] = None,  # noqa: A002
    output: Annotated[str | None, Option("Output. Default: by name.", "CHANNEL")] = None,
    force: Force = False,
) -> None:
    from mckibben.blocks.saving import load
    from mckibben.outputs import claim
    from mckibben.reading import read_pair
    from mckibben.report.figures import plot_model, plot_recording
    from mckibben.report.printed import format_of

    format_of(out)  # another ending is refused now
    claim(out, inputs=[*files, *([] if model is None else [model])], force=force)
    recordings, given, moved = read_pair(files, input, output, reading)
    if model is None:
        plot_recording(recordings, given, moved, kind or "loop", out)
    else:
        plot_model(load(model), recordings, kind or "fit", out)
    say(f"Written: {out}")
