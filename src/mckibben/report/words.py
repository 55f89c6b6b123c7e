"""Every sentence about results: each is made from the numbers of a result, which stand beside it.

Library functions return numbers. Whatever says something about them to a person is here, in one section
a room, so that all of it can be read, counted and tested on plants where it is false.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from mckibben.numerals import numeral
from mckibben.recording import standard_unit

if TYPE_CHECKING:
    from mckibben.comparison.choosing import Against, Choice
    from mckibben.comparison.leaderboard import Leaderboard
    from mckibben.diagnosis.check import Finding, OutputCheck, Validation
    from mckibben.diagnosis.data_gaps import Gap

# --- Comparison -------------------------------------------------------------------------------------

CHOICES = {
    "cross-validation": ("CV RMSE", "cross-validation on the training side"),
    "validation": (
        "validation RMSE",
        "the last part of the training data, left out of a fit for it",
    ),
    "given": ("validation RMSE", "runs given for it, to which nothing is fitted"),
    "fit": ("fit RMSE", "the error on the data fitted, for want of a validation"),
}
"""What a model may be chosen by: the heading of its figure, and in words. The test is not among them."""

STARTED = (
    "Memory starts as training left it where the test continues from there; else, with one driving "
    "input, from the excursion that best explains the first measured output (--initial measured)."
)
"""How models are run free in a comparison."""

LEVEL = (
    "not distinguished from the chosen model by this test: the interval of the difference holds 0"
)
"""Of a model that is `level`."""

CAREFUL = "good only near the motions fitted, so its error counts twice in the order"
"""Of a model with a caution."""


def chosen(board: Leaderboard) -> str:
    """Return which model is chosen and by what, its test error, and the lowest; empty without any."""
    best, lowest = board.best, board.lowest
    if board.not_recommended is not None and board.constant is not None:
        first = next(row for row in board.rows if row.reason is None)
        given = first.to_dict(), board.constant.to_dict()
        return not_recommended(board.not_recommended, *given, board.unit)
    if best is None or lowest is None:
        return ""
    heading, by = CHOICES["fit" if best.validation_rmse is None else board.chosen_by]
    own, least, error = (
        f"{numeral(value, 3)} {board.unit}".strip()
        for value in (best.test_error, lowest.test_error, best.chosen_by)
    )
    end = "the lowest." if lowest is best else f"lowest test RMSE: {lowest.model}, {least}."
    return f"Chosen by {by}: {best.model}, {heading} {error}; its test RMSE {own}, {end}"


def not_recommended(
    where: Against, row: Mapping[str, Any], constant: Mapping[str, Any], unit: str
) -> str:
    """Return why a model, the first in the order of the choice, is not recommended.

    Parameters
    ----------
    where : {"validation", "test"}
        Where it does not beat the constant.
    row, constant : mapping
        Their rows, as files hold them.
    unit : str
        Of errors.
    """
    on_test = where == "test"
    errors = [one["test"]["rmse"] if on_test else one["validation_rmse"] for one in (row, constant)]
    own, mean = (f"{numeral(error, 3)} {unit}".strip() for error in errors)
    on = "the test data" if on_test else "what was left out to validate"
    return (
        f"No model is recommended: on {on}, {row['model']} is off by {own} RMSE, and the mean of the "
        f"training output by {mean}."
    )


def comparison(board: Leaderboard) -> list[str]:
    """Return what is to be said of a comparison beside its table."""
    best, choice = board.best, board.choice
    said = list(board.shared)
    if board.loads:
        said.append(f"Given to models beside the inputs: {', '.join(board.loads)}.")
    said += [
        f"{name} varies, and no model is given it: see --input and --load."
        for name in board.ignored
    ]
    said += [
        f"{name} is outside its training range in {numeral(100 * share, 2)} % of the test samples."
        for name, share in board.outside.items()
    ]
    if best is not None and choice is not None:
        said.append(cost_of_choice(choice, board.unit))
    if best is not None and best.band is not None:
        said.append(f"{best.model}: {best.band}.")
    if best is not None:
        said += [f"{best.model}: {note}." for note in best.diagnostics.get("notes", ())]
    return said


def cost_of_choice(choice: Choice, unit: str) -> str:
    """Return what choosing among models by their errors costs."""
    own, fair = (f"{numeral(e, 3)} {unit}".strip() for e in (choice.error, choice.expected))
    picked = ", ".join(
        f"{model} in {numeral(100 * share, 2)} %"
        for model, share in choice.picked.items()
        if share >= 0.01
    )
    return (
        f"Chosen among {choice.among} models: the least error of cross-validation is {own}, and {fair} "
        f"is to be expected of data that did not choose. Resampled data choose {picked}."
    )


def not_validated(board: Leaderboard) -> list[str]:
    """Return which models' validation failed, and why."""
    return [
        f"{row.model}: not chosen, as its validation failed: {row.validation_failed}"
        for row in board.rows
        if row.reason is None and row.validation_failed
    ]


# --- What the muscle does ---------------------------------------------------------------------------

# --- Residual check ---------------------------------------------------------------------------------


def check_verdict(found: Validation) -> str:
    """Return what the residual of every output follows first, in a sentence each."""
    return " ".join(_residual(one) for one in found.outputs)


def check_sentences(found: Validation) -> list[str]:
    """Return everything that residuals follow, whether they are white, and one line of advice each."""
    said = []
    for one in found.outputs:
        own = [] if one.exact else [_missed(one, each) for each in one.missing]
        if one.whiteness.p_value is not None:
            white = one.whiteness.p_value > WHITE
            own.append(f"It is {'' if white else 'not '}white ({_p(one.whiteness.p_value)}).")
        if one.missing and not one.exact:
            own.append(_advice(one.missing[0]))
        said += [
            f"{one.output}: {each}" if len(found.outputs) > 1 else each for each in own if each
        ]
    return said


def missed(one: OutputCheck, finding: Finding) -> str:
    """Return in a few words what a residual follows, and what it may be as well."""
    kinds = [_KINDS[kind] for kind in (finding.kind, *finding.or_kinds)]
    step, unit = (one.sample_time, "s") if one.sample_time else (1.0, "samples")
    value = finding.coefficient or 0.0
    number = ""
    if finding.kind == "offset":
        number = f" of {numeral(value, 2)} {one.unit}".rstrip()
    elif finding.kind == "lag" and value:
        number = f", about {numeral(value * step, 2)} {unit}"
    return " or ".join(kinds).format(channel=finding.channel or "the input") + number


WHITE = 0.01
"""p-value above which a residual is called white."""

_KINDS = {
    "offset": "an offset",
    "runs": "offsets that differ between recordings",
    "curve": "the curve over {channel}",
    "load": "{channel}",
    "hysteresis": "the branch of {channel} (hysteresis)",
    "lag": "a lag of the output",
    "drift": "time within a recording (drift)",
    "speed": "the speed of the output",
    "creep": "slow motion in holds (creep)",
    "output": "the position (a curve or an end stop)",
}

_ADVICE = {
    "load": "Fit a model that reads {channel}.",
    "hysteresis": "Compare models with other hysteresis, as to branches and minor loops.",
    "lag": "Fit a model with a lag, or measure pressure at the muscle.",
    "drift": "Warm the rig up before recording, or fit again when it has.",
    "speed": "Compare rate-dependent models.",
    "creep": "Compare models with viscoelastic states.",
    "output": "Check the rig for a stop or contact at the ends of its range.",
}


def _residual(one: OutputCheck) -> str:
    size = f"{numeral(one.rmse, 2)} {one.unit}".rstrip()
    of_range = f"{_percent(one.rmse / one.span)} of its range"
    if one.exact:
        return f"The residual of {one.output}, {size} RMS, is within rounding or the sensor's step."
    if one.useless:
        return (
            f"The model is no better than the mean of {one.output}: {size} RMSE, standard deviation "
            f"{numeral(one.deviation, 2)}."
        )
    residual = f"The residual of {one.output}, {size} RMS ({of_range}),"
    if not one.missing:
        return f"{residual} follows none of {one.n_tests} causes tested."
    first = one.missing[0]
    return (
        f"{residual} follows {missed(one, first)}: {_percent(first.share)} of its variance, "
        f"{_p(first.p_value)}."
    )


def _missed(one: OutputCheck, finding: Finding) -> str:
    what = missed(one, finding)
    return (
        f"{what[0].upper()}{what[1:]}: {numeral(finding.size, 2)} {one.unit} RMS, "
        f"{_percent(finding.share)} of the residual's variance ({_p(finding.p_value)})."
    )


def _advice(first: Finding) -> str:
    return "" if first.or_kinds else _ADVICE.get(first.kind, "").format(channel=first.channel)


def _p(value: float) -> str:
    return "p < 0.000001" if value < 1e-6 else f"p = {numeral(value, 2)}"


def _percent(share: float) -> str:
    return f"{numeral(100 * share, 2)} %"


# --- Data gaps and plans ----------------------------------------------------------------------------

GAPS = {
    "still": "Nothing can be identified: {channels} moves by no more than its noise.",
    "hysteresis": "Hysteresis cannot be identified: {channels} has {value} turning points.",
    "minor loops": "Minor loops cannot be identified: {value} turning points of {channels} lie "
    "inside its range on one side, where {needed} are needed.",
    "coupling": "Effects of {channels} cannot be separated: one follows from the others (R² = {value}).",
    "spring load": "Load and stiffness cannot be separated: {channels} are proportional (R² = {value}).",
    "resting": "The effect of {channels} cannot be identified: constant at {levels}.",
    "together": "Joint effects cannot be identified: {channels} are off their rest together in "
    "{percent} of the samples.",
    "range": "Behaviour beyond the recorded range of {channels} cannot be identified: tests go further "
    "by {percent} of it.",
    "rate": "Rate dependence cannot be identified: similar branches of {channels} differ in speed by a "
    "factor of {value}, where {needed} is needed.",
    "creep": "Creep cannot be identified: the longest hold lasts {value} s, where {needed} s "
    "are needed.",
    "time": "Rate dependence and creep cannot be identified: {percent} of the recordings have time.",
    "sampling": "Shapes of branches cannot be identified: {channels} has {value} samples a "
    "branch, where {needed} are needed.",
    "resolution": "Loops below {percent} of the range of {channels} cannot be identified: noise or the "
    "steps of the sensor are that large.",
    "clipped": "Behaviour beyond {levels} cannot be identified: {channels} stays at a limit for {value} "
    "samples.",
    "repeats": "Repeatability cannot be identified: {value} cycles of {channels} are recorded twice.",
}
GAPS["load"] = GAPS["resting"]
RUN = "Record {what}."
RUNS = {
    "random": "all inputs and loads moving at random over {levels}",
    "speeds": "the same motion at a third of the speed, and three times as fast",
    "holds": "holds of 30 s at several levels",
    "repeats": "one run twice",
    "time": "time, or give the rate",
    "sampling": "at a higher rate",
    "sensor": "with a finer or wider sensor",
}


def gap_sentence(gap: Gap) -> str:
    """Return what recordings cannot identify, with the number that shows it."""
    return GAPS[gap.what].format(
        channels=listing(gap.channels),
        value=numeral(gap.value, 2),
        needed=numeral(gap.needed, 2),
        percent=f"{numeral(100 * gap.value, 2)} %",
        levels=_levels(gap),
    )


def gap_run(gap: Gap) -> str:
    """Return the run that would identify it."""
    return RUN.format(what=RUNS[gap.run].format(levels=_levels(gap)))


def _levels(gap: Gap) -> str:
    """Return the recorded ranges of the channels of a gap."""
    return listing(
        [
            " to ".join(dict.fromkeys(f"{end:.3g}" for end in ends))
            + f" {standard_unit(name) or ''}"
            for name, ends in gap.ranges.items()
        ]
    ).strip()


def listing(names: Sequence[str]) -> str:
    """Return names as a sentence has them.

    >>> listing(["a", "b", "c"])
    'a, b and c'
    """
    *most, last = names
    return f"{', '.join(most)} and {last}" if most else last


# --- Bands and log reviews --------------------------------------------------------------------------

# --- The three answers ------------------------------------------------------------------------------
