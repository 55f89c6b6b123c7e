"""mckibben calibrate: a model with bands that hold, from recordings that it was not fitted to."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from mckibben.cli.grouping import spread
from mckibben.cli.options import Files, Force, Json, Reading
from mckibben.cli.output import print_json, say
from mckibben.numerals import numeral


class Units(StrEnum):
    """What counts as exchangeable."""

    AUTO = "auto"
    RUN = "run"
    BLOCK = "block"


USUAL, USUAL_UNITS = 0.9, 9
"""The level that most ask for, and how many units allow it."""


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
            help="What a new run is like: runs, or long blocks of runs. auto: runs from 20 on.",
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
    from mckibben.comparison.calibrating import calibration
    from mckibben.outputs import claim_model

    claim_model(out, inputs=[model, *files, *(fitted or [])], force=force)
    block = load(model)
    recordings = reading.read(files, None, informative=False)
    known = reading.read(fitted, None, informative=False) if fitted else []
    banded, found = calibration(block, recordings, exchangeable=exchangeable.value, fitted=known)
    banded.save(out)
    band, most = found.band, found.band.units / (found.band.units + 1)
    names = [channel.name for channel in band.given]
    notes = list(found.notes)
    if not known:
        notes.append(
            "whether the model was fitted to these recordings is not known; --fitted FILE makes sure"
        )
    if most < USUAL:
        notes.append(f"a level of 90 % takes {USUAL_UNITS} of them: record more")
    narrower = dict(zip(names, found.widths, strict=True))
    if as_json:
        print_json(
            {
                "file": str(out),
                "unit": band.unit,
                "units": band.units,
                "highest_level": most,
                "level": found.level,
                "width": dict(zip(names, found.mean_widths, strict=True)),
                "width_over_constant": narrower,
                "memory": found.memory,
                "notes": notes,
            }
        )
        return
    units = "runs" if band.unit == "run" else "blocks"
    say(f"Calibrated on {band.units} {units}, which allow levels up to {numeral(100 * most, 3)} %.")
    for channel, width in zip(band.given, found.mean_widths, strict=True):
        say(
            f"{channel.name}: the band at {numeral(100 * found.level, 3)} % is {numeral(width, 3)} "
            f"{channel.unit} wide on average on runs left out, {numeral(narrower[channel.name], 2)} of "
            "one that is the same everywhere."
        )
    for note in notes:
        say(f"Note: {note}.")
    say(f"Written: {out}")
