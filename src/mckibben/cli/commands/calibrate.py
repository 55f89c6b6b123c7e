"""Calibrate a prediction band of a model on recordings that it was not fitted to.

On average, a band of level 0.9 contains 90 % of the samples of a similar new recording.
simulate model.json FILE --interval 0.9 writes its lower and upper limits.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from mckibben.cli.output import show
from mckibben.cli.parameters import Files, Force, Json, ModelFile, command
from mckibben.options import Option, ReadOptions


@command
def calibrate(
    model: ModelFile,
    files: Files,
    reading: ReadOptions,
    out: Annotated[Path, Option("Model with its band to write (JSON).", "FILE", "-o")],
    exchangeable: Annotated[
        Literal["auto", "run", "block"],
        Option("What a new run is like: runs, or long blocks of runs. auto: runs from 9 on."),
    ] = "auto",
    fitted: Annotated[
        tuple[Path, ...],
        Option("Recordings the model was fitted to (refused); repeatable.", "FILE"),
    ] = (),
    force: Force = False,
    as_json: Json = False,
) -> None:
    from mckibben.blocks.saving import load
    from mckibben.diagnosis.bands import calibration
    from mckibben.outputs import claim
    from mckibben.reading import read_files
    from mckibben.report import results, text, words

    claim(out, inputs=[model, *files, *fitted], force=force)
    block, known = load(model), read_files(fitted, None, reading)
    banded, found = calibration(block, read_files(files, None, reading), exchangeable, known)
    banded.save(out)
    notes = [words.calibrated_on_blocks(found)] if found.band.unit == "block" else []
    if not known:
        notes.append(
            "whether the model was fitted to these recordings is checked with --fitted FILE"
        )
    about = {"file": str(out)} | found.to_dict() | {"notes": notes}
    show(about, lambda: text.lines(results.calibration(found)), as_json, notes, [out])
