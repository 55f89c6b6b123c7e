"""Page and JSON of a model check."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mckibben.numerals import percent
from mckibben.recording import notes_by_file
from mckibben.report import interactive, model_subjects, results, words
from mckibben.report.builder import Figure, Item, Page, Section, Text, Tile
from mckibben.report.shown import Shown
from mckibben.system.atomic import to_json

if TYPE_CHECKING:
    from mckibben.blocks.runs import FreeRun
    from mckibben.diagnosis.check import OutputCheck, Validation
    from mckibben.outputs import Results

MOST_RECORDINGS = 4
"""Recordings with figures of their own: the longest."""

MOST_OUTPUTS = 6
"""Outputs with figures of their own; the others have their numbers."""

MOST_NAMED = 6
"""Recordings named in the subtitle; the others are counted."""

MOST_TILES = 4
"""Outputs whose residual is a tile at the top of the page."""


def check_json(found: Validation, model_file: str) -> dict[str, Any]:
    """Return a check with its verdict in words, for JSON."""
    return found.to_dict() | {
        "verdict": words.check_verdict(found),
        "sentences": [said for one in found.outputs for said in words.check_notes(one)],
        "model_file": model_file,
        "notes_of_reading": notes_by_file([run.source for run in found.runs]),
    }


def write_check(folder: Results, found: Validation, model_file: str) -> None:
    """Write ``validation.json`` and ``report.html``."""
    folder.write_text("validation.json", to_json(check_json(found, model_file)) + "\n")
    folder.write_text("report.html", check_page(found, model_file))


def check_page(found: Validation, model_file: str) -> str:
    """Return a check as HTML; ``model_file`` is the path of the model."""
    longest = sorted(found.runs, key=lambda run: -len(run))[:MOST_RECORDINGS]
    runs = [run for run in found.runs if run in longest]
    names = [run.name for run in runs]
    sections = [
        Section(f"output-{k}", f"Residual of {one.output}", _output(one, k, runs), names)
        for k, one in enumerate(found.outputs)
    ]
    if found.description is not None:
        sections.append(Section("model", "Model", results.description(found.description)))
    untested = [f"Too short to be tested: {', '.join(found.untested)}."] * bool(found.untested)
    more = len(found.recordings) - MOST_NAMED
    listed = ", ".join(found.recordings[:MOST_NAMED]) + (f" and {more} more" if more > 0 else "")
    return Page(
        f"Check of {found.model}",
        f"{model_file}, running free on {listed}",
        [Section("untested", "", [Text(untested)]), *sections],
        [
            Tile(
                f"Residual of {one.output}",
                words.size(one.unit, one.rmse),
                f"RMS, {percent(one.rmse / one.span)} of its range" if one.span else "RMS",
                f"output-{k}",
            )
            for k, one in enumerate(found.outputs[:MOST_TILES])
        ],
        answers=[("Is it right?", words.check_verdict(found, sized=False))],
    ).html()


def _output(one: OutputCheck, place: int, runs: list[FreeRun]) -> list[Item]:
    """Return the items of an output: its tests, then figures over time and of the autocorrelation.

    ``place`` is that of the output in the model; from `MOST_OUTPUTS` on there are no figures.
    """
    items = results.checked(one)
    if place >= MOST_OUTPUTS:
        return items
    about = [
        Shown(run.source, one.patterns[0].channel, one.output, {"model": modelled}, "test")
        for run in runs
        for modelled in [run.modelled[:, place]]
    ]
    labels = {
        "fit": "Measured and modelled output over time",
        "residuals": "Residuals over input and over time",
    }
    figures: list[Item] = []
    for kind, label in labels.items():
        drawn = [interactive.plots(each.draw(kind)) for each in about]
        figures.append(Figure(f"{kind}-{place}", drawn, label, columns=len(drawn[0])))
    white = [interactive.plots(model_subjects.autocorrelation(one))]
    label = "Autocorrelation of the residual"
    figures.append(Figure(f"autocorrelation-{place}", white, label, f"{label}; band: white noise."))
    return [*items, *figures]
