"""The page of a check: one HTML file that needs nothing but itself."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mckibben.diagnosis.check import LEVEL
from mckibben.recording import notes_by_file
from mckibben.report import (
    check_subjects,
    description_subjects,
    interactive,
    subjects,
    templating,
    words,
)
from mckibben.system.atomic import to_json

if TYPE_CHECKING:
    from mckibben.diagnosis.check import Validation
    from mckibben.diagnosis.description import ModelDescription
    from mckibben.outputs import Results

MOST_RECORDINGS = 4
"""Recordings with figures of their own: the longest."""

MOST_OUTPUTS = 6
"""Outputs with figures of their own; the others have their numbers."""

MODEL = "model"


def check_json(found: Validation, model_file: str) -> dict[str, Any]:
    """Return a check with its verdict in words, for JSON."""
    return found.to_dict() | {
        "verdict": words.check_verdict(found),
        "sentences": words.check_sentences(found),
        "model_file": model_file,
        "notes_of_reading": notes_by_file([run.recording for run in found.runs]),
    }


def write_check(results: Results, found: Validation, model_file: str) -> None:
    """Write ``validation.json`` and ``report.html``."""
    results.write_text("validation.json", to_json(check_json(found, model_file)) + "\n")
    if found.description is not None:
        results.write_text("report.html", check_page(found, found.description, model_file))


def check_page(found: Validation, description: ModelDescription, model_file: str) -> str:
    """Return a check as HTML.

    Parameters
    ----------
    found : Validation
    description : ModelDescription
        Of the same model, on the same recordings.
    model_file : str
        Where the model was read from, to say so.
    """
    longest = sorted(found.runs, key=lambda run: -len(run.inputs))[:MOST_RECORDINGS]
    runs = [run for run in found.runs if run in longest]
    figures: dict[str, list[list[interactive.Json]]] = {}
    for place, one in enumerate(found.outputs[:MOST_OUTPUTS]):
        figures[f"autocorrelation-{place}"] = [
            interactive.plots(check_subjects.autocorrelation(one))
        ]
        panels = [interactive.plots(check_subjects.pattern(one, each))[0] for each in one.patterns]
        figures[f"patterns-{place}"] = [panels]
        first = one.patterns[0].channel
        figures[f"fit-{place}"], figures[f"residuals-{place}"] = [], []
        for run in runs:
            outputs = {MODEL: run.modelled[:, place]}
            about = (run.recording, one.output, outputs)
            figures[f"fit-{place}"].append(interactive.plots(subjects.fit_over_time(*about)))
            drawing = subjects.residuals(run.recording, first, one.output, outputs)
            figures[f"residuals-{place}"].append(interactive.plots(drawing))
    return templating.page(
        "check.html.j2",
        figures | description_subjects.figures(description),
        found=found,
        description=description,
        model_file=model_file,
        drawn=runs,
        words=words,
        level=LEVEL,
        versions=templating.versions(),
    )
