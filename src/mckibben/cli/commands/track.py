"""Track a reference with a compensator, or a controller, on a virtual rig or a model.

The result is compared with a static map: pressures read from one slow rise of the same plant.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from mckibben.cli.output import show
from mckibben.cli.parameters import Argument, Force, Json, command
from mckibben.options import Option, ReadOptions, TrackOptions


@command
def track(
    compensator: Annotated[Path, Argument("COMPENSATOR", "Inverse, from mckibben invert (JSON).")],
    reference: Annotated[Path, Option("Displacements, or force, to follow.", "FILE")],
    options: TrackOptions,
    reading: ReadOptions,
    out: Annotated[Path | None, Option("Recording of the run to write.", "FILE", "-o")] = None,
    controller_out: Annotated[
        Path | None, Option("Controller to write (JSON), for export.", "FILE")
    ] = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    from mckibben import workflow
    from mckibben.report import results, text

    found = workflow.track(
        compensator,
        reference,
        options,
        reading=reading,
        out=out,
        controller_out=controller_out,
        force=force,
        progress=True,
    )
    show(found, lambda: text.lines(results.tracking(found)), as_json, written=[out, controller_out])
