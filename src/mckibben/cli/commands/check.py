"""Validate a saved model on recordings, and list the causes of its residual.

The model is simulated in free run. Possible causes are lag, inputs, their direction (hysteresis), loads,
time (drift), speed, holds (creep) and position. Use recordings that the model was not fitted to. A
folder includes all recordings in it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from mckibben.cli.output import show
from mckibben.cli.parameters import Files, Force, Json, ModelFile, command
from mckibben.options import Option, ReadOptions


@command
def check(
    model: ModelFile,
    files: Files,
    reading: ReadOptions,
    out: Annotated[Path, Option("Folder for the results.", "DIR", "-o")],
    force: Force = False,
    as_json: Json = False,
) -> None:
    from mckibben import workflow
    from mckibben.report import results, text
    from mckibben.report.check_page import check_json

    found = workflow.check(model, files, reading=reading, out=out, force=force, progress=True)
    about = {"folder": str(out)} | check_json(found, str(model))
    written = [out / "report.html", out / "validation.json"]
    show(about, lambda: text.lines(results.check(found)), as_json, written=written)
