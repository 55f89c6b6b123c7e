"""Page and JSON of a model check."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mckibben.numerals import percent
from mckibben.recording import notes_by_file
from mckibben.report import interactive, model_subjects, results, words
from mckibben.report.builder import Figure, Item, Page, Section, Text, Tile
from mckibben.report.modelled_runs import ModelledRun
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


def check_json(validation: Validation, model_file: str) -> dict[str, Any]:
    """Return a check with its verdict in words, for JSON."""
    return validation.to_dict() | {
        "verdict": words.check_verdict(validation),
        "sentences": [
            sentence for check in validation.outputs for sentence in words.check_notes(check)
        ],
        "model_file": model_file,
        "notes_of_reading": notes_by_file([run.source for run in validation.runs]),
    }


def write_check(folder: Results, validation: Validation, model_file: str) -> None:
    """Write ``validation.json`` and ``report.html``."""
    folder.write_text("validation.json", to_json(check_json(validation, model_file)) + "\n")
    folder.write_text("report.html", check_page(validation, model_file))


def check_page(validation: Validation, model_file: str) -> str:
    """Return a check as HTML; ``model_file`` is the path of the model."""
    longest = sorted(validation.runs, key=lambda run: -len(run))[:MOST_RECORDINGS]
    runs = [run for run in validation.runs if run in longest]
    names = [run.name for run in runs]
    sections = [
        Section(f"output-{k}", f"Residual of {check.output}", _output(check, k, runs), names)
        for k, check in enumerate(validation.outputs)
    ]
    if validation.description is not None:
        sections.append(Section("model", "Model", results.description(validation.description)))
    untested = [f"Too short to be tested: {', '.join(validation.untested)}."] * bool(
        validation.untested
    )
    more = len(validation.recordings) - MOST_NAMED
    listed = ", ".join(validation.recordings[:MOST_NAMED]) + (
        f" and {more} more" if more > 0 else ""
    )
    return Page(
        f"Check of {validation.model}",
        f"{model_file}, running free on {listed}",
        [Section("untested", "", [Text(untested)]), *sections],
        [
            Tile(
                f"Residual of {check.output}",
                words.size(check.unit, check.rmse),
                f"RMS, {percent(check.rmse / check.span)} of its range" if check.span else "RMS",
                f"output-{k}",
            )
            for k, check in enumerate(validation.outputs[:MOST_TILES])
        ],
        answers=[("Is it right?", words.check_verdict(validation, sized=False))],
    ).html()


def _output(check: OutputCheck, place: int, runs: list[FreeRun]) -> list[Item]:
    """Return the items of an output: its tests, then figures over time and of the autocorrelation.

    ``place`` is that of the output in the model; from `MOST_OUTPUTS` on there are no figures.
    """
    items = results.checked(check)
    if place >= MOST_OUTPUTS:
        return items
    runs_drawn = [
        ModelledRun(
            run.source, check.patterns[0].channel, check.output, {"model": modelled}, "test"
        )
        for run in runs
        for modelled in [run.modelled[:, place]]
    ]
    labels = {
        "fit": "Measured and modelled output over time",
        "residuals": "Residuals over input and over time",
    }
    figures: list[Item] = []
    for kind, label in labels.items():
        plots = [interactive.plots(run_drawn.draw(kind)) for run_drawn in runs_drawn]
        figures.append(Figure(f"{kind}-{place}", plots, label, columns=len(plots[0])))
    whiteness = [interactive.plots(model_subjects.autocorrelation(check))]
    label = "Autocorrelation of the residual"
    figures.append(
        Figure(
            f"autocorrelation-{place}",
            whiteness,
            label,
            f"{label}; band: white noise.",
        )
    )
    return [*items, *figures]
