"""Save the inverse of a model, with the desired output as input.

The inverse of a force model computes the pressure from the desired force and the length. With --for
force, the result estimates the force from measured displacements and pressures. With --adaptive, the
inverse also has the measured outputs as inputs, and adapts its parameters while it runs.
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
