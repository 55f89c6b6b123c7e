"""Identify one model from recordings and save it as JSON.

Models of several muscles (balance, coupled-memory, coupled-pi, sdchm, tsfnn) use the channels
pressure_1 ..., displacement_1 ..., and pressure_extensor if present.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from mckibben.cli.output import show
from mckibben.cli.parameters import Argument, Files, Force, Json, command
from mckibben.options import FitOptions, Option, ReadOptions


@command
def fit(
    model: Annotated[str, Argument("MODEL", "Short name; see info --models.")],
    files: Files,
    options: FitOptions,
    reading: ReadOptions,
    out: Annotated[Path, Option("Model file to write (JSON).", "FILE", "-o")],
    force: Force = False,
    as_json: Json = False,
) -> None:
    from mckibben import workflow
    from mckibben.report import results, text

    found = workflow.fit(
        model, files, options, reading=reading, out=out, force=force, progress=True
    )
    show(found, lambda: text.lines(results.fit(found)), as_json, found.notes, [out])
