"""Simulate a saved model in free run on a recording; adds channels named OUTPUT_model.

The run begins from the first measured output for what that determines, and at rest for the rest; without
measured outputs, or with --initial first_sample, at rest at the first input.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from mckibben.cli.output import show
from mckibben.cli.parameters import Argument, Force, Json, ModelFile, command
from mckibben.options import Fields, Option, ReadOptions


@command
def simulate(
    model: ModelFile,
    file: Annotated[Path, Argument("FILE", "Recording with the model's inputs.")],
    reading: ReadOptions,
    out: Annotated[Path, Option("File to write (.csv).", "FILE", "-o")],
    initial: Annotated[
        str,
        Option(
            "Memory before the first sample: measured (from the first measured output), first_sample "
            "(at rest at the first input), or virgin."
        ),
    ] = "measured",
    interval: Annotated[
        float | None,
        Option("With a calibrated model: add the band of this coverage, as 0.9.", "LEVEL"),
    ] = None,
    fields: Fields = {},  # noqa: B006
    force: Force = False,
    as_json: Json = False,
) -> None:
    from mckibben.files import write
    from mckibben.outputs import claim_recording
    from mckibben.reading import read_files
    from mckibben.report import results, text, words
    from mckibben.studying.simulating import simulated
    from mckibben.workflow import saved

    claim_recording(out, inputs=[model, file], force=force)
    found = simulated(
        saved(model, fields),
        lambda names: read_files(file, names, reading),
        initial=None if initial == "measured" else initial,
        interval=interval,
    )
    write(found.recording.with_meta(model=str(model)), out)
    run = found.recording.name
    beyond = [words.outside_calibration(run, *each) for each in found.outside]
    notes = [*found.notes, *beyond]
    about = {"file": str(out)} | found.to_dict() | {"notes": notes}
    show(about, lambda: text.lines(results.simulation(found)), as_json, notes, [out])
