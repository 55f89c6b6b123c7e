"""mckibben check: is a saved model right on recordings, and what does it miss."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mckibben.cli.grouping import spread
from mckibben.cli.options import Files, Force, Json, Reading
from mckibben.cli.output import make_folder, print_json, say


@spread
def check(
    model: Annotated[Path, typer.Argument(help="Model file (JSON).")],
    files: Files,
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for the results.")],
    reading: Reading,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Say whether a saved model is right on recordings, and what it misses, in words and on a page.

    The model runs free. What it leaves is tested for being noise that follows nothing recorded: no
    input, load, rate or branch (hysteresis that is left), no hold (creep), no time (drift).
    Recordings that the model was not fitted to tell most. A folder stands for all recordings in it.
    """
    from mckibben.blocks.saving import load
    from mckibben.files.sources import expanded
    from mckibben.outputs import Results
    from mckibben.recording import notes_by_file
    from mckibben.report.check_page import check_page
    from mckibben.system.atomic import to_json
    from mckibben.validation.check import check as find
    from mckibben.validation.describing import describe

    folder = make_folder(out)
    *_, found_files = expanded([], list(files))
    results = Results(folder, inputs=[model, *found_files], force=force)
    results.claim(["validation.json", "report.html"])
    block = load(model)
    wanted = [channel.name for channel in (*block.inputs, *block.outputs)]
    recordings = reading.read(found_files, list(dict.fromkeys(wanted)), informative=False)
    found = find(block, recordings)
    description = describe(block, recordings, fitted=False)
    told = found.to_dict() | {
        "description": description.to_dict(),
        "model_file": str(model),
        "notes_of_reading": notes_by_file(recordings),
    }
    results.write_text("validation.json", to_json(told) + "\n")
    results.write_text("report.html", check_page(found, description, str(model)))
    if as_json:
        print_json({"folder": str(folder)} | told)
        return
    say(found.verdict)
    for sentence in found.sentences:
        say(f"- {sentence}")
    for note in found.notes:
        say(f"Note: {note}")
    say(f"Written: {folder / 'report.html'}, validation.json")
