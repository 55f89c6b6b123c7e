"""Every sentence about results: each is made from the numbers of a result, which stand beside it.

Library functions return numbers. Whatever says something about them to a person is here, in one section
a room, so that all of it can be read, counted and tested on plants where it is false.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from mckibben.numerals import numeral

if TYPE_CHECKING:
    from mckibben.diagnosis.check import Finding, OutputCheck, Validation

# --- Comparison -------------------------------------------------------------------------------------

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

# --- Bands and log reviews --------------------------------------------------------------------------

# --- The three answers ------------------------------------------------------------------------------
