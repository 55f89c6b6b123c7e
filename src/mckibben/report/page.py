"""The report of a study: one HTML file that needs nothing but itself."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mckibben.comparison.channels import any_moves, held_at_levels
from mckibben.recording import notes_by_file, reading_notes
from mckibben.report import (
    check_subjects,
    coupling_subjects,
    description_subjects,
    interactive,
    model_subjects,
    review_subjects,
    subjects,
    templating,
    words,
)
from mckibben.report.drawing import N_COLOURS, POINTS, Drawing, series_colour
from mckibben.report.shown import Shown, drawn, shown, unique

if TYPE_CHECKING:
    from mckibben.comparison.leaderboard import Leaderboard, Row
    from mckibben.diagnosis.check import OutputCheck
    from mckibben.recording import Recording
    from mckibben.studying.study import Study

N_VALUES = 180_000
"""Numbers in all plots together, so that the file stays under 6 MB beside plotly.js."""

MOST_CHECKED = 3
"""Outputs whose residuals have figures of their own."""

LEAD_POINTS = 1500
"""Points of a curve on the first screen."""

FEWEST_POINTS = 400
"""Points left to a curve at least, however many curves there are."""

Plots = dict[str, list[list[interactive.Json]]]
"""Figure -> for each recording shown, or once for all -> its plots side by side."""


def write_report(study: Study, path: str | Path) -> None:
    """Write the report of a study as one HTML file that opens without a network.

    Parameters
    ----------
    study : Study
        What was found.
    path : path
        File to write; a failure on the way leaves what was there before.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    from mckibben.system.atomic import write_text

    write_text(path, page(study))


def page(study: Study, command: str = "", *, title: str = "") -> str:
    """Return the report of a study as HTML, with how it is repeated, and its title."""
    from mckibben.report.columns import columns_of_board
    from mckibben.report.commands import commands

    every = shown(study)
    pictured = drawn(every)
    figures, left_out = _figures(study, pictured)
    measured = [one.recording for one in unique(every)]
    coupled = _coupled(study, measured)
    fullest = coupling_subjects.fullest(measured, study.leaderboard.inputs)
    if coupled is not None:
        figures["coupling"] = [interactive.plots(coupling_subjects.matrix(fullest, coupled))]
    return templating.page(
        "report.html.j2",
        figures,
        study=study,
        board=study.leaderboard,
        source=pictured[0].recording.origin,
        shown=unique(every),
        listed_drawn=unique(pictured),
        drawn=pictured,
        left_out=left_out,
        models=_models(study.leaderboard),
        explained=_explained(study.leaderboard),
        coupling=coupled,
        coupling_of=fullest.name,
        bars=_bars(study.leaderboard),
        columns=columns_of_board(study.leaderboard),
        words=words,
        reading=notes_by_file(measured),
        notes=[note for note in study.notes if note not in reading_notes(measured)],
        versions=templating.versions(),
        command=command,
        title=title,
        commands=commands(study, command),
        answers=words.answers(study),
        checked=checked(study),
        description=study.description,
        review=study.review,
        reviewed=[] if study.review is None else words.reviewed(study.review),
    )


def _figures(study: Study, pictured: tuple[Shown, ...]) -> tuple[Plots, str]:
    """Return the plots of every figure, and which weights are left out."""
    n_models = min(N_COLOURS, len(study.predictions))
    # A recording has two panels over time and its loop, then each model in four panels more.
    n_values = len(pictured) * 2 * (5 + 4 * n_models)
    points = max(FEWEST_POINTS, min(POINTS, N_VALUES // n_values))

    def each(draw: Callable[[Shown], Drawing]) -> list[list[interactive.Json]]:
        return [interactive.plots(draw(one)) for one in pictured]

    figures: Plots = {
        "time": each(
            lambda one: subjects.time_course([one.recording], (one.input, one.output), points)
        ),
        "loop": each(lambda one: subjects.loop([one.recording], one.input, one.output, points)),
    }
    if n_models:
        figures["leaderboard"] = [interactive.plots(model_subjects.leaderboard(study.leaderboard))]
        figures["fit"] = each(
            lambda one: subjects.fit_over_time(
                one.recording, one.output, one.outputs, one.test_from, points
            )
        )
        figures["loops"] = each(
            lambda one: subjects.fit_loops(
                one.recording, one.input, one.output, one.outputs, points
            )
        )
        figures["residuals"] = each(
            lambda one: subjects.residuals(
                one.recording, one.input, one.output, one.outputs, one.test_from, points
            )
        )
    figures["lead"] = [interactive.plots(_lead(pictured[0], study.leaderboard.inputs))]
    if study.load is not None and all(study.load in one.recording.channels for one in pictured):
        load = study.load
        runs = [one.recording for one in pictured]
        held = held_at_levels(runs, load)
        figures["levels"] = each(
            lambda one: coupling_subjects.loop_by(
                runs if held else [one.recording], one.input, one.output, load, points
            )
        )[: 1 if held else None]
    blocks = {row.model: row.block for row in study.leaderboard.rows if row.block is not None}
    left_out = ""
    if any(any(model_subjects.operator_sums(block)) for block in blocks.values()):
        drawing = model_subjects.weights(blocks)
        figures["weights"], left_out = [interactive.plots(drawing)], drawing.note
    if study.description is not None:
        figures |= description_subjects.figures(study.description)
    for one in checked(study):
        patterns = [
            interactive.plots(check_subjects.pattern(one, each))[0] for each in one.patterns
        ]
        figures[f"patterns {one.output}"] = [patterns]
        drawing = check_subjects.autocorrelation(one)
        figures[f"autocorrelation {one.output}"] = [interactive.plots(drawing)]
    if study.inverse is not None and study.inverse.reachable is not None:
        timed = study.train[0].sample_time is not None
        figures["inverse"] = [interactive.plots(model_subjects.inverse_check(study.inverse, timed))]
    for followed in () if study.review is None else study.review.outputs:
        figures[f"review {followed.output}"] = [
            interactive.plots(review_subjects.parts(followed, points))
        ]
    for name in study.leaderboard.outputs if study.loops else ():
        drawing = model_subjects.tracking(study.loops, name, points)
        figures[f"tracking {name}"] = [interactive.plots(drawing)]
    return figures, left_out


def _lead(one: Shown, inputs: Sequence[str]) -> Drawing:
    """Draw the measured loop with the chosen model's, or from early to late where there is none.

    Where several inputs move, a path over one of them is no loop: that is drawn over time.
    """
    moving = [name for name in inputs if any_moves([one.recording], (name,))]
    best = dict(list(one.outputs.items())[:1])
    if len(moving) > 1 and one.recording.sample_time is not None:
        return subjects.fit_over_time(one.recording, one.output, best, one.test_from, LEAD_POINTS)
    if not best:
        return subjects.loop([one.recording], one.input, one.output, LEAD_POINTS)
    return subjects.fit_loops(one.recording, one.input, one.output, best, LEAD_POINTS)


def _coupled(study: Study, recordings: list[Recording]) -> coupling_subjects.Coupling | None:
    """Return how inputs move outputs of all recordings, where there are several."""
    inputs, outputs = study.leaderboard.inputs, study.leaderboard.outputs
    if not recordings or len(inputs) == len(outputs) == 1:
        return None
    return coupling_subjects.coupling(recordings, inputs, outputs)


def _explained(board: Leaderboard) -> dict[str, str]:
    """Return the full name of every model of a leaderboard and what it can; nothing of unknown ones."""
    from mckibben import registry
    from mckibben.estimators.catalogue import summary

    known = registry.names("estimators")
    return {row.model: summary(row.model) for row in board.ranking if row.model in known}


def checked(study: Study) -> tuple[OutputCheck, ...]:
    """Return what the chosen model leaves of the first outputs, where that was checked."""
    return () if isinstance(study.check, str | None) else study.check.outputs[:MOST_CHECKED]


def _models(board: Leaderboard) -> list[dict[str, str]]:
    """Return the models that figures show, the chosen one first, each with its colour."""
    ranked = [row.model for row in board.rows if row.reason is None][:N_COLOURS]
    return [{"name": name, "colour": series_colour(place)} for place, name in enumerate(ranked)]


def _bars(board: Leaderboard) -> dict[str, dict[str, float]]:
    """Return for each model its test RMSE and interval as percentages of the widest."""

    def ends(row: Row) -> tuple[float, float]:
        rmse = 0.0 if row.test is None else row.test.rmse
        return row.rmse_interval or (rmse, rmse)

    scored = [row for row in board.rows if row.test is not None]
    widest = max((ends(row)[1] for row in scored), default=1.0) or 1.0
    bars: dict[str, Any] = {}
    for row in scored:
        low, high = ends(row)
        middle = 0.0 if row.test is None else row.test.rmse
        bars[row.model] = {
            "low": 100 * low / widest,
            "high": 100 * high / widest,
            "middle": 100 * middle / widest,
        }
    return bars
