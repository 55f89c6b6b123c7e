"""mckibben check: is a saved model right on recordings, and what does it miss."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mckibben.cli.grouping import spread
from mckibben.cli.options import Files, Force, Json, Reading
from mckibben.cli.output import make_folder, print_json, say
from mckibben.errors import DataError
from mckibben.recording import Recording


@spread
def check(
    model: Annotated[Path, typer.Argument(help="Model file (JSON).")],
    files: Files,
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for the results.")],
    reading: Reading,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Test whether a saved model is right on recordings, and what it misses.

    The model runs free. Its residual is tested for following a lag, inputs, their branches (hysteresis),
    loads, time (drift), speed, holds (creep) and position. Recordings that the model was not fitted to
    say most. A folder stands for all recordings in it.
    """
    from mckibben.blocks.saving import load
    from mckibben.diagnosis.check import check as find
    from mckibben.diagnosis.description import describe
    from mckibben.files.sources import expanded
    from mckibben.outputs import Results
    from mckibben.recording import notes_by_file
    from mckibben.report.check_page import check_page
    from mckibben.report.words import check_sentences, check_verdict
    from mckibben.system.atomic import to_json

    folder = make_folder(out)
    *_, found_files = expanded([], list(files))
    results = Results(folder, inputs=[model, *found_files], force=force)
    results.claim(["validation.json", "report.html"])
    block = load(model)
    wanted = [channel.name for channel in (*block.inputs, *block.outputs)]
    recordings = _with_loads(reading, found_files, list(dict.fromkeys(wanted)))
    found = find(block, recordings)
    description = describe(block, recordings, fitted=False)
    verdict, sentences = check_verdict(found), check_sentences(found)
    told = found.to_dict() | {
        "verdict": verdict,
        "sentences": sentences,
        "description": description.to_dict(),
        "model_file": str(model),
        "notes_of_reading": notes_by_file(recordings),
    }
    results.write_text("validation.json", to_json(told) + "\n")
    results.write_text("report.html", check_page(found, description, str(model)))
    if as_json:
        print_json({"folder": str(folder)} | told)
        return
    say(verdict)
    for sentence in sentences:
        say(f"- {sentence}")
    if found.untested:
        say(f"Too short to be tested: {', '.join(found.untested)}")
    say(f"Written: {folder / 'report.html'}, validation.json")


def _with_loads(reading: Reading, files: list[Path], wanted: list[str]) -> list[Recording]:
    """Return recordings with all their channels where those are read as well, as loads are."""
    recordings = reading.read(files, wanted, informative=False)
    try:
        whole = reading.read(files, None, informative=False)
    except DataError:
        return recordings
    alike = [len(one) for one in whole] == [len(one) for one in recordings]
    return whole if alike and all(set(wanted) <= set(one.channels) for one in whole) else recordings
