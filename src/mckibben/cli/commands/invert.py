"""Write the inverse of a saved model: desired output in, input out.

Of a model of force, what is written gives the pressure by desired force and length. With
--for force, what is written gives the force by measured displacements and pressures: simulate it.
With --adaptive, what is written also takes what is measured, and learns from it while it runs.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from mckibben.cli.output import show
from mckibben.cli.parameters import Force, Json, ModelFile, command
from mckibben.options import InvertOptions, Option, ReadOptions


@command
def invert(
    model: ModelFile,
    options: InvertOptions,
    reading: ReadOptions,
    out: Annotated[Path, Option("Inverse to write (JSON).", "FILE", "-o")],
    force: Force = False,
    as_json: Json = False,
) -> None:
    from mckibben import workflow
    from mckibben.report import results, text

    found = workflow.invert(model, options, reading=reading, out=out, force=force, progress=True)
    show(found, lambda: text.lines(results.inverse(found)), as_json, written=[out])
