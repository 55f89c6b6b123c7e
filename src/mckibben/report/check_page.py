"""The page of a check, and its numbers as JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mckibben.numerals import percent
from mckibben.recording import notes_by_file
from mckibben.report import interactive, model_subjects, words
from mckibben.report.builder import Figure, Page, Section, Table, Text, Tile
from mckibben.report.description_page import model_items
from mckibben.report.figures import on_recording
from mckibben.report.shown import Shown
from mckibben.system.atomic import to_json

if TYPE_CHECKING:
    from mckibben.diagnosis.check import OutputCheck, Validation
    from mckibben.diagnosis.free_runs import Run
    from mckibben.outputs import Results

MOST_RECORDINGS = 4
"""Recordings with figures of their own: the longest."""

MOST_OUTPUTS = 6
"""Outputs with figures of their own; the others have their numbers."""


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
    results.write_text("report.html", check_page(found, model_file))


def check_page(found: Validation, model_file: str) -> str:
    """Return a check as HTML; ``model_file`` is where the model was read from."""
    longest = sorted(found.runs, key=lambda run: -len(run.inputs))[:MOST_RECORDINGS]
    runs = [run for run in found.runs if run in longest]
    names = [run.recording.name for run in runs]
    sections = [
        Section(f"output-{k}", f"Residual of {one.output}", _output(one, k, runs), names)
        for k, one in enumerate(found.outputs)
    ]
    if found.description is not None:
        sections.append(Section("model", "Model", model_items(found.description)))
    untested = [f"Too short to be tested: {', '.join(found.untested)}."] * bool(found.untested)
    more = len(found.recordings) - 6
    listed = ", ".join(found.recordings[:6]) + (f" and {more} more" if more > 0 else "")
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
            for k, one in enumerate(found.outputs[:4])
        ],
        answers=[("Is it right?", words.check_verdict(found, sized=False))],
    ).html()


def _output(one: OutputCheck, place: int, runs: list[Run]) -> list[Any]:
    """Return what a page shows of an output: what is missed, residuals, and all tests."""
    missing = [
        [words.missed(one, each), f"{100 * each.share:.2g}", each.size, _p(each.p_value)]
        for each in one.missing
    ]
    items: list[Any] = [Text(words.check_notes(one))]
    if missing:
        headings = ["Missed", "Share of the variance [%]", f"RMS [{one.unit}]", "p"]
        items.append(Table(headings, missing))
    if place < MOST_OUTPUTS:
        first, fits, residuals = one.patterns[0].channel, [], []
        for run in runs:
            about = Shown(
                run.recording, first, one.output, {"model": run.modelled[:, place]}, "test"
            )
            fits.append(interactive.plots(on_recording(about, "fit")))
            residuals.append(interactive.plots(on_recording(about, "residuals")))
        panels = [interactive.plots(model_subjects.pattern(one, each))[0] for each in one.patterns]
        white = [interactive.plots(model_subjects.autocorrelation(one))]
        items += [
            Figure(f"fit-{place}", fits, "Measured and modelled output over time"),
            Figure(
                f"residuals-{place}",
                residuals,
                "Residuals over input and over time",
                "",
                columns=2,
            ),
            Figure(
                f"patterns-{place}",
                [panels],
                "Mean residuals with intervals",
                "Mean residuals, with 95 % intervals that allow for autocorrelation.",
                columns=2,
            ),
            Figure(
                f"autocorrelation-{place}",
                white,
                "Autocorrelation of the residual",
                "Autocorrelation of the residual; band: white noise.",
            ),
        ]
    tests = [
        [words.missed(one, each), f"{100 * each.share:.2g}", _p(each.p_value)]
        for each in one.suspects
    ]
    items.append(Table(["Test", "Share of the variance [%]", "p"], tests, summary="All tests"))
    return items


def _p(value: float | None) -> str:
    return "–" if value is None else "< 0.000001" if value < 1e-6 else f"{value:.2g}"
