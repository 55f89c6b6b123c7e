"""mckibben calibrate: a model with bands that hold, from recordings that it was not fitted to."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from mckibben.cli.grouping import spread
from mckibben.cli.options import Files, Force, Json, Reading
from mckibben.cli.output import print_json, say


class Units(StrEnum):
    """What counts as exchangeable."""

    AUTO = "auto"
    RUN = "run"
    BLOCK = "block"


@spread
def calibrate(
    model: Annotated[Path, typer.Argument(help="Model file (JSON).")],
    files: Files,
    out: Annotated[Path, typer.Option("-o", "--out", help="Model with its band to write (JSON).")],
    reading: Reading,
    exchangeable: Annotated[
        Units,
        typer.Option(
            "--exchangeable",
            help="What a new run is like: runs, or long blocks of runs. auto: runs from 9 on.",
        ),
    ] = Units.AUTO,
    fitted: Annotated[
        list[Path] | None,
        typer.Option(
            "--fitted", metavar="FILE", help="What the model was fitted to: refused; repeatable."
        ),
    ] = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Find bands of a model on recordings that it was not fitted to.

    At a level of 0.9 they hold 90 % of the samples of a new run that is like these, on average.
    simulate model.json FILE --interval 0.9 writes lower and upper ends.
    """
    from mckibben.blocks.saving import load
    from mckibben.diagnosis.bands import calibration
    from mckibben.outputs import claim_model
    from mckibben.report import words

    claim_model(out, inputs=[model, *files, *(fitted or [])], force=force)
    block = load(model)
    recordings = reading.read(files, None, informative=False)
    known = reading.read(fitted, None, informative=False) if fitted else []
    banded, found = calibration(block, recordings, exchangeable.value, known)
    banded.save(out)
    band, most = found.band, found.band.units / (found.band.units + 1)
    names = [channel.name for channel in band.given]
    notes = [words.calibrated_on_blocks(found)] if band.unit == "block" else []
    if not known:
        notes.append(
            "Whether the model was fitted to these recordings is not known; --fitted FILE makes sure."
        )
    if as_json:
        print_json(
            {
                "file": str(out),
                "unit": band.unit,
                "units": band.units,
                "highest_level": most,
                "level": band.level,
                "width": dict(zip(names, found.widths, strict=True)),
                "width_over_constant": dict(zip(names, found.over_constant, strict=True)),
                "memory": found.memory,
                "notes": notes,
            }
        )
        return
    for sentence in words.calibrated(found):
        say(sentence)
    for note in notes:
        say(f"Note: {note}")
    say(f"Written: {out}")
