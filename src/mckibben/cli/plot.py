"""mckibben plot: print-quality figures."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mckibben.cli.grouping import spread
from mckibben.cli.options import (
    Files,
    Force,
    Input,
    Output,
    Reading,
)
from mckibben.cli.output import say


@spread
def plot(
    files: Files,
    out: Annotated[Path, typer.Option("-o", "--out", help="Figure to write: .png, .svg or .pdf.")],
    reading: Reading,
    model: Annotated[
        Path | None, typer.Option("--model", help="Saved model to draw against the recordings.")
    ] = None,
    kind: Annotated[
        str | None,
        typer.Option(
            help="time, loop (default); with --model also fit (default), loops, residuals, weights."
        ),
    ] = None,
    input: Input = None,  # noqa: A002
    output: Output = None,
    force: Force = False,
) -> None:
    """Draw recordings, or a saved model against them."""
    from mckibben.outputs import claim_figure
    from mckibben.report.printed import format_of

    format_of(out)  # another ending is refused now
    claim_figure(out, inputs=[*files, *([] if model is None else [model])], force=force)
    recordings, given, moved = reading.read_one(files, input, output)
    from mckibben.report.figures import plot_model, plot_recording

    if model is None:
        plot_recording(recordings, given, moved, kind or "loop", out)
    else:
        from mckibben.blocks.saving import load

        plot_model(load(model), recordings, kind or "fit", out)
    say(f"Written: {out}")
