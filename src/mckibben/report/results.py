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


def recording(run: Recording) -> list[Item]:
    """Return the ranges of channels, and notes."""
    sampled, lag_of = run.meta.get("sampled", {}), lags(run)
    rows = [
        [
            name,
            run.units[name] or "–",
            *(f"{end + 0.0:.6g}" for end in ends),
            sampled.get(name, run.sample_time and 1.0 / run.sample_time),
            run.step * lag_of[name].samples if name in lag_of and run.sample_time else None,
        ]
        for name, ends in run.ranges.items()
    ]
    notes = reading_notes([run])
    return [
        Table(["Channel", "Unit", "Lowest", "Highest", "Rate [Hz]", "Lag [s]"], rows),
        Text(notes, "note", listed=True) if notes else None,
    ]


def contents(result: Contents) -> list[Item]:
    """Return the columns of files, the channels of recordings, and their data gaps."""
    items: list[Item] = []
    for file, columns in result.columns.items():
        rows = [[c.header, c.unit or "–", ", ".join(c.first), c.channel or "–"] for c in columns]
        table = Table(["Column", "Unit", "First cells", "Read as"], rows)
        items += [Text([file], "lead"), table]
    for run in result.recordings:
        items += [Text([repr(run)], "lead"), *recording(run)]
    if isinstance(result.gaps, str):
        return [*items, Text([f"Data gaps: unknown, {result.gaps}"])]
    return [*items, *(data_gaps(result.gaps) or [Text(["Data gaps: none"])])]


def data_gaps(gaps: Sequence[Gap]) -> list[Item]:
    """Return data gaps, and the runs that close them."""
    rows = [[words.gap_sentence(gap), words.gap_run(gap)] for gap in gaps]
    return [Table(["Data gap", "Run that closes it"], rows)] if rows else []


def characterization(measures: Characterization) -> list[Item]:
    """Return a characterization: sentences, then every quantity with its 95 % interval."""
    quantities = [quantity for quantity in words.quantities(measures) if quantity.value is not None]
    rows = [
        [
            quantity.name,
            quantity.value,
            " to ".join(numeral(x, 4) for x in quantity.limits or ()),
            quantity.unit,
        ]
        for quantity in quantities
    ]
    headings, meanings = (
        ["Quantity", "Value", "95 % interval", "Unit"],
        [quantity.meaning for quantity in quantities],
    )
    table = Table(headings, rows, titles=meanings, summary="Characterization")
    return [Text(words.characterization_sentences(measures)), table]


def plan(experiment: Plan) -> list[Item]:
    """Return the steps of a plan."""
    steps = [
        [f"{step.start:.0f} to {step.stop:.0f}", step.what, ", ".join(step.gaps) or "–"]
        for step in experiment.steps
    ]
    return [Table(["Seconds", "What", "Closes"], steps), Text(words.plan_sentences(experiment))]


# --- Models -----------------------------------------------------------------------------------------


def fit(result: Fit) -> list[Item]:
    """Return errors and parameters of a fitted model."""
    numbers, unit = result.to_dict(), result.estimator.model_.outputs[0].unit
    sentences = [
        f"{result.name}: free-running RMSE {numeral(numbers['rmse'], 4)} {unit} on "
        f"{numbers['n_samples']} samples, {numbers['n_parameters']} parameters, "
        f"{numbers['seconds']:.2f} s"
    ]
    if len(numbers["rmse_by_output"]) > 1:
        errors = [f"{k} {numeral(v, 4)} {unit}" for k, v in numbers["rmse_by_output"].items()]
        sentences.append(f"Mean of {', '.join(errors)}.")
    if abs(numbers["rmse_from_rest"] - numbers["rmse"]) > STARTS_MATTER * numbers["rmse"]:
        sentences.append(
            "Every recording starts from its fitted state; from rest, as streams and generated code "
            f"start, the RMSE is {numeral(numbers['rmse_from_rest'], 4)} {unit}."
        )
    if numbers["undetermined"]:
        sentences.append(
            f"Not determined by these recordings: {'; '.join(numbers['undetermined'])}."
        )
    if result.price is not None:
        limited, unlimited = (numeral(value, 4) for value in result.price)
        sentences.append(
            f"RMSE of the force {limited} N; without the limits of the format {unlimited} N."
        )
    keys = ("parameter_names", "parameters", "standard_errors", "parameter_units")
    rows = [
        [name, value, "–" if math.isnan(error) else numeral(error, 2), measure]
        for name, value, error, measure in zip(*(numbers[key] for key in keys), strict=True)
    ]
    table = Table(["Parameter", "Value", "Standard error", "Unit"], rows)
    return [Text(sentences), table if result.estimator.errors_known else None]


def block(result: Block) -> list[Item]:
    """Return inputs, outputs and kind of a model."""
    from mckibben.blocks.setting import summary

    rows = list(zip(result.parameter_names, map(float, result.pack()), strict=False))
    return [*model(summary(result)), Table(["Parameter", "Value"], rows) if rows else None]


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


def models(descriptions: Mapping[str, Any]) -> list[Item]:
    """Return the description of every model, and its settings."""
    rows = [[name, content["summary"]] for name, content in descriptions.items()]
    settings = [
        [name, ", ".join(f"{key}={value}" for key, value in content["settings"].items())]
        for name, content in descriptions.items()
    ]
    return [
        Table(["Model", "What it is"], rows),
        Table(["Model", "Settings (--set NAME=VALUE)"], settings),
    ]


def description(result: ModelDescription) -> list[Item]:
    """Return a model's equations and parameters."""
    rows = [
        [
            parameter.name,
            {"latex": parameter.symbol},
            parameter.value,
            parameter.status
            if parameter.standard_error is None
            else f"± {numeral(parameter.standard_error, 2)}",
            parameter.unit or "–",
        ]
        for parameter in result.parameters
    ]
    items: list[Item] = [
        Text([result.written.title], "muted"),
        Equations(result.written),
        Table(
            ["Parameter", "Symbol", "Value", "Standard error", "Unit"],
            rows,
            titles=[parameter.meaning for parameter in result.parameters],
            summary=f"{len(rows)} parameters" if len(rows) > UNFOLDED else "",
        ),
    ]
    return items


def simulation(result: Simulation) -> list[Item]:
    """Return the errors of a model on a recording, and the coverage of its band."""
    units = result.recording.units
    rows = [
        [f"{name} [{units[name]}]", *(errors[key] for key in ("rmse", "mae", "max_error", "r2"))]
        for name, errors in result.metrics.items()
    ]
    table = Table(["output", "RMSE", "MAE", "Largest", "R²"], rows)
    items: list[Item] = [table] if rows else recording(result.recording)
    if result.interval is not None:
        items.append(Text([
            f"{name}: the band for {percent(result.interval, 3)} holds "
            f"{percent(errors['coverage'], 3)} of the samples; "
            f"{numeral(errors['band_width'], 3)} {units[name]} wide on average"
            for name, errors in result.metrics.items()
        ]))  # fmt: skip
    run = result.recording.name
    beyond = [words.outside_calibration(run, *each) for each in result.outside]
    items.append(Text([*result.notes, *beyond], "note", listed=True))
    return items


def inverse(result: Inverse) -> list[Item]:
    """Return inputs, outputs and reachable range of an inverse."""
    compensator = result.model
    units = {channel.name: channel.unit for channel in (*compensator.inputs, *compensator.outputs)}
    inputs, outputs = (
        ", ".join(
            f"{channel.name} [{channel.unit}]" if channel.unit else channel.name for channel in side
        )
        for side in (compensator.inputs, compensator.outputs)
    )
    sentences = [f"{outputs} from {inputs}."]
    sentences += [
        f"Reachable whatever happened before: {name} {numeral(low, 5)} to {numeral(high, 5)} "
        f"{units.get(name, '')}; references beyond are clipped."
        for name, (low, high) in result.reachable.items()
    ]
    if result.kind in ("inverse", "adaptive") and not result.reachable:
        sentences.append(
            "What can be reached depends on load, past or other muscles; track has what was clipped."
        )
    sentences += [
        f"{name}: RMSE {numeral(error, 4)} {units[name]} on the recordings."
        for name, error in result.rmse.items()
    ]
    if compensator.samples_ahead:
        sentences.append(
            f"Give it every reference {compensator.samples_ahead} samples before it is due; track does."
        )
    return [Text(sentences)]


def exported(result: Exported) -> list[Item]:
    """Return the output of a self-test, and the number of files written."""
    libraries = [name for name in result.files if name.startswith("binaries/")]
    sentences = [
        *filter(None, (result.self_test, result.emulation)),
        *(f"Library: {x}" for x in libraries),
    ]
    start = "; start with README.md" if "README.md" in result.files else ""
    return [Text([*sentences, counted(len(result.files), "file") + start])]


# --- Comparisons and studies ------------------------------------------------------------------------


def board_table(board: Leaderboard, rows: Sequence[Row], keys: Sequence[str] = BOARD) -> Table:
    """Return rows of a leaderboard as a table, those of each output among its columns."""
    columns = [
        column for column in columns_of_board(board) if column.key in (*keys, *board.outputs)
    ]
    contents = [row.to_dict() for row in rows]
    names = [row.model + " ≈" * (row.model in board.level) + "*" * row.doubted for row in rows]
    return Table(
        ["Model", *(column.label for column in columns)],
        [
            [name, *(column.text(content) for column in columns)]
            for name, content in zip(names, contents, strict=True)
        ],
        best=next((place for place, row in enumerate(rows) if row is board.best), None),
        titles=[
            _summary(row.model)
            for row in rows
        ],
        keys=[
            [row.model, *(column.sorted_by(content) for column in columns)]
            for row, content in zip(rows, contents, strict=True)
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
    failed = [f"{', '.join(names)}: failed, {reason}" for reason, names in board.failures.items()]
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


def study_started(result: Study) -> list[Item]:
    """Return the characterization of the muscle and a loop, before any model is fitted."""
    measures, log_review = result.characterization, result.review
    return [
        Text(words.characterization_sentences(measures)) if measures is not None else None,
        Text(words.reviewed(log_review)) if log_review is not None else None,
    ]


def study(result: Study) -> list[Item]:
    """Return the leaderboard, the three answers, further tiles, and loops."""
    sentences = [f"{question} {answer}" for question, answer in words.answers(result)]
    sentences += [f"{tile.label}: {tile.value}, {tile.note}".rstrip(", ") for tile in tiles(result)]
    sentences += [*words.compensated(result), *filter(None, [words.not_looped(result)])]
    loop_items = loops(result.loops) if result.loops else []
    return [*leaderboard(result.leaderboard), Text(sentences), *loop_items]


def tiles(study: Study) -> tuple[Tile, ...]:
    """Return the numbers of the first screen: loop, model, inverse, data gaps."""
    board, measures, best = study.leaderboard, study.characterization, study.leaderboard.best
    reason = "several inputs" if len(board.inputs) > 1 else "not measured"
    loop = Tile("Loop width", "–", f"{reason}: see Recordings", "recordings")
    if measures is not None and measures.loop_width is not None:
        width = f"{numeral(measures.mid_width, 2)} {measures.output_unit} at mid {measures.input}"
        loop = Tile("Loop width", f"{numeral(measures.loop_width, 2)} %", width, "recordings")
    elif measures is not None:
        loop = Tile("Loop width", "–", "no loop detected", "recordings")
        if measures.has_loop and measures.branch_gap is not None:
            gap = words.size(measures.output_unit, measures.branch_gap)
            loop = Tile("Loop width", gap, "mean gap between branches", "recordings")
    model = Tile(
        "Best model", "–", "fitting" if board.pending else "none recommended", "leaderboard"
    )
    if best is not None:
        error, share = numeral(best.test_error, 2), _share(study)
        relative = f" ({share} of the range)" if share else ""
        model = Tile(
            "Best model",
            best.model,
            f"{error} {board.unit} RMSE on the test{relative}",
            "leaderboard",
        )
    inverse, compensation = Tile("Compensator", "–", "none", "checks"), study.inverse
    if compensation is not None:
        error, static_map = (
            numeral(x, 2) for x in (compensation.following_error, compensation.static_error)
        )
        note = (
            f"expected RMSE with the inverse of {compensation.model}; static map: {static_map} "
            f"{compensation.unit}"
        )
        inverse = Tile("Compensator", f"{error} {compensation.unit}".strip(), note, "checks")
    gaps = [words.gap_name(gap) for gap in study.data_gaps]
    names = ", ".join(gaps[:3]) + " ..." * (len(gaps) > 3)
    return loop, model, inverse, Tile("Data gaps", str(len(gaps)), names, "recordings")


def _share(study: Study) -> str:
    """Return the chosen model's error relative to the range of the test data."""
    check = study.check
    if check is None or isinstance(check, str) or len(check.outputs) > 1:
        return ""
    return percent(check.outputs[0].rmse / check.outputs[0].span) if check.outputs[0].span else ""


def loops(runs: Mapping[str, Tracked]) -> list[Item]:
    """Return the tracking errors of controllers."""
    rows = [
        [
            name,
            output,
            run.rmse[output],
            run.largest[output],
            run.recording.units.get(output) or "–",
            run.clipped,
        ]
        for output in next(iter(runs.values())).rmse
        for name, run in runs.items()
    ]
    return [Table(["Controller", "Output", "RMSE", "Largest", "Unit", "Samples clipped"], rows)]


def tracked(run: Tracked) -> list[Item]:
    """Return the tracking errors of a controller."""
    return loops({"achieved": run})


def tracking(result: Tracking) -> list[Item]:
    """Return tracking errors with and without compensation."""
    items: list[Item] = [Text(result.notes, "note", listed=True) if result.notes else None]
    items += loops(result.loops)
    items += [] if result.learned is None else learned(result.learned)
    return [*items, Text(words.tracked(result))]


def learned(result: Learned) -> list[Item]:
    """Return the tracking errors of repetitions, and how they converge."""
    n = len(result.runs)
    rows = [[k, *(errors[k] for errors in result.rmse.values())] for k in range(n)]
    return [
        Table(["Repetition", *(f"RMSE {name}" for name in result.rmse)], rows),
        Text(words.learned(result)),
    ]


# --- Checks and reviews -----------------------------------------------------------------------------


def check(validation: Validation) -> list[Item]:
    """Return the verdict on a model, and its findings."""
    items: list[Item] = [Text([words.check_verdict(validation)])]
    for output_check in validation.outputs:
        items += [Text([output_check.output], "lead")] * (len(validation.outputs) > 1) + checked(
            output_check
        )
    untested = f"Too short to be tested: {', '.join(validation.untested)}"
    return [*items, Text([untested]) if validation.untested else None]


def checked(output_check: OutputCheck) -> list[Item]:
    """Return what a residual depends on, with its means over each variable, and all tests."""
    headings = ["Share explained [%]", f"RMS [{output_check.unit}]"]
    missing, tests = (
        [[words.missed(output_check, cause), 100 * cause.share, cause.size] for cause in causes]
        for causes in (output_check.missing, output_check.suspects)
    )
    panels = [
        interactive.plots(model_subjects.pattern(output_check, pattern))[0]
        for pattern in output_check.patterns
    ]
    name = output_check.output
    caption = f"Mean residual of {name}, with 95 % intervals that allow for autocorrelation."
    return [
        Text(words.check_notes(output_check)),
        Table(["Cause, after those above", *headings], missing) if missing else None,
        Figure(f"patterns {name}", [panels], caption, caption, columns=2) if panels else None,
        Table(["Cause, by itself", *headings], tests, summary="All causes tested")
        if tests
        else None,
    ]


def review(result: Review, points: int = POINTS) -> list[Item]:
    """Return a log's review, and the parts of the error over time."""
    figures = [
        Figure(
            f"review {output.output}",
            [interactive.plots(model_subjects.parts(output, points))],
            f"Reference, measured motion, and parts of the error of {output.output}",
            "The parts add up to the error: model, pressure (measured less commanded), command.",
            "stacked",
        )
        for output in result.outputs
    ]
    return [Text(words.reviewed(result), listed=True), *figures]


def calibration(result: Calibration) -> list[Item]:
    """Return the calibration data of bands, and their mean width in cross-validation."""
    band, n = result.band, result.band.units
    sentence = (
        f"Calibrated on {n} {band.unit}s, which allow levels up to {percent(n / (n + 1), 3)}."
    )
    rows = [
        [channel.name, percent(band.level, 3), width, channel.unit, percent(ratio)]
        for channel, width, ratio in zip(
            band.given, result.widths, result.over_constant, strict=True
        )
    ]
    headings = ["Output", "Level", "Width of its band", "Unit", "Of one of constant width"]
    notes = [words.calibrated_on_blocks(result)] if band.unit == "block" else []
    if not result.fitted_known:
        notes.append("give `fitted`, which makes sure that no recording was fitted")
    return [Text([sentence]), Table(headings, rows), Text(notes, "note", listed=True)]


# --- Papers, rigs and devices -----------------------------------------------------------------------


def scaled(levels: Sequence[Scaled]) -> list[Item]:
    """Return how the levels of a protocol are scaled for a rig."""
    columns = ("command", "in the paper, from", "to", "here, from", "to", "factor")
    rows = [(level.what, *level.printed, *level.here, level.factor) for level in levels]
    return [Text(["How the protocol is scaled for this rig"], "lead"), Table(columns, rows)]


def papers(papers_by_name: Mapping[str, Paper]) -> list[Item]:
    """Return the questions of papers."""
    rows = [
        [str(content.number), name, f"{content.title}. {content.question}"]
        for name, content in papers_by_name.items()
    ]
    return [Table(["", "Paper", "What it asks"], rows)]


def rig(machine: Rig) -> list[Item]:
    """Return the description of a rig, and its limits."""
    limits = {name: machine.limits(name) for name in machine.inputs}
    rows = [
        [name, f"{numeral(limit.low)} to {numeral(limit.high)}"] for name, limit in limits.items()
    ]
    rows += [[name, "output"] for name in machine.outputs if name not in limits]
    sentence = f"A virtual rig, with a sample every {numeral(machine.sample_time)} s."
    return [Text([*filter(None, (sentence, machine.source))]), Table(["Channel", "Limits"], rows)]


def rigs(lists: Mapping[str, Any]) -> list[Item]:
    """Return the rigs, protocols and signals."""
    return [
        Table(
            ["Rig", "What it is", "Driven by", "Measures"],
            [
                [
                    name,
                    content["title"],
                    ", ".join(content["inputs"]),
                    ", ".join(content["outputs"]),
                ]
                for name, content in lists["rigs"].items()
            ],
        ),
        Table(
            ["Protocol", "Runs", "Rig"],
            [
                [name, content["runs"], content["rig"]]
                for name, content in lists["protocols"].items()
            ],
        ),
        Table(
            ["Signal (--signal NAME:SETTING=VALUE,...)", "Settings"],
            [
                [name, ", ".join(f"{key} ({kind})" for key, kind in settings.items())]
                for name, settings in lists["signals"].items()
            ],
        ),
    ]


def device(machine: Device, state: State) -> list[Item]:
    """Return the description of a device, its ports, and their values."""
    ports = [("input", p) for p in machine.inputs] + [("output", p) for p in machine.outputs]
    values = [*state.inputs.tolist(), *state.outputs.tolist()]
    rows = [
        [kind, p.name, p.unit, p.low, p.high, p.safe if kind == "output" else "", value]
        for (kind, p), value in zip(ports, values, strict=True)
    ]
    about = (
        f"Model {machine.fingerprint}: a step every {machine.period:g} s, safe after "
        f"{machine.period * machine.silence:g} s of silence."
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
