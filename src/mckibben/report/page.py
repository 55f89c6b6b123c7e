"""Report of a study as a page."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mckibben.channels import any_moves
from mckibben.diagnosis.check import Validation
from mckibben.diagnosis.coupling import coupling
from mckibben.recording import notes_by_file, reading_notes
from mckibben.report import (
    interactive,
    model_subjects,
    results,
    subjects,
    words,
)
from mckibben.report.builder import (
    Code,
    Figure,
    Page,
    Section,
    Table,
    Text,
    Variants,
)
from mckibben.report.commands import commands
from mckibben.report.drawing import N_COLOURS, POINTS, Drawing, series_colour
from mckibben.report.modelled_runs import (
    ModelledRun,
    each_recording_once,
    runs_of_study,
    runs_with_figures,
)

if TYPE_CHECKING:
    from mckibben.comparison.leaderboard import Leaderboard
    from mckibben.recording import Recording
    from mckibben.studying.study import Study

N_VALUES = 180_000
"""Largest number of values in all plots together, which limits the file to 6 MB plus plotly.js."""

FEWEST_POINTS = 400
"""Points left to a curve at least, however many curves there are."""

COLUMNS = ("chosen", "test", "interval", "rank", "gap", "parameters", "inverse", "step")
"""Columns of the leaderboard on the page, in addition to those of each output; the files have all.
"""

MOST_CHECKED = 3
"""Outputs whose residuals have figures of their own."""


def write_report(study: Study, path: str | Path, *, title: str = "") -> None:
    """Write the report of a study as one HTML file that opens without a network.

    Parameters
    ----------
    study : Study
        What was found.
    path : path
        File to write; a failure on the way leaves what was there before.
    title : str
        Of the page; default the recording's name.
    """
    from mckibben.system.atomic import write_text

    write_text(path, page(study, title=title))


def page(study: Study, command: str = "", *, title: str = "") -> str:
    """Return the report of a study as HTML, with the commands that repeat it, and its title."""
    board, runs = study.leaderboard, runs_of_study(study)
    drawn_runs = runs_with_figures(runs)
    first = drawn_runs[0]
    n_models = min(N_COLOURS, len(study.predictions))
    n_values = len(drawn_runs) * 2 * (3 + 3 * n_models)
    view = _View(drawn_runs, max(FEWEST_POINTS, min(POINTS, N_VALUES // n_values)))
    sections = (
        _review(study, view.points),
        Section("leaderboard", "Leaderboard", results.leaderboard(board, COLUMNS)),
        _model(study, view),
        _checks(study, view),
        _recordings(study, runs, view),
        _method(study, command),
    )
    names = [run.recording.name for run in each_recording_once(drawn_runs)]
    more = len(each_recording_once(runs)) - len(names)
    return Page(
        title
        or f"{study.output} over {study.input if first.several else first.input}".capitalize(),
        f"{', '.join(names)}{f' and {more} more' if more else ''}",
        [run for run in sections if run is not None],
        results.tiles(study),
        _lead(first, board),
        words.answers(study),
    ).html()


class _View:
    """The recordings drawn, and the number of points."""

    def __init__(self, pictured: Sequence[ModelledRun], points: int) -> None:
        self.pictured, self.points = pictured, points
        self.names = [f"{one.name} ({one.role})" for one in pictured]

    def each(self, draw: Callable[[ModelledRun], Drawing]) -> Variants:
        """Return a figure for every recording."""
        return [interactive.plots(draw(one)) for one in self.pictured]


def _lead(run: ModelledRun, board: Leaderboard) -> Figure:
    """Return the measured loop with the chosen model's; over time for several inputs."""
    moving = [name for name in board.inputs if any_moves([run.recording], (name,))]
    best = next(iter(run.outputs), None)
    caption = run.name + (f", and {best} running free" if best else "")
    if best is None:
        drawing = subjects.loop([run.recording], run.input, run.output)
    else:
        timed = len(moving) > 1 and run.recording.sample_time is not None
        drawing = run.draw("fit" if timed else "loops", models=1)
    return Figure("lead", [interactive.plots(drawing)], "Loop, measured and modelled", caption)


def _review(study: Study, points: int) -> Section | None:
    if study.review is None:
        return None
    return Section("review", "Closed loop", results.review(study.review, points))


def _model(study: Study, view: _View) -> Section | None:
    board = study.leaderboard
    if not study.predictions:
        return None
    ranked = [row.model for row in board.rows if row.reason is None][:N_COLOURS]
    fit = view.each(lambda run: run.draw("fit", view.points))
    items: list[Any] = [Figure("fit", fit, "Measured and modelled output over time", toggled=True)]
    if study.description is not None:
        items += results.description(study.description)
    name = "Model" if board.best is None else f"Model: {board.best.model}"
    models = [{"name": run, "colour": series_colour(k)} for k, run in enumerate(ranked)]
    return Section("model", name, items, view.names, models)


def _checks(study: Study, view: _View) -> Section | None:
    board, items = study.leaderboard, list[Any]()
    if study.predictions:
        residuals = view.each(lambda run: run.draw("residuals", view.points))
        label = "Residuals over input and over time"
        items.append(Figure("residuals", residuals, label, "", "", 2, toggled=True))
    if isinstance(study.check, Validation):
        for run in study.check.outputs[:MOST_CHECKED]:
            items += results.checked(run)
    if sentences := words.compensated(study):
        items.append(Text(sentences, "note", listed=True))
    if study.inverse is not None:
        drawing = model_subjects.inverse_check(study.inverse.check)
        caption = f"A random motion of {study.inverse.model}, and the model behind its inverse."
        items.append(Figure("inverse", [interactive.plots(drawing)], caption, caption, "tall"))
    if study.loops:
        items.append(Text([f"A measured motion, followed on the virtual rig {study.plant}."]))
        items += results.loops(study.loops)
        for name in board.outputs:
            drawing = model_subjects.tracking(study.loops, name, view.points)
            label = f"Reference and followed {name}"
            items.append(
                Figure(f"tracking {name}", [interactive.plots(drawing)], label, f"{label}.")
            )
    elif study.not_looped:
        items.append(Text([words.not_looped(study)]))
    return Section("checks", "Checks", items, view.names) if items else None


def _recordings(study: Study, runs: Sequence[ModelledRun], view: _View) -> Section:
    board = study.leaderboard
    rows = [
        [run.recording.name, run.recording.source or "–", words.duration(run.recording), run.role]
        for run in each_recording_once(runs)
    ]
    measured = [run.recording for run in each_recording_once(runs)]
    time = view.each(
        lambda run: subjects.time_course([run.recording], (run.input, run.output), view.points)
    )
    items: list[Any] = [
        Table(["Recording", "File", "Length", "Used to"], rows),
        Figure("time", time, "Input and output over time", "", "stacked"),
    ]
    items += results.data_gaps(study.data_gaps)
    if study.characterization is not None:
        items += results.characterization(study.characterization)
    if not (len(board.inputs) == len(board.outputs) == 1):
        items.append(_coupling(board, measured))
    notes = [f"{file}: {'; '.join(texts)}." for file, texts in notes_by_file(measured).items()]
    notes += [note for note in study.notes if note not in reading_notes(measured)]
    items.append(Text(notes, "note", listed=True) if notes else None)
    return Section("recordings", "Recordings", items, view.names)


def _coupling(board: Leaderboard, recordings: Sequence[Recording]) -> Table:
    """Return the effects of several inputs on outputs."""
    effects = coupling(list(recordings), board.inputs, board.outputs)
    rows: list[list[Any]] = [
        [f"{output} [{effects.units[k]}]", *effects.effects[k].tolist(), 100 * effects.explained[k]]
        for k, output in enumerate(effects.outputs)
    ]
    return Table(["Effect of the whole range of", *effects.inputs, "explained [%]"], rows)


def _method(study: Study, command: str) -> Section:
    board = study.leaderboard
    facts = f"{board.n_train} samples to fit, {board.n_test} to test; seed {board.seed}."
    lines = [Code(what, line) for what, line in commands(study, command)]
    return Section("method", "How to repeat", [Text([facts]), *lines])
