"""Texts, tables and figures of every kind of result, for all interfaces.

A terminal prints texts and tables, pages add the figures, and a card in a notebook has the first table.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from mckibben import registry
from mckibben.numerals import counted, numeral, percent
from mckibben.recording import reading_notes
from mckibben.report import interactive, model_subjects, reproduction, words
from mckibben.report.builder import Equations, Figure, Item, Table, Text, Tile
from mckibben.report.columns import columns_of_board
from mckibben.report.drawing import POINTS
from mckibben.signals.lags import lags

if TYPE_CHECKING:
    from mckibben.blocks.base import Block
    from mckibben.comparison.leaderboard import Leaderboard, Row
    from mckibben.control import Learned, Tracked
    from mckibben.diagnosis.bands import Calibration
    from mckibben.diagnosis.characterization import Characterization
    from mckibben.diagnosis.check import OutputCheck, Validation
    from mckibben.diagnosis.data_gaps import Gap
    from mckibben.diagnosis.description import ModelDescription
    from mckibben.diagnosis.review import Review
    from mckibben.link import Device, State
    from mckibben.papers.paper import Paper
    from mckibben.planning.planner import Plan
    from mckibben.reading import Contents
    from mckibben.recording import Recording
    from mckibben.rigs.rig import Rig
    from mckibben.signals.protocol import Scaled
    from mckibben.simulation import Simulation
    from mckibben.studying.results import Exported, Fit, Inverse, Tracking
    from mckibben.studying.study import Study

STARTS_MATTER = 0.05
"""Relative difference of the errors from rest and from fitted starts above which both are shown."""

BOARD = ("chosen", "test", "interval", "rank", "gap")
"""Columns of a leaderboard for a terminal of 80; the files have the rest."""

UNFOLDED = 30
"""Number of parameters that a page shows unfolded."""

# --- Recordings -------------------------------------------------------------------------------------


def recording(found: Recording) -> list[Item]:
    """Return the ranges of channels, and notes."""
    sampled, late = found.meta.get("sampled", {}), lags(found)
    rows = [
        [
            name,
            found.units[name] or "–",
            *(f"{end + 0.0:.6g}" for end in ends),
            sampled.get(name, found.sample_time and 1.0 / found.sample_time),
            found.step * late[name].samples if name in late and found.sample_time else None,
        ]
        for name, ends in found.ranges.items()
    ]
    notes = reading_notes([found])
    return [
        Table(["Channel", "Unit", "Lowest", "Highest", "Rate [Hz]", "Lag [s]"], rows),
        Text(notes, "note", listed=True) if notes else None,
    ]


def contents(found: Contents) -> list[Item]:
    """Return the columns of files, the channels of recordings, and their data gaps."""
    items: list[Item] = []
    for file, columns in found.columns.items():
        rows = [[c.header, c.unit or "–", ", ".join(c.first), c.channel or "–"] for c in columns]
        table = Table(["Column", "Unit", "First cells", "Read as"], rows)
        items += [Text([file], "lead"), table]
    for one in found.recordings:
        items += [Text([repr(one)], "lead"), *recording(one)]
    if isinstance(found.gaps, str):
        return [*items, Text([f"Data gaps: unknown, {found.gaps}"])]
    return [*items, *(data_gaps(found.gaps) or [Text(["Data gaps: none"])])]


def data_gaps(gaps: Sequence[Gap]) -> list[Item]:
    """Return data gaps, and the runs that close them."""
    rows = [[words.gap_sentence(gap), words.gap_run(gap)] for gap in gaps]
    return [Table(["Data gap", "Run that closes it"], rows)] if rows else []


def characterization(found: Characterization) -> list[Item]:
    """Return a characterization: sentences, then every quantity with its 95 % interval."""
    quantities = [one for one in words.quantities(found) if one.value is not None]
    rows = [
        [one.name, one.value, " to ".join(numeral(x, 4) for x in one.limits or ()), one.unit]
        for one in quantities
    ]
    headings, meanings = (
        ["Quantity", "Value", "95 % interval", "Unit"],
        [o.meaning for o in quantities],
    )
    table = Table(headings, rows, titles=meanings, summary="Characterization")
    return [Text(words.characterization_sentences(found)), table]


def plan(found: Plan) -> list[Item]:
    """Return the steps of a plan."""
    steps = [
        [f"{one.start:.0f} to {one.stop:.0f}", one.what, ", ".join(one.gaps) or "–"]
        for one in found.steps
    ]
    return [Table(["Seconds", "What", "Closes"], steps), Text(words.plan_sentences(found))]


# --- Models -----------------------------------------------------------------------------------------


def fit(found: Fit) -> list[Item]:
    """Return errors and parameters of a fitted model."""
    about, unit = found.to_dict(), found.estimator.model_.outputs[0].unit
    said = [
        f"{found.name}: free-running RMSE {numeral(about['rmse'], 4)} {unit} on "
        f"{about['n_samples']} samples, {about['n_parameters']} parameters, "
        f"{about['seconds']:.2f} s"
    ]
    if len(about["rmse_by_output"]) > 1:
        errors = [f"{k} {numeral(v, 4)} {unit}" for k, v in about["rmse_by_output"].items()]
        said.append(f"Mean of {', '.join(errors)}.")
    if abs(about["rmse_from_rest"] - about["rmse"]) > STARTS_MATTER * about["rmse"]:
        said.append(
            "Every recording starts from its fitted state; from rest, as streams and generated code "
            f"start, the RMSE is {numeral(about['rmse_from_rest'], 4)} {unit}."
        )
    if about["undetermined"]:
        said.append(f"Not determined by these recordings: {'; '.join(about['undetermined'])}.")
    if found.price is not None:
        limited, unlimited = (numeral(value, 4) for value in found.price)
        said.append(
            f"RMSE of the force {limited} N; without the limits of the format {unlimited} N."
        )
    keys = ("parameter_names", "parameters", "standard_errors", "parameter_units")
    rows = [
        [name, value, "–" if math.isnan(error) else numeral(error, 2), measure]
        for name, value, error, measure in zip(*(about[key] for key in keys), strict=True)
    ]
    table = Table(["Parameter", "Value", "Standard error", "Unit"], rows)
    return [Text(said), table if found.estimator.errors_known else None]


def block(found: Block) -> list[Item]:
    """Return inputs, outputs and kind of a model."""
    from mckibben.blocks.setting import summary

    rows = list(zip(found.parameter_names, map(float, found.pack()), strict=False))
    return [*model(summary(found)), Table(["Parameter", "Value"], rows) if rows else None]


def model(about: Mapping[str, Any]) -> list[Item]:
    """Return the description of a saved model, from its `summary`."""
    settable = ", ".join(f"{name}={value}" for name, value in about["settable"].items()) or "–"
    rows = [
        [key.replace("_", " "), ", ".join(value) if isinstance(value, list) else str(value)]
        for key, value in {**about, "settable": settable}.items()
    ]
    return [Table(["", "Value"], rows)]


def versions(installed: Mapping[str, str]) -> list[Item]:
    """Return the versions of the package and what it runs with, for reports of problems."""
    return [Table(["Package", "Version"], list(installed.items()))]


def models(every: Mapping[str, Any]) -> list[Item]:
    """Return the description of every model, and its settings."""
    rows = [[name, one["summary"]] for name, one in every.items()]
    settings = [
        [name, ", ".join(f"{key}={value}" for key, value in one["settings"].items())]
        for name, one in every.items()
    ]
    return [
        Table(["Model", "What it is"], rows),
        Table(["Model", "Settings (--set NAME=VALUE)"], settings),
    ]


def description(found: ModelDescription) -> list[Item]:
    """Return a model's equations and parameters."""
    rows = [
        [
            one.name,
            {"latex": one.symbol},
            one.value,
            one.status if one.standard_error is None else f"± {numeral(one.standard_error, 2)}",
            one.unit or "–",
        ]
        for one in found.parameters
    ]
    items: list[Item] = [
        Text([found.written.title], "muted"),
        Equations(found.written),
        Table(
            ["Parameter", "Symbol", "Value", "Standard error", "Unit"],
            rows,
            titles=[one.meaning for one in found.parameters],
            summary=f"{len(rows)} parameters" if len(rows) > UNFOLDED else "",
        ),
    ]
    return items


def simulation(found: Simulation) -> list[Item]:
    """Return the errors of a model on a recording, and the coverage of its band."""
    units = found.recording.units
    rows = [
        [f"{name} [{units[name]}]", *(one[key] for key in ("rmse", "mae", "max_error", "r2"))]
        for name, one in found.metrics.items()
    ]
    table = Table(["output", "RMSE", "MAE", "Largest", "R²"], rows)
    items: list[Item] = [table] if rows else recording(found.recording)
    if found.interval is not None:
        items.append(Text([
            f"{name}: the band for {percent(found.interval, 3)} holds {percent(one['coverage'], 3)} of "
            f"the samples; {numeral(one['band_width'], 3)} {units[name]} wide on average"
            for name, one in found.metrics.items()
        ]))  # fmt: skip
    run = found.recording.name
    beyond = [words.outside_calibration(run, *each) for each in found.outside]
    items.append(Text([*found.notes, *beyond], "note", listed=True))
    return items


def inverse(found: Inverse) -> list[Item]:
    """Return inputs, outputs and reachable range of an inverse."""
    made = found.model
    units = {channel.name: channel.unit for channel in (*made.inputs, *made.outputs)}
    given, wanted = (
        ", ".join(f"{one.name} [{one.unit}]" if one.unit else one.name for one in side)
        for side in (made.inputs, made.outputs)
    )
    said = [f"{wanted} from {given}."]
    said += [
        f"Reachable whatever happened before: {name} {numeral(low, 5)} to {numeral(high, 5)} "
        f"{units.get(name, '')}; references beyond are clipped."
        for name, (low, high) in found.reachable.items()
    ]
    if found.kind in ("inverse", "adaptive") and not found.reachable:
        said.append(
            "What can be reached depends on load, past or other muscles; track has what was clipped."
        )
    said += [
        f"{name}: RMSE {numeral(error, 4)} {units[name]} on the recordings."
        for name, error in found.rmse.items()
    ]
    if made.samples_ahead:
        said.append(
            f"Give it every reference {made.samples_ahead} samples before it is due; track does."
        )
    return [Text(said)]


def exported(found: Exported) -> list[Item]:
    """Return the output of a self-test, and the number of files written."""
    libraries = [name for name in found.files if name.startswith("binaries/")]
    said = [
        *filter(None, (found.self_test, found.emulation)),
        *(f"Library: {x}" for x in libraries),
    ]
    start = "; start with README.md" if "README.md" in found.files else ""
    return [Text([*said, counted(len(found.files), "file") + start])]


# --- Comparisons and studies ------------------------------------------------------------------------


def board_table(board: Leaderboard, rows: Sequence[Row], keys: Sequence[str] = BOARD) -> Table:
    """Return rows of a leaderboard as a table, those of each output among its columns."""
    columns = [one for one in columns_of_board(board) if one.key in (*keys, *board.outputs)]
    given = [row.to_dict() for row in rows]
    named = [r.model + " ≈" * (r.model in board.level) + "*" * r.doubted for r in rows]
    return Table(
        ["Model", *(one.label for one in columns)],
        [[name, *(one.text(each) for one in columns)] for name, each in zip(named, given, strict=True)],
        best=next((place for place, row in enumerate(rows) if row is board.best), None),
        titles=[
            _summary(row.model)
            for row in rows
        ],
        keys=[
            [row.model, *(one.sorted_by(each) for one in columns)]
            for row, each in zip(rows, given, strict=True)
        ],
    )  # fmt: skip


def _summary(model: str) -> str:
    """Return the full name of a model and what it represents; nothing for unknown ones."""
    from mckibben.estimators.catalogue import summary

    return summary(model) if model in registry.names("estimators") else ""


def leaderboard(board: Leaderboard, keys: Sequence[str] = BOARD) -> list[Item]:
    """Return the comparison of models: errors, choice, and failures."""
    ranked = [row for row in board.ranking if row.reason is None and row.test and row.train]
    split = f"{board.split[0].upper()}{board.split[1:]}"
    by = words.CHOICES[board.chosen_by][1]
    chosen, marks = words.chosen(board), words.marks(board)
    if not ranked:
        chosen = "No model is fitted yet." if board.pending else "No model worked."
    items: list[Item] = [
        Text(list(filter(None, [chosen, words.doubtful(board)]))) if chosen else None,
        Text([f"{split}. Ordered by {by}. All errors are free-run simulation errors."]),
        board_table(board, ranked, keys) if ranked else None,
        Text(marks, "muted") if marks else None,
    ]
    notes = [*words.comparison(board), *words.not_validated(board)]
    items.append(Text(notes, "note", listed=True) if notes else None)
    failed = [f"{', '.join(some)}: failed, {reason}" for reason, some in board.failures.items()]
    items.append(Text(failed, "failed", listed=True) if failed else None)
    if any(row is not board.constant for row in ranked):
        caption = "Test errors with 95 % intervals; strokes: on the data fitted; rings: validation."
        plots = [interactive.plots(model_subjects.leaderboard(board))]
        height = 4 + 1.4 * len(board.rows)
        items.append(
            Figure(
                "leaderboard", plots, "Errors of all models with intervals", caption, height=height
            )
        )
    return items


def study_started(found: Study) -> list[Item]:
    """Return the characterization of the muscle and a loop, before any model is fitted."""
    known, reviewed = found.characterization, found.review
    return [
        Text(words.characterization_sentences(known)) if known is not None else None,
        Text(words.reviewed(reviewed)) if reviewed is not None else None,
    ]


def study(found: Study) -> list[Item]:
    """Return the leaderboard, the three answers, further tiles, and loops."""
    said = [f"{question} {answer}" for question, answer in words.answers(found)]
    said += [f"{one.label}: {one.value}, {one.note}".rstrip(", ") for one in tiles(found)]
    said += [*words.compensated(found), *filter(None, [words.not_looped(found)])]
    closed = loops(found.loops) if found.loops else []
    return [*leaderboard(found.leaderboard), Text(said), *closed]


def tiles(study: Study) -> tuple[Tile, ...]:
    """Return the numbers of the first screen: loop, model, inverse, data gaps."""
    board, found, best = study.leaderboard, study.characterization, study.leaderboard.best
    why = "several inputs" if len(board.inputs) > 1 else "not measured"
    loop = Tile("Loop width", "–", f"{why}: see Recordings", "recordings")
    if found is not None and found.loop_width is not None:
        width = f"{numeral(found.mid_width, 2)} {found.output_unit} at mid {found.input}"
        loop = Tile("Loop width", f"{numeral(found.loop_width, 2)} %", width, "recordings")
    elif found is not None:
        loop = Tile("Loop width", "–", "no loop detected", "recordings")
        if found.has_loop and found.branch_gap is not None:
            gap = words.size(found.output_unit, found.branch_gap)
            loop = Tile("Loop width", gap, "mean gap between branches", "recordings")
    model = Tile(
        "Best model", "–", "fitting" if board.pending else "none recommended", "leaderboard"
    )
    if best is not None:
        error, share = numeral(best.test_error, 2), _share(study)
        of = f" ({share} of the range)" if share else ""
        model = Tile(
            "Best model", best.model, f"{error} {board.unit} RMSE on the test{of}", "leaderboard"
        )
    inverse, own = Tile("Compensator", "–", "none", "checks"), study.inverse
    if own is not None:
        error, plain = (numeral(x, 2) for x in (own.following_error, own.static_error))
        note = f"expected RMSE with the inverse of {own.model}; static map: {plain} {own.unit}"
        inverse = Tile("Compensator", f"{error} {own.unit}".strip(), note, "checks")
    gaps = [words.gap_name(gap) for gap in study.data_gaps]
    listed = ", ".join(gaps[:3]) + " ..." * (len(gaps) > 3)
    return loop, model, inverse, Tile("Data gaps", str(len(gaps)), listed, "recordings")


def _share(study: Study) -> str:
    """Return the chosen model's error relative to the range of the test data."""
    check = study.check
    if check is None or isinstance(check, str) or len(check.outputs) > 1:
        return ""
    return percent(check.outputs[0].rmse / check.outputs[0].span) if check.outputs[0].span else ""


def loops(found: Mapping[str, Tracked]) -> list[Item]:
    """Return the tracking errors of controllers."""
    rows = [
        [
            name,
            output,
            one.rmse[output],
            one.largest[output],
            one.recording.units.get(output) or "–",
            one.clipped,
        ]
        for output in next(iter(found.values())).rmse
        for name, one in found.items()
    ]
    return [Table(["Controller", "Output", "RMSE", "Largest", "Unit", "Samples clipped"], rows)]


def tracked(found: Tracked) -> list[Item]:
    """Return the tracking errors of a controller."""
    return loops({"achieved": found})


def tracking(found: Tracking) -> list[Item]:
    """Return tracking errors with and without compensation."""
    items: list[Item] = [Text(found.notes, "note", listed=True) if found.notes else None]
    items += loops(found.loops)
    items += [] if found.learned is None else learned(found.learned)
    return [*items, Text(words.tracked(found))]


def learned(found: Learned) -> list[Item]:
    """Return the tracking errors of repetitions, and how they converge."""
    n = len(found.runs)
    rows = [[k, *(errors[k] for errors in found.rmse.values())] for k in range(n)]
    return [
        Table(["Repetition", *(f"RMSE {name}" for name in found.rmse)], rows),
        Text(words.learned(found)),
    ]


# --- Checks and reviews -----------------------------------------------------------------------------


def check(found: Validation) -> list[Item]:
    """Return the verdict on a model, and its findings."""
    items: list[Item] = [Text([words.check_verdict(found)])]
    for one in found.outputs:
        items += [Text([one.output], "lead")] * (len(found.outputs) > 1) + checked(one)
    untested = f"Too short to be tested: {', '.join(found.untested)}"
    return [*items, Text([untested]) if found.untested else None]


def checked(one: OutputCheck) -> list[Item]:
    """Return what a residual depends on, with its means over each variable, and all tests."""
    headings = ["Share explained [%]", f"RMS [{one.unit}]"]
    missing, tests = (
        [[words.missed(one, each), 100 * each.share, each.size] for each in some]
        for some in (one.missing, one.suspects)
    )
    panels = [interactive.plots(model_subjects.pattern(one, each))[0] for each in one.patterns]
    caption = f"Mean residual of {one.output}, with 95 % intervals that allow for autocorrelation."
    return [
        Text(words.check_notes(one)),
        Table(["Cause, after those above", *headings], missing) if missing else None,
        Figure(f"patterns {one.output}", [panels], caption, caption, columns=2) if panels else None,
        Table(["Cause, by itself", *headings], tests, summary="All causes tested")
        if tests
        else None,
    ]


def review(found: Review, points: int = POINTS) -> list[Item]:
    """Return a log's review, and the parts of the error over time."""
    figures = [
        Figure(
            f"review {one.output}",
            [interactive.plots(model_subjects.parts(one, points))],
            f"Reference, measured motion, and parts of the error of {one.output}",
            "The parts add up to the error: model, pressure (measured less commanded), command.",
            "stacked",
        )
        for one in found.outputs
    ]
    return [Text(words.reviewed(found), listed=True), *figures]


def calibration(found: Calibration) -> list[Item]:
    """Return the calibration data of bands, and their mean width in cross-validation."""
    band, n = found.band, found.band.units
    said = f"Calibrated on {n} {band.unit}s, which allow levels up to {percent(n / (n + 1), 3)}."
    rows = [
        [channel.name, percent(band.level, 3), width, channel.unit, percent(ratio)]
        for channel, width, ratio in zip(band.given, found.widths, found.over_constant, strict=True)
    ]
    headings = ["Output", "Level", "Width of its band", "Unit", "Of one of constant width"]
    notes = [words.calibrated_on_blocks(found)] if band.unit == "block" else []
    if not found.fitted_known:
        notes.append("give `fitted`, which makes sure that no recording was fitted")
    return [Text([said]), Table(headings, rows), Text(notes, "note", listed=True)]


# --- Papers, rigs and devices -----------------------------------------------------------------------


def scaled(found: Sequence[Scaled]) -> list[Item]:
    """Return how the levels of a protocol are scaled for a rig."""
    columns = ("command", "in the paper, from", "to", "here, from", "to", "factor")
    rows = [(one.what, *one.printed, *one.here, one.factor) for one in found]
    return [Text(["How the protocol is scaled for this rig"], "lead"), Table(columns, rows)]


def papers(found: Mapping[str, Paper]) -> list[Item]:
    """Return the questions of papers."""
    rows = [[str(one.number), name, f"{one.title}. {one.question}"] for name, one in found.items()]
    return [Table(["", "Paper", "What it asks"], rows)]


def rig(found: Rig) -> list[Item]:
    """Return the description of a rig, and its limits."""
    limits = {name: found.limits(name) for name in found.inputs}
    rows = [[name, f"{numeral(one.low)} to {numeral(one.high)}"] for name, one in limits.items()]
    rows += [[name, "output"] for name in found.outputs if name not in limits]
    said = f"A virtual rig, with a sample every {numeral(found.sample_time)} s."
    return [Text([*filter(None, (said, found.source))]), Table(["Channel", "Limits"], rows)]


def rigs(found: Mapping[str, Any]) -> list[Item]:
    """Return the rigs, protocols and signals."""
    return [
        Table(
            ["Rig", "What it is", "Driven by", "Measures"],
            [
                [name, one["title"], ", ".join(one["inputs"]), ", ".join(one["outputs"])]
                for name, one in found["rigs"].items()
            ],
        ),
        Table(
            ["Protocol", "Runs", "Rig"],
            [[name, one["runs"], one["rig"]] for name, one in found["protocols"].items()],
        ),
        Table(
            ["Signal (--signal NAME:SETTING=VALUE,...)", "Settings"],
            [
                [name, ", ".join(f"{key} ({kind})" for key, kind in settings.items())]
                for name, settings in found["signals"].items()
            ],
        ),
    ]


def device(found: Device, state: State) -> list[Item]:
    """Return the description of a device, its ports, and their values."""
    ports = [("input", p) for p in found.inputs] + [("output", p) for p in found.outputs]
    values = [*state.inputs.tolist(), *state.outputs.tolist()]
    rows = [
        [kind, p.name, p.unit, p.low, p.high, p.safe if kind == "output" else "", value]
        for (kind, p), value in zip(ports, values, strict=True)
    ]
    about = (
        f"Model {found.fingerprint}: a step every {found.period:g} s, safe after "
        f"{found.period * found.silence:g} s of silence."
    )
    now = f"Now: {'safe' if state.is_safe else 'driven'} after {state.steps} steps."
    headings = ["Kind", "Channel", "Unit", "Lowest", "Highest", "Safe", "Value"]
    return [Text([about, now]), Table(headings, rows)]


FACES: Mapping[str, Callable[[Any], list[Item]]] = MappingProxyType(
    {
        "block": block,
        "calibration": calibration,
        "characterization": characterization,
        "contents": contents,
        "exported": exported,
        "fit": fit,
        "inverse": inverse,
        "leaderboard": leaderboard,
        "learned": learned,
        "plan": plan,
        "recording": recording,
        "reproduction": reproduction.items,
        "review": review,
        "rig": rig,
        "simulation": simulation,
        "study": study,
        "tracked": tracked,
        "tracking": tracking,
        "validation": check,
    }
)
"""Name of a thing that shows itself -> what is shown of it."""
