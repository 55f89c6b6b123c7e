"""Sentences about results, each made from numbers of the result.

Library functions return numbers. Whatever says something about them to a person is here, in one section
a room, so that all of it can be read, counted and tested on plants where it is false.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from mckibben.files.notices import listed
from mckibben.numerals import counted, numeral, percent
from mckibben.recording import standard_unit

if TYPE_CHECKING:
    from mckibben.arrays import Array
    from mckibben.blocks.fields import Channel
    from mckibben.comparison.leaderboard import Against, Leaderboard
    from mckibben.control import Learned
    from mckibben.diagnosis.bands import Calibration
    from mckibben.diagnosis.causes import Cause
    from mckibben.diagnosis.characterization import Characterization
    from mckibben.diagnosis.check import OutputCheck, Validation
    from mckibben.diagnosis.data_gaps import Gap
    from mckibben.diagnosis.review import Review
    from mckibben.planning.planner import Plan
    from mckibben.recording import Recording
    from mckibben.splits import Span
    from mckibben.studying.results import Tracking
    from mckibben.studying.study import Study

# --- Comparison -------------------------------------------------------------------------------------

CHOICES = {
    "cross-validation": ("CV RMSE", "cross-validation on the training side"),
    "validation": ("validation RMSE", "the last part of the training data (earlier versions)"),
    "given": ("validation RMSE", "validation recordings, which are not fitted"),
    "fit": ("fit RMSE", "the error on the fitted data, as there is no validation"),
}
"""What a model may be chosen by: the heading of its figure, and in words. The test is not among them."""

MOST_LINES = 5
"""Most recordings that are listed in lines of their own, and columns in a line."""

LEVEL = "not distinguished from the chosen model by this test: the interval of the difference contains 0"
"""Of a model that is `level`."""

CAREFUL = (
    "reliable only near the fitted motions, or with too many parameters to leave parts of the data out, "
    "so its error is doubled in the ranking"
)
"""Of a model whose error is `doubted`."""


def chosen(board: Leaderboard) -> str:
    """Return the chosen model, its criterion, its test error, and the lowest; empty without any."""
    best, lowest = board.best, board.lowest
    if board.not_recommended is not None and board.constant is not None:
        first = next(row for row in board.rows if row.reason is None)
        rows = first.to_dict(), board.constant.to_dict()
        return not_recommended(board.not_recommended, *rows, board.unit)
    if best is None or lowest is None:
        return ""
    heading, criterion_name = CHOICES["fit" if best.validation_rmse is None else board.chosen_by]
    test_error, lowest_error, criterion = (
        f"{numeral(value, 3)} {board.unit}".strip()
        for value in (best.test_error, lowest.test_error, best.chosen_by)
    )
    end = ", the lowest" if lowest is best else f"; the lowest is {lowest.model}'s, {lowest_error}"
    return (
        f"Chosen by {criterion_name}: {best.model}, {heading} {criterion}. Its test RMSE is "
        f"{test_error}{end}."
    )


def doubtful(board: Leaderboard) -> str:
    """Return what is most doubtful about the choice, and what would decide; empty where nothing is."""
    if not board.doubts or board.best is None:
        return ""
    doubt, chosen_model = board.doubts[0], board.best.model
    ratio = numeral(doubt.ratio, 2)
    if doubt.kind == "test":
        return (
            f"The choice is doubtful: on the test {chosen_model} has {ratio} times the error of "
            f"{doubt.model}. Fit to these recordings as well, and test on another one."
        )
    where = " and ".join(map(spanned, doubt.spans[:2])) + " …" * (len(doubt.spans) > 2)
    if doubt.kind == "part":
        return (
            f"The choice is doubtful: the error of {doubt.model} on {where} is {ratio} times its CV "
            "RMSE. Another recording of that motion would decide."
        )
    assert doubt.interval is not None
    low, high = (numeral(end, 2) for end in doubt.interval)
    return (
        f"The choice is doubtful: in the cross-validation {doubt.model} counts {ratio} times the error "
        f"of {chosen_model} (95 % interval {low} to {high}). They differ most on {where}: another "
        "recording of that motion would decide."
    )


def spanned(span: Span) -> str:
    """Return which samples of a recording are meant."""
    start, stop = (numeral(end, 3) for end in (span.start, span.stop))
    return f"{span.recording} from {start} to {stop} {span.unit}".rstrip()


def not_recommended(
    side: Against, row: Mapping[str, Any], constant: Mapping[str, Any], unit: str
) -> str:
    """Return why the model ranked first is not recommended.

    Parameters
    ----------
    where : {"validation", "test"}
        Where it does not beat the constant.
    row, constant : mapping
        Their rows, as files hold them.
    unit : str
        Of errors.
    """
    on_test = side == "test"
    errors = [
        (numbers.get("test") or {}).get("rmse") if on_test else numbers.get("validation_rmse")
        for numbers in (row, constant)
    ]
    error, constant_error = (f"{numeral(error, 3)} {unit}".strip() for error in errors)
    data = "the test data" if on_test else "what was left out to validate"
    return (
        f"No model is recommended: on {data}, {row['model']} has an RMSE of {error}, and the mean of "
        f"the training output has {constant_error}."
    )


def comparison(board: Leaderboard) -> list[str]:
    """Return notes on a comparison."""
    best, sentences = board.best, list(board.shared)
    if board.loads:
        sentences.append(f"Further inputs of all models: {', '.join(board.loads)}.")
    if board.offered:
        sentences.append(
            f"Further inputs of models that can take them: {', '.join(board.offered)}."
        )
    if board.ignored:
        sentences.append(f"Not used: {', '.join(board.ignored)}; see `inputs` and `load`.")
    sentences += [
        f"{name} is outside its training range in {numeral(100 * share, 2)} % of the test samples."
        for name, share in board.outside.items()
    ]
    if best is not None:
        sentences += [f"{best.model}: {note}." for note in best.diagnostics.get("notes", ())]
    return sentences


def marks(board: Leaderboard) -> list[str]:
    """Return the meaning of the marks after names of models."""
    careful = any(row.reason is None and row.doubted for row in board.rows)
    return [f"≈ {LEVEL}."] * bool(board.level) + [f"* {CAREFUL}."] * careful


def not_validated(board: Leaderboard) -> list[str]:
    """Return the models whose validation failed, and why."""
    return [
        f"{row.model}: not chosen, as its validation failed: {row.validation_failed}"
        for row in board.rows
        if row.reason is None and row.validation_failed
    ]


# --- What the muscle does ---------------------------------------------------------------------------


class Quantity(NamedTuple):
    """A quantity of a characterization, with its 95 % interval, unit and meaning."""

    name: str
    value: float | int | str | None
    limits: tuple[float, float] | None
    unit: str
    meaning: str


QUANTITIES = (
    ("recordings", "n_recordings", "", "files or segments analysed"),
    ("stretches", "n_stretches", "", "those with all other inputs constant"),
    ("samples", "n_samples", "", "in all"),
    ("duration", "duration", "s", "in all; none without time"),
    ("sample time", "sample_time", "s", "none where unknown or not the same everywhere"),
    ("cycles", "n_cycles", "", "whole ones over at least a tenth of the input range"),
    ("reversals", "n_reversals", "", "where the input turns back by 1 % of its range or more"),
    ("{input}", "input_range", "{u}", "input range"),
    ("{output}", "output_range", "{y}", "output range"),
    ("noise of {input}", "input_noise", "{u}", "standard deviation of a sample"),
    ("noise of {output}", "output_noise", "{y}", "standard deviation of a sample"),
    ("variance explained", "loop_share", "", "share that input and direction explain together"),
    ("p of loop", "p_loop", "", "probability of such gaps between branches without a loop"),
    ("loop width e_w", "loop_width", "%", "largest cycles: branches at mid input over span"),
    ("branch distance at mid input", "mid_width", "{y}", "the same in the unit of the output"),
    ("asymmetry", "asymmetry", "%", "distance from its image rotated by 180°; 0 for PI models"),
    ("centre of width", "width_centroid", "", "-1 at low, 0 at mid, 1 at high input"),
    ("loop area", "loop_area", "{u} {y}", "enclosed by the largest cycles"),
    ("loop area share", "loop_area_share", "%", "of its bounding rectangle; 100 for a relay"),
    ("mean branch gap", "branch_gap", "{y}", "falling less rising output, free of steady drift"),
    ("dead zone after upper reversals", "dead_zone_upper", "{u}", "before the output moves back"),
    ("dead zone after lower reversals", "dead_zone_lower", "{u}", "before the output moves back"),
    ("gain", "gain", "{y}/{u}", "slope of the mean of both branches at mid input"),
    ("creep", "creep", "{y}", "in a hold of all inputs; positive: in the direction of motion"),
    ("creep time", "creep_time", "s", "time over which creep was measured"),
    ("drift", "drift", "{y}", "from one cycle to the next between the same extremes"),
    ("rate dependence", "rate_dependence", "%", "growth of e_w at twice the speed"),
    ("speed compared", "speeds", "{u}/s", "mean speed of the input in cycles alike"),
)
"""Name, field, unit and meaning of every figure; of a field with two ends, both are given."""


def quantities(measures: Characterization) -> Iterator[Quantity]:
    """Yield every quantity of a characterization."""
    names = {"input": measures.input, "output": measures.output}
    units = {"u": measures.input_unit, "y": measures.output_unit}

    def unit_of(form: str) -> str:
        unit = form.format(**units).strip().removesuffix("/")
        return f"1{unit}" if unit.startswith("/") else unit

    for name, field, unit, meaning in QUANTITIES:
        value, limits = getattr(measures, field), measures.intervals.get(field)
        heading = name.format(**names), unit_of(unit)
        if isinstance(value, tuple):
            for side, end in zip(("lowest", "highest"), value, strict=True):
                yield Quantity(f"{side} {heading[0]}", end, limits, heading[1], meaning)
        else:
            yield Quantity(heading[0], value, limits, heading[1], meaning)
    slope = unit_of("{y}/{u}")
    for level in measures.levels:
        at = " and ".join(f"{name} at {size(unit, x)}" for name, x, unit in level.held)
        local = level.found
        for name, field, unit in (("loop width", "loop_width", "%"), ("gain", "gain", slope)):
            limits = local.intervals.get(field)
            yield Quantity(
                f"{name} with {at}",
                getattr(local, field),
                limits,
                unit,
                "at mid input there",
            )


def characterization_sentences(measures: Characterization) -> list[str]:
    """Return the main results of a characterization; its table has all, with intervals."""
    u, y = measures.input, measures.output
    ends = measures.output_range[::-1] if measures.falls else measures.output_range
    slope = f"{measures.output_unit}/{measures.input_unit}".removesuffix("/")
    gain = "" if measures.gain is None else f", slope {size(slope, measures.gain)} at mid {u}"
    sentences = [
        f"{y} covers {_spanning(ends, measures.output_unit)} while {u} covers "
        f"{_spanning(measures.input_range, measures.input_unit)}{gain}."
    ]
    if measures.loop_width is not None and measures.mid_width is not None:
        sentences.append(
            f"Loop width at mid {u}: {numeral(measures.loop_width, 2)} % of the output range of the "
            f"cycle, {size(measures.output_unit, measures.mid_width)}."
        )
    elif measures.branch_gap is not None:
        undetected = "Too few branches, or too much noise, to detect a loop: "
        start = {True: "", False: "No loop: ", None: undetected}[measures.has_loop]
        gap = f"the mean gap between branches is {size(measures.output_unit, measures.branch_gap)}."
        sentences.append(f"{start}{gap}")
    else:
        sentences.append(
            f"{u} and its direction explain {percent(measures.loop_share)} of the variance of {y}."
        )
    if measures.branch_gap is not None and measures.p_loop is None:
        sentences.append(
            "No recording has four branches: drift would also separate rising and falling output."
        )
    return [f"{sentence[0].upper()}{sentence[1:]}" for sentence in sentences]


def _spanning(limits: tuple[float, float], unit: str) -> str:
    """Return limits rounded to about a percent of their distance."""
    digits = 2 - math.floor(math.log10(abs(limits[1] - limits[0]) or 1.0))
    low, high = (f"{round(limit, digits) + 0.0:.6g}" for limit in limits)
    return f"{low} to {high} {unit}".rstrip()


# --- Residual check ---------------------------------------------------------------------------------


def check_verdict(validation: Validation, *, sized: bool = True) -> str:
    """Return the main finding on every output's residual, one sentence each."""
    return " ".join(_residual(check, sized=sized) for check in validation.outputs)


def check_notes(check: OutputCheck) -> list[str]:
    """Return whether a residual is white."""
    p = check.whiteness.p_value
    if p is None:
        return []
    white = "white" if p > WHITE else "not white"
    return [f"The residual of {check.output} is {white} (p = {probability(p)})."]


def missed(check: OutputCheck, cause: Cause) -> str:
    """Return a cause of a residual in a few words."""
    words = _KINDS[cause.kind].format(channel=cause.channel)
    value = cause.coefficient or 0.0
    if cause.kind == "offset":
        return f"{words} of {size(check.unit, value)}"
    if cause.kind == "lag" and value:
        step, unit = (check.sample_time, "s") if check.sample_time else (1.0, "samples")
        return f"{words}, about {size(unit, value * step)}"
    return words


WHITE = 0.01
"""p-value above which a residual is called white."""

_KINDS = {
    "offset": "an offset",
    "curve": "the nonlinearity over {channel}",
    "load": "{channel}",
    "hysteresis": "the direction of {channel} (hysteresis)",
    "lag": "a delay of the output",
    "drift": "time within a recording (drift)",
    "speed": "the speed of the output (rate dependence)",
    "creep": "slow motion in holds (creep)",
    "output": "the output itself (nonlinearity or stop)",
}


def _residual(check: OutputCheck, *, sized: bool = True) -> str:
    error = size(check.unit, check.rmse)
    if check.exact:
        return (
            f"The residual of {check.output}, {error} RMS, is within rounding or the sensor's step."
        )
    if check.useless:
        return (
            f"The model is of no use for {check.output}: its RMSE is {error}, that of the mean "
            f"{numeral(check.mean_error, 2)}."
        )
    mean = next(cause.coefficient for cause in check.suspects if cause.kind == "offset")
    sizes = [f"{error} RMS ({percent(check.rmse / check.span)} of its range)"] if sized else []
    sizes.append(f"mean {size(check.unit, mean or 0.0)}")
    residual = f"The residual of {check.output}, {', '.join(sizes)},"
    if not check.missing:
        return f"{residual} is explained by none of the {len(check.suspects)} causes tested."
    first = max(check.missing, key=lambda cause: cause.share)
    quantity = "mean square" if first.kind == "offset" else "variance"
    share = f"{percent(first.share)} of its {quantity}"
    return f"{residual} is partly explained by {missed(check, first)}: {share}."


def probability(value: float) -> str:
    """Return a formatted p-value."""
    return "0.000001 or less" if value <= 1e-6 else numeral(value, 2)


# --- Data gaps and plans ----------------------------------------------------------------------------

GAPS = {
    "still": "Nothing can be identified: {channels} is constant.",
    "hysteresis": "Hysteresis cannot be identified: {channels} has {value} turning points.",
    "minor loops": "Minor loops cannot be identified: {value} turning points of {channels} lie "
    "inside its range on one side, where {needed} are needed.",
    "coupling": "Effects of {channels} cannot be separated: one follows from the others (R² = {value}).",
    "spring load": "Load and stiffness cannot be separated: {channels} are proportional (R² = {value}).",
    "resting": "The effect of {channels} cannot be identified: constant at {levels}.",
    "together": "Joint effects cannot be identified: {channels} are away from rest together in "
    "{percent} of the samples.",
    "range": "Behaviour beyond the recorded range of {channels} cannot be identified: tests go further "
    "by {percent} of it.",
    "rate": "Rate dependence cannot be identified: similar branches of {channels} differ in speed by a "
    "factor of {value}, where {needed} is needed.",
    "creep": "Creep cannot be identified: the longest hold lasts {value} s, where {needed} s "
    "are needed.",
    "time": "Rate dependence and creep cannot be identified: {percent} of the recordings have time.",
}
GAPS["load"] = GAPS["resting"]
PLAN = "{seconds} s: {parts}."
LEFT_OPEN = "Not closed by this plan: {gap} {run}"
EXTRAPOLATED = "{channel} goes beyond the recordings: errors there are extrapolated."
ROUNDED = 1e-3
"""An end of a range is written as 0 if it is smaller than this, relative to the larger end."""
RUN = "Record {what}."
RUNS = {
    "random": "all inputs and loads moving at random{levels}",
    "speeds": "the same motion three times slower and three times faster",
    "holds": "holds of 30 s at several levels",
    "time": "time, or give the rate",
}


def gap_sentence(gap: Gap) -> str:
    """Return a data gap with its number."""
    return GAPS[gap.what].format(
        channels=listing(gap.channels),
        value=numeral(gap.value, 2),
        needed=numeral(gap.needed, 2),
        percent=f"{numeral(100 * gap.value, 2)} %",
        levels=_levels(gap.ranges),
    )


def gap_name(gap: Gap) -> str:
    """Return a data gap without its number."""
    return GAPS[gap.what].split(" cannot be ")[0].format(channels=listing(gap.channels)).lower()


def gap_run(gap: Gap, ranges: bool = True) -> str:
    """Return the run that closes a data gap, optionally with the recorded ranges."""
    moved = {name: ends for name, ends in gap.ranges.items() if ends[0] < ends[1] and ranges}
    levels = f" over {_levels(moved)}" if moved else ""
    return RUN.format(what=RUNS[gap.run].format(levels=levels))


def plan_sentences(plan: Plan) -> list[str]:
    """Return the purpose of a plan, the gaps it leaves, and extrapolations."""
    parts = {step.what for step in plan.steps}
    open_gaps = [gap for gap in plan.gaps if not any(gap.what in step.gaps for step in plan.steps)]
    return [
        PLAN.format(seconds=f"{plan.recording.duration:.0f}", parts=listing(sorted(parts))),
        *(LEFT_OPEN.format(gap=gap_sentence(gap), run=gap_run(gap)) for gap in open_gaps),
        *(EXTRAPOLATED.format(channel=name) for name in plan.extrapolated),
    ]


def _levels(ranges: Mapping[str, tuple[float, float]]) -> str:
    """Return recorded ranges of channels; an end that is small beside the other is 0."""

    def ends_of(ends: tuple[float, float]) -> str:
        largest = max(map(abs, ends))
        rounded = (end if abs(end) > ROUNDED * largest else 0.0 for end in ends)
        return " to ".join(dict.fromkeys(f"{end:.3g}" for end in rounded))

    parts = ((ends_of(ends), standard_unit(name) or "") for name, ends in ranges.items())
    return listing([f"{ends} {unit}" for ends, unit in parts]).strip()


def listing(names: Sequence[str]) -> str:
    """Return names joined by commas and "and".

    >>> listing(["a", "b", "c"])
    'a, b and c'
    """
    *most, last = names
    return f"{', '.join(most)} and {last}" if most else last


# --- Bands and log reviews --------------------------------------------------------------------------


def calibrated_on_blocks(calibration: Calibration) -> str:
    """Return the limitation of a band whose units are blocks of runs."""
    return (
        f"{calibration.band.units} blocks of {calibration.runs} run(s) count as exchangeable, so "
        "differences between runs are not in the band: calibrate on 9 runs or more."
    )


def outside_calibration(
    run: str, channel: Channel, share: float, values: Array, ends: tuple[float, float]
) -> str:
    """Return the share of a run beyond the range of a calibration."""
    least, most = numeral(float(values.min()), 3), numeral(float(values.max()), 3)
    low, high = (numeral(end, 3) for end in ends)
    return (
        f"In {run}, {channel.name} goes from {least} to {most} {channel.unit}, the calibration from "
        f"{low} to {high}: beyond it, in {percent(share, 3)} of the samples, the level of the band is "
        "not guaranteed."
    )


def reviewed(log: Review) -> list[str]:
    """Return the results of a log's review: every output, then delays, limits and the refit."""
    source = " of the compensator" if log.judged_by == "compensator" else ""
    sentences = []
    for output in log.outputs:
        sized = partial(size, output.unit)
        sentences.append(
            f"{output.output}: achieved error {sized(output.achieved)} RMS; the model misses "
            f"{sized(output.residual)} of the measured motion."
        )
        if output.predicted is not None and output.pressure is not None:
            sentences.append(
                f"{output.output}: the model predicts an error of {sized(output.predicted)} for the "
                f"commands{source}, and {sized(output.pressure)} for pressures that differ from them."
            )
        low, high = (numeral(60 * end, 2) for end in output.drift_interval)
        sentences.append(
            f"{output.output}: the residual drifts by {sized(60 * output.drift)} per minute (95 %: "
            f"{low} to {high})."
        )
    for delay in log.delays:
        late, low, high = (numeral(1000 * x, 2) for x in (delay.seconds, *delay.interval))
        sentences.append(f"Delay and lag of {delay.where}: {late} ms (95 %: {low} to {high}).")
    if log.clipped:
        sentences.append(f"{log.clipped} of {log.n_samples} samples are at a limit of the command.")
    if isinstance(log.refit, str):
        sentences.append(log.refit)
    elif log.refit is not None:
        low, high = (percent(end, 2) for end in log.refit.ratio)
        sentences.append(
            f"The model fitted again to the log has {percent(log.refit.new / log.refit.old, 2)} of "
            f"the old one's error on {log.refit.n_parts} parts held out (95 %: {low} to {high})."
        )
    return sentences


def size(unit: str, value: float) -> str:
    """Return a number with its unit."""
    return f"{numeral(value, 2)} {unit}".rstrip()


# --- A study ----------------------------------------------------------------------------------------


def answers(study: Study) -> tuple[tuple[str, str], ...]:
    """Return the three questions about a model, each with one sentence: at most 60 words together."""
    return (
        ("Is it right?", _right(study)),
        ("How far off may it be?", _how_far(study)),
        ("What to record next?", _record_next(study)),
    )


def _right(study: Study) -> str:
    if study.leaderboard.best is None:
        return "No model is chosen."
    if study.check is None:
        return "The chosen model is checked when all are fitted."
    if isinstance(study.check, str):
        return study.check
    worst = max(study.check.outputs, key=lambda check: check.rmse / max(check.span, 1e-300))
    return _residual(worst, sized=False)  # the tile has the size


def _how_far(study: Study) -> str:
    best, unit = study.leaderboard.best, study.leaderboard.unit
    if best is None or best.test is None:
        return "No model is chosen."
    if best.band is None:
        largest = f"{numeral(best.test.max_error, 2)} {unit}".strip()
        return f"A 90 % band is not known; the largest test error is {largest}."
    unknown = best.band.unknown
    farthest = max if unknown == "wide" else min
    worst = farthest(best.band.coverage, key=best.band.coverage.__getitem__)
    output = f" for {worst}" if len(best.band.coverage) > 1 else ""
    half = numeral(best.band.width[worst] / 2, 2)
    band = f"(±{half} {best.band.unit_of_width})"
    if unknown is None:
        inside = percent(best.band.coverage[worst])
        return f"The 90 % band{output} {band} contains {inside} of the test samples."
    counts = {"blocks": best.band.units, "branches": best.band.branches}
    if unknown in counts:
        kind = "independent blocks" if unknown == "blocks" else "different branches"
        what = f"training has {counts[unknown]} {kind}, and {best.band.needed} are needed"
    else:
        inside = percent(best.band.highest if unknown == "wide" else best.band.lowest)
        what = f"that of training{output} {band} contains {inside} of a test recording"
    return f"A 90 % band is not known: {what}."


def _record_next(study: Study) -> str:
    if not study.data_gaps:
        return "No data gaps were found."
    first, *others = study.data_gaps
    more = f" ({counted(len(others), 'more gap')})" if others else ""
    return f"{gap_run(first, ranges=False)[:-1]}: {gap_name(first)} cannot be identified{more}."


def compensated(study: Study) -> list[str]:
    """Return which better models have no compensator and why, and what an error leaves out."""
    sentences = [f"No compensator of {model}: {why}" for model, why in study.passed_over.items()]
    return [*sentences, *_left_out(study.inverse.commands if study.inverse is not None else ())]


def _left_out(commands: Sequence[str]) -> list[str]:
    """Return what the expected error of following does not include."""
    if not commands:
        return []
    names = ", ".join(commands)
    return [
        f"The expected error leaves out what lies between {names} and the measured input, such as the "
        "lag of a regulator: to include it, choose the command as input."
    ]


def expected(numbers: Mapping[str, Any]) -> str:
    """Return the error to expect of a compensator, from `Compensation.to_dict`."""
    unit, ends = numbers["unit"], numbers["following_interval"]
    interval = f" (95 %: {numeral(ends[0], 2)} to {numeral(ends[1], 2)})" if ends else ""
    error, plain = (size(unit, numbers[key]) for key in ("following_error", "static_map_error"))
    sentence = f"Expected RMSE of following: {error}{interval}; a static map: {plain}."
    return " ".join([sentence, *_left_out(numbers["commands"])])


def not_looped(study: Study) -> str:
    """Return why no loop was closed; empty if one was."""
    return f"No loop was closed: {study.not_looped}" if study.not_looped else ""


PLANTS = {
    "rig": "virtual rig: errors as on its muscle",
    "same model": "the model that the compensator inverts: errors of limits, rates and rounding alone, "
    "not those on the muscle",
    "another model": "another model: errors as far as it is the muscle",
}
"""Plants of loops, and what errors on them tell."""


def tracked(tracking: Tracking) -> list[str]:
    """Return the plant of a tracked reference, and its part out of reach."""
    run = tracking.tracked
    unit = run.recording.units[next(iter(run.rmse))]
    sentences = [
        f"Plant: {tracking.plant.name} ({PLANTS[tracking.plant_kind]}), seed {tracking.seed}."
    ]
    if tracking.flatters_feedback:
        sentences.append(
            "The plant responds within one sample; on a muscle, feedback performs worse."
        )
    if run.clipped >= len(run.recording):
        sentences.append("Commands were at a limit throughout: the reference is out of reach.")
    elif run.clipped > max((far.samples for far in run.beyond.values()), default=0):
        sentences.append(f"Commands were at a limit in {run.clipped} steps.")
    sentences += [
        f"{far.samples} samples of the reference {name} are out of reach ({numeral(far.low, 4)} to "
        f"{numeral(far.high, 4)} {unit}); RMSE over the others: {size(unit, far.rmse_elsewhere)}."
        for name, far in run.beyond.items()
    ]
    median, largest = (1e6 * seconds for seconds in run.step_time)
    return [*sentences, f"Controller: {median:.0f} µs a step (median), {largest:.0f} µs (99.9 %)."]


def learned(runs: Learned) -> list[str]:
    """Return which repetition is kept, and how errors converge."""
    return [
        f"Corrections of repetition {runs.best_repetition} are kept.",
        *(
            f"{name}: learned up to {numeral(runs.cutoff[name], 2)} Hz; the error falls by a factor of "
            f"{numeral(runs.convergence[name], 2)} per repetition ({numeral(runs.expected[name], 2)} "
            "if the plant were linear and without noise)."
            for name in runs.rmse
        ),
    ]


def read_lines(recordings: Sequence[Recording]) -> list[str]:
    """Return a line on each of some recordings: channels, ranges, grid, and what was left out."""
    latest = {(run.source, run.name): run for run in recordings}  # some are read twice
    lines = [_read(run) for run in list(latest.values())[:MOST_LINES]]
    more = list(latest.values())[MOST_LINES:]
    samples = sum(map(len, more))
    return [*lines, f"{len(more)} more recordings: {samples} samples in all"] if more else lines


def _read(recording: Recording) -> str:
    conversions = dict(
        text.split(" from ", 1) for text in recording.meta.get("converted_units", ())
    )
    ranges = []
    for name, ends in recording.ranges.items():
        low, high = (numeral(end + 0.0, 3) for end in ends)
        original = (
            f" (from {conversions[name].partition(' to ')[0]})" if name in conversions else ""
        )
        ranges.append(f"{name} {low} to {high} {recording.units[name]}".rstrip() + original)
    grid = "no time" if recording.sample_time is None else f"{recording.sample_time:g} s apart"
    duration = "" if recording.duration is None else f", {numeral(recording.duration, 3)} s"
    ignored = recording.meta.get("ignored_columns", ())
    unread = f"; not read: {listed(ignored, MOST_LINES)}" if ignored else ""
    return (
        f"{recording.name}: {listed(ranges, 8)}; {len(recording)} samples {grid}{duration}{unread}"
    )


def duration(recording: Recording) -> str:
    """Return how long a recording is."""
    samples = f"{recording.n_samples} samples"
    if recording.duration is None or recording.sample_time is None:
        return f"{samples}, no time"
    return f"{samples}, {numeral(recording.duration, 3)} s at {numeral(1 / recording.sample_time, 3)} Hz"
