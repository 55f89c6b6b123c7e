"""Results as lines of text, for a terminal."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from mckibben.numerals import numeral
from mckibben.report import words

if TYPE_CHECKING:
    from mckibben.comparison.leaderboard import Leaderboard
    from mckibben.diagnosis.bands import Calibration
    from mckibben.diagnosis.characterization import Characterization
    from mckibben.diagnosis.check import Validation
    from mckibben.planning.planner import Plan
    from mckibben.studying.study import Study
    from mckibben.workflow import Fit, Inverse, Tracking

STARTS_MATTER = 0.05
"""Relative difference of the errors from rest and from fitted starts from which both are given."""

BOARD = ("chosen", "test", "interval", "rank", "gap")
"""Columns of a leaderboard for a terminal of 80; the files have the rest."""

MOST = 12
"""Parameters of a plan that are listed."""


def table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table as wide as the terminal; numbers are aligned right, words left."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    found = Table(box=None, pad_edge=False, header_style="bold")
    for index, heading in enumerate(headings):
        cells = [row[index] for row in rows if row[index] not in ("", "-", "–")]
        right = index > 0 and 2 * sum(bool(re.match(r"[-−+]?\d", c)) for c in cells) > len(cells)
        side: Any = "right" if right else "left"
        found.add_column(Text(heading), justify=side, overflow="fold")
    for row in rows:
        found.add_row(*(Text(cell) for cell in row))
    console = Console() if sys.stdout is not None and sys.stdout.isatty() else Console(width=200)
    with console.capture() as printed:
        console.print(found)
    return "\n".join(line.rstrip() for line in printed.get().splitlines())


def fit(found: Fit) -> Iterator[str]:
    """Return errors and parameters of a model that was fitted."""
    about, model = found.to_dict(), found.estimator.model_
    unit = model.outputs[0].unit
    stopped = " (interrupted: the best until then)" if about["interrupted"] else ""
    yield (
        f"{found.name}: free-running RMSE {numeral(about['rmse'], 4)} {unit} on "
        f"{about['n_samples']} samples, {about['n_parameters']} parameters, "
        f"{about['seconds']:.2f} s{stopped}"
    )
    if len(about["rmse_by_output"]) > 1:
        errors = [f"{k} {numeral(v, 4)} {unit}" for k, v in about["rmse_by_output"].items()]
        yield f"Mean of {', '.join(errors)}."
    if abs(about["rmse_from_rest"] - about["rmse"]) > STARTS_MATTER * about["rmse"]:
        yield (
            "Every recording starts from its fitted state; from rest, as streams and generated code "
            f"start, the RMSE is {numeral(about['rmse_from_rest'], 4)} {unit}."
        )
    if found.estimator.errors_known:
        keys = ("parameter_names", "parameters", "standard_errors", "parameter_units")
        yield table(
            ("parameter", "value", "standard error", "unit"),
            [
                (name, numeral(value, 4), "–" if math.isnan(error) else numeral(error, 2), measure)
                for name, value, error, measure in zip(*(about[key] for key in keys), strict=True)
            ],
        )
    if about["undetermined"]:
        yield f"Not determined by these recordings: {'; '.join(about['undetermined'])}."


def leaderboard(board: Leaderboard) -> Iterator[str]:
    """Return a leaderboard as a table, what is chosen, and what failed."""
    from mckibben.report.columns import columns_of_board

    columns = [column for column in columns_of_board(board) if column.key in BOARD]
    rows = []
    for row in board.ranking:
        if row.test is not None:
            given = row.to_dict()
            level = " ≈" if row.model in board.level else ""
            name = row.model + level + ("*" if row.caution else "")
            rows.append([name, *(column.text(given) for column in columns)])
    yield f"Split: {board.split}."
    yield table(["model", *(column.label for column in columns)], rows)
    yield f"All errors are free-run simulation errors. {words.STARTED}"
    if board.level:
        yield f"≈ {words.LEVEL}."
    if said := words.chosen(board):
        yield said
    if any(row.reason is None and row.caution for row in board.rows):
        yield f"* {words.CAREFUL[0].upper()}{words.CAREFUL[1:]}."
    yield from words.not_validated(board)
    for reason, models in board.failures.items():
        yield f"{', '.join(models)}: failed, {reason}"
    for note in (*board.notes, *words.comparison(board)):
        yield f"Note: {note}"
    if board.left_out:
        yield f"{len(board.left_out)} models do not apply to these channels."


def study_begun(found: Study) -> Iterator[str]:
    """Return what the muscle and a loop do, before any model is fitted."""
    if found.characterization is not None:
        yield from words.characterization_sentences(found.characterization)
    if found.review is not None:
        yield from words.reviewed(found.review)


def study(found: Study) -> Iterator[str]:
    """Return the leaderboard, the three answers, and the inverse."""
    yield from leaderboard(found.leaderboard)
    yield ""
    for question, answer in words.answers(found):
        yield f"{question} {answer}"
    if said := words.inverse(found):
        yield said
    if found.not_looped:
        yield f"No loop was closed: {found.not_looped}"
    for name, tracked in found.loops.items():
        errors = ", ".join(numeral(error, 2) for error in tracked.rmse.values())
        yield f"{name} on {found.plant}: RMSE {errors} {found.leaderboard.unit}."


def characterization(found: Characterization) -> Iterator[str]:
    """Return what a muscle does, in words and numbers."""
    yield from words.characterization_sentences(found)
    yield ""
    yield table(
        ["quantity", "value", "95 % interval", "unit"],
        [
            [name, _cell(value), " to ".join(map(_cell, limits or ())), unit]
            for name, value, limits, unit, _ in words.characterization_rows(found)
            if value is not None
        ],
    )


def _cell(value: object) -> str:
    return numeral(value, 4) if isinstance(value, float) else ("-" if value is None else str(value))


def check(found: Validation) -> Iterator[str]:
    """Return whether a model is right, and what it misses."""
    yield words.check_verdict(found)
    for sentence in words.check_sentences(found):
        yield f"- {sentence}"
    if found.untested:
        yield f"Too short to be tested: {', '.join(found.untested)}"


def calibration(found: Calibration) -> Iterator[str]:
    """Return how wide bands are."""
    yield from words.calibrated(found)


def tracking(found: Tracking) -> Iterator[str]:
    """Return how a reference was followed, with and without compensation."""
    tracked, without, chosen = found.tracked, found.uncompensated.tracked, found.options
    measure = tracked.recording.units[next(iter(tracked.rmse))]
    ways = [(chosen.controller, tracked), ("no compensation", without)]
    rows = [
        [name, way, numeral(one.rmse[name], 3), numeral(one.largest[name], 3)]
        for name in tracked.rmse
        for way, one in ways
        if one is not None
    ]
    for note in found.notes:  # before what they put in doubt
        yield f"Note: {note}"
    yield table(["channel", "controller", f"RMSE [{measure}]", f"largest [{measure}]"], rows)
    kind = "virtual rig" if chosen.rig is not None else "model"
    yield f"Plant: {found.plant.name} ({kind}), seed {chosen.seed}."
    for name, size in tracked.scatter.items():
        yield f"The plant's own scatter of {name}: {numeral(size, 3)} {measure} RMS."
    if tracked.clipped >= len(tracked.recording):
        yield "Commands were at a limit throughout: the reference is out of reach."
    elif tracked.clipped > max((far.samples for far in tracked.beyond.values()), default=0):
        cost = f"; RMSE there is {numeral(tracked.clipping_cost, 3)} {measure} higher"
        yield f"Commands were at a limit in {tracked.clipped} steps{cost * (tracked.clipping_cost > 0)}."
    for name, far in tracked.beyond.items():
        yield (
            f"{far.samples} samples of the reference {name} are out of reach ({numeral(far.low, 4)} "
            f"to {numeral(far.high, 4)} {measure}); RMSE over the others: "
            f"{numeral(far.rmse_elsewhere, 3)} {measure}."
        )
    median, largest = (1e6 * one for one in tracked.step_time)
    yield f"Controller: {median:.0f} µs a step (median), {largest:.0f} µs (99.9 %)."


def inverse(found: Inverse) -> Iterator[str]:
    """Return what an inverse takes, gives and reaches."""
    block = found.block
    yield f"{_listed(block.outputs)} from {_listed(block.inputs)}."
    units = {channel.name: channel.unit for channel in (*block.inputs, *block.outputs)}
    for name, (low, high) in found.reachable.items():
        yield (
            f"Reachable whatever happened before: {name} {numeral(low, 5)} to {numeral(high, 5)} "
            f"{units.get(name, '')}; references beyond are clipped."
        )
    if found.kind in ("inverse", "adaptive") and not found.reachable:
        yield "What can be reached depends on load, past or other muscles; track states what was clipped."
    for name, error in found.rmse.items():
        yield f"{name}: RMSE {numeral(error, 4)} {units[name]} on the recordings."
    if block.samples_ahead:
        yield f"Give it every reference {block.samples_ahead} samples before it is due; track does."


def _listed(channels: Sequence[Any]) -> str:
    return ", ".join(f"{channel.name} [{channel.unit}]" for channel in channels)


def plan(found: Plan) -> Iterator[str]:
    """Return the steps of a plan, and the standard errors to expect."""
    yield table(
        ["seconds", "what", "closes"],
        [
            [f"{one.start:.0f} to {one.stop:.0f}", one.what, ", ".join(one.gaps) or "-"]
            for one in found.steps
        ],
    )
    shown = sorted(found.parameters, key=lambda one: one.after or 0.0, reverse=True)[:MOST]
    if shown:
        yield table(
            ["parameter", "value", "standard error now", "with the plan"],
            [
                [one.name, f"{one.value:.4g}", *(_percent(x) for x in (one.now, one.after))]
                for one in shown
            ],
        )
    yield from words.plan_sentences(found)


def _percent(share: float | None) -> str:
    return "-" if share is None else "over 100 %" if share > 1 else f"{numeral(100 * share, 2)} %"
