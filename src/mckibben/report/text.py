"""Results as lines of text, for a terminal."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from mckibben.numerals import numeral
from mckibben.recording import reading_notes
from mckibben.report import words

if TYPE_CHECKING:
    from mckibben.comparison.leaderboard import Leaderboard
    from mckibben.diagnosis.bands import Calibration
    from mckibben.diagnosis.characterization import Characterization
    from mckibben.diagnosis.check import Validation
    from mckibben.link.device import Device, State
    from mckibben.link.driving import Driven
    from mckibben.papers.experiment import Reproduction
    from mckibben.papers.paper import Paper
    from mckibben.planning.planner import Plan
    from mckibben.reading import Contents
    from mckibben.recording import Recording
    from mckibben.studying.results import Exported, Fit, Inverse, Tracking
    from mckibben.studying.simulating import Simulation
    from mckibben.studying.study import Study

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
    tracked, without = found.tracked, found.uncompensated.tracked
    measure = tracked.recording.units[next(iter(tracked.rmse))]
    ways = [(found.law, tracked), ("no compensation", without)]
    rows = [
        [name, way, numeral(one.rmse[name], 3), numeral(one.largest[name], 3)]
        for name in tracked.rmse
        for way, one in ways
        if one is not None
    ]
    for note in found.notes:  # before what they put in doubt
        yield f"Note: {note}"
    yield table(["channel", "controller", f"RMSE [{measure}]", f"largest [{measure}]"], rows)
    kind = "virtual rig" if found.virtual else "model"
    yield f"Plant: {found.plant.name} ({kind}), seed {found.seed}."
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
        yield "What can be reached depends on load, past or other muscles; track has what was clipped."
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


def exported(found: Exported) -> Iterator[str]:
    """Return what a self-test printed, and how many files were written."""
    yield from filter(None, (found.self_test, found.emulation))
    libraries = [name for name in found.files if name.startswith("binaries/")]
    yield from (f"Library: {name}" for name in libraries)
    yield f"{len(found.files)} files" + ("" if libraries else "; start with README.md")


def simulation(found: Simulation) -> Iterator[str]:
    """Return the errors of a model over a recording, and what its band holds."""
    ahead = "" if found.horizon is None else f", {found.horizon} samples ahead"
    for name, one in found.metrics.items():
        unit = found.recording.units[name]
        yield (
            f"{name}{ahead}: RMSE {numeral(one['rmse'], 4)}, MAE {numeral(one['mae'], 4)}, largest "
            f"{numeral(one['max_error'], 4)} {unit}, R² {numeral(one['r2'], 5)}"
        )
        if found.interval is not None:
            yield (
                f"{name}: {numeral(100 * one['coverage'], 3)} % of the samples are within the band for "
                f"{numeral(100 * found.interval, 3)} %, {numeral(one['band_width'], 3)} {unit} wide on "
                "average"
            )


def outside(found: Simulation) -> Iterator[str]:
    """Return where a run is beyond what its band was calibrated on."""
    for channel, share, samples, limits in found.outside:
        yield words.outside_calibration(found.recording.name, channel, share, samples, limits)


def models(every: Mapping[str, Any]) -> Iterator[str]:
    """Return what every model is, and its settings."""
    yield table(["model", "what it is"], [[name, one["summary"]] for name, one in every.items()])
    for name, one in every.items():
        listed = ", ".join(f"{key}={value}" for key, value in one["settings"].items())
        yield f"\n{name} settings (--set NAME=VALUE): {listed}"


def model(about: Mapping[str, Any]) -> Iterator[str]:
    """Return what a saved model is."""
    settable = ", ".join(f"{name}={value}" for name, value in about["settable"].items())
    rows = {**about, "settable": settable}.items()
    yield table(["", "value"], [[key, str(value)] for key, value in rows])


def contents(found: Contents) -> Iterator[str]:
    """Return the columns of files, the channels of recordings, and what these cannot identify."""
    for file, columns in found.columns.items():
        yield file
        yield table(
            ["column", "unit", "first cells", "read as"],
            [[c.header, c.unit or "-", ", ".join(c.first), c.channel or "-"] for c in columns],
        )
    for recording, about in zip(found.recordings, found.to_dict()["recordings"], strict=True):
        yield repr(recording)
        yield table(
            ["channel", "unit", "lowest", "highest", "at a limit", "stuck samples"],
            [
                [
                    name,
                    one["unit"] or "-",
                    *(f"{one[end]:.6g}" for end in ("min", "max")),
                    f"{100 * one['saturated']:.3g} %",
                    str(one["stuck"]),
                ]
                for name, one in about["channels"].items()
            ],
        )
        yield from (f"Note: {note}" for note in reading_notes([recording]))
    yield ""
    if isinstance(found.gaps, str):
        yield f"Data gaps: unknown, {found.gaps}"
        return
    yield "Data gaps:" if found.gaps else "Data gaps: none"
    yield from (f"- {words.gap_sentence(gap)} {words.gap_run(gap)}" for gap in found.gaps)


def papers(found: Mapping[str, Paper]) -> Iterator[str]:
    """Return what papers are about."""
    for name, one in found.items():
        yield f"{one.number}. {name}: {one.title}\n   {one.question}"


def reproduction(found: Reproduction) -> Iterator[str]:
    """Return the tables of a paper's re-run, and what it shows."""
    from mckibben.report.reproduction import heading

    for one in found.tables:
        yield f"\n{heading(one, quick=found.quick)}"
        rows = [[c if isinstance(c, str) else numeral(c, 4) for c in row] for row in one.rows]
        yield table(one.columns, rows)
        if one.text.note:
            yield one.text.note
    yield ""
    yield from found.summary


def device(found: Driven) -> Iterator[str]:
    """Return what a device is, its ports, and what it did."""
    one = found.device
    yield (
        f"Model {one.fingerprint}: a step every {one.period:g} s, safe after "
        f"{one.period * one.silence:g} s of silence; {_state(one, found.before)}"
    )
    kinds = ["input"] * len(one.inputs) + ["output"] * len(one.outputs)
    values = [*found.before.inputs.tolist(), *found.before.outputs.tolist()]
    yield table(
        ["", "channel", "unit", "lowest", "highest", "safe", "now"],
        [
            [
                kind,
                port.name,
                port.unit,
                numeral(port.low, 4),
                numeral(port.high, 4),
                numeral(port.safe, 4) if kind == "output" else "",
                numeral(now, 5),
            ]
            for kind, port, now in zip(kinds, [*one.inputs, *one.outputs], values, strict=True)
        ],
    )
    if found.after is not None:
        yield f"Afterwards: {_state(one, found.after)}"


def _state(device: Device, state: State) -> str:
    pairs = zip(device.outputs, state.outputs.tolist(), strict=True)
    outputs = ", ".join(f"{port.name} {numeral(value, 5)} {port.unit}" for port, value in pairs)
    return f"{'safe' if state.is_safe else 'driven'} after {state.steps} steps: {outputs}"


def rigs(found: Mapping[str, Any]) -> Iterator[str]:
    """Return the rigs, protocols and signals."""
    yield "Rigs:"
    for name, one in found["rigs"].items():
        yield f"  {name}: {one['title']}"
        yield f"    driven by {', '.join(one['inputs'])}; measures {', '.join(one['outputs'])}"
    yield "\nProtocols:"
    for name, one in found["protocols"].items():
        yield f"  {name}: {one['runs']} runs on {one['rig']}"
    yield "\nSignals (--signal NAME:SETTING=VALUE,...):"
    for name, settings in found["signals"].items():
        yield f"  {name}: {', '.join(f'{key} ({kind})' for key, kind in settings.items())}"


def ranges(recording: Recording) -> Iterator[str]:
    """Return the range of every channel."""
    for name, samples in recording.channels.items():
        low, high = (numeral(float(end) + 0.0, 4) for end in (samples.min(), samples.max()))
        yield f"{name}: {low} to {high} {recording.units[name]}"
