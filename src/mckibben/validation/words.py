"""A check in words: whether the model is right, what it misses, and what is left after that."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mckibben.numerals import numeral

if TYPE_CHECKING:
    from mckibben.validation.results import Finding, OutputCheck, Validation

NOTHING = "Nothing is found wrong with the model"

FEW = 2
"""Things missed up to which a model is right but for them."""

SMALL = 0.02
"""Share of the range up to which what is missed is small, root mean square."""

NAMED = 3
"""Things missed that the verdict names."""

SLOW = 3.0
"""Samples that noise of a filtered sensor remembers at most."""

SURE = 1e-6
"""p-values below are not told any closer."""


def verdict(found: Validation) -> str:
    """Return whether a model is right, and what it misses, in one sentence."""
    if len(found.outputs) == 1:
        return f"{_verdict(found.outputs[0])}."
    if found.right:
        return f"{_verdict(found.outputs[0])}; so for all {len(found.outputs)} outputs."
    return "; ".join(f"{one.output}: {_lower(_verdict(one))}" for one in found.outputs) + "."


def sentences(one: OutputCheck) -> list[str]:
    """Return what is to be known of an output beside the verdict, the most important first."""
    from mckibben.validation.level import FEWEST

    size = f"{numeral(one.rmse, 2)} {one.unit}".rstrip()
    said = [f"It is off by {size} RMS, {_percent(one.rmse / one.span)} of the range, running free."]
    if not one.exact:
        said += [_told(one, each) for each in one.missing]
        said += [_slow(one)] if one.slow else []
    said.append(_rest(one))
    if one.independent < FEWEST:
        said.append(
            f"Noise remembers so long that these recordings hold only about {one.independent:.0f} "
            f"independent samples; with fewer than {FEWEST:.0f}, only what is very certain is named. "
            "Record for longer to tell more."
        )
    if one.p_branch is not None and not one.exact:
        said.append(_branches(one, one.p_branch))
    return said


def _branches(one: OutputCheck, p: float) -> str:
    """Return whether hysteresis is left in the residual."""
    if p > LEVEL:
        return (
            f"At equal inputs, the residual is the same on rising and falling branches ({_p(p)})."
        )
    said = f"At equal inputs, the residual differs between rising and falling branches ({_p(p)})"
    if any("hysteresis" in _kinds(each) for each in one.missing):
        return f"{said}."
    why = "what is missed brings that about" if one.missing else "by chance, among so many tests"
    return f"{said}: {why}."


LEVEL = 0.01
"""Of the single test of branches, as it is told."""


def phrase(one: OutputCheck, finding: Finding) -> str:
    """Return what a model misses, as what comes after "but for"."""
    if finding.or_kinds:
        kinds = {"hysteresis": "hysteresis", "speed": "speed", "lag": "delay"}
        names = [name for kind, name in kinds.items() if kind in _kinds(finding)]
        either = f"{', '.join(names[:-1])} or {names[-1]}"
        by = finding.channel or next(
            each.channel for each in one.suspects if each.kind in finding.or_kinds and each.channel
        )
        return f"{either} of {by} (these recordings cannot tell them apart)"
    by = finding.channel
    step = one.sample_time or 1.0
    unit = " s" if one.sample_time else " samples"
    late = -(finding.coefficient or 0.0) * step
    return {
        "offset": f"an offset of {numeral(finding.coefficient, 2)} {one.unit}".rstrip(),
        "runs": "offsets that differ from run to run",
        "curve": f"the gain or shape of the curve over {by}",
        "load": f"the effect of {by}",
        "hysteresis": f"hysteresis over {by} that is left",
        "lag": f"{'a delay' if late > 0 else 'too much delay'}, about {numeral(abs(late), 2)}{unit}",
        "speed": f"the effect of the speed of {by}",
        "creep": f"creep after {'large steps' if one.large_steps else 'movements'} of {by}",
        "drift": "drift over time",
        "output": f"the shape of the curve over modelled {one.output}",
        "crossing": f"what {by} did shortly before",
    }[finding.kind]


def _kinds(finding: Finding) -> tuple[str, ...]:
    return (finding.kind, *finding.or_kinds)


def _verdict(one: OutputCheck) -> str:
    size = f"{numeral(one.rmse, 2)} {one.unit}".rstrip()
    if one.exact:
        why = (
            f"it is within the steps of the sensor, {numeral(one.resolution, 2)} {one.unit}".rstrip()
            if one.resolution > 0
            else "it is rounding"
        )
        return f"{NOTHING}: what it leaves, {size} RMS, says nothing, for {why}"
    if one.useless:
        return (
            f"The model is of no use here: it is off by {size} RMS, the mean of {one.output} "
            f"by {numeral(one.deviation, 2)}"
        )
    if one.missing:
        named = [phrase(one, each) for each in one.missing[:NAMED]]
        lesser = len(one.missing) - NAMED
        if lesser > 0:
            named.append("one lesser thing" if lesser == 1 else f"{lesser} lesser things")
        things = _listed(named)
        share = sum(each.size**2 for each in one.missing) ** 0.5 / one.span
        if share > SMALL:
            told = f"The model is wrong by {_percent(share)} of the range: it misses {things}"
        elif len(one.missing) <= FEW:
            told = f"The model is right but for {things}, {_percent(share)} of the range"
        else:
            told = (
                f"The model is right to {_percent(share)} of the range, by which it misses {things}"
            )
        apart = [phrase(one, each) for each in one.slow]
        if sum(each.share for each in one.slow) > sum(each.share for each in one.missing):
            told += f"; more of the residual, {size} RMS in all, is {_listed(apart)}, or slow noise"
        return told
    if one.white:
        return f"{NOTHING}: what it leaves, {size} RMS, is white noise"
    return (
        f"{NOTHING}: what it leaves, {size} RMS, follows nothing recorded, though it is not white"
    )


def _told(one: OutputCheck, finding: Finding) -> str:
    what = phrase(one, finding)
    return (
        f"{what[0].upper()}{what[1:]}: {numeral(100 * finding.share, 2)} % of the residual's variance, "
        f"{numeral(finding.size, 2)} {one.unit} RMS, {_percent(finding.size / one.span)} of "
        f"the range ({_p(finding.p_value)})."
    )


def _slow(one: OutputCheck) -> str:
    """Return what level and trend make of the residual, where noise may bring them about."""
    parts = [
        f"{phrase(one, each)}, {_percent(each.share)} ({_p(each.p_value)})" for each in one.slow
    ]
    said = _listed(parts)
    return (
        f"{said[0].upper()}{said[1:]} of the residual's variance: noise as slow as this may bring that "
        "about, so these recordings do not tell whether it is the model's."
    )


def _rest(one: OutputCheck) -> str:
    """Return what the residual is like as noise, and where that may come from."""
    if one.exact:
        return "No test is made of what a sensor cannot show."
    p = one.whiteness.p_value
    if p is None:
        return "The recordings are too short to tell whether the residual is white."
    if one.white:
        return f"Its {one.whiteness.n_tested} first autocorrelations are those of white noise ({_p(p)})."
    forgets = (
        f"The residual is not white ({_p(p)}): it forgets within {round(one.noise_time)} samples"
    )
    if one.missing:
        return f"{forgets}, which is to be expected of what is missed."
    if one.noise_time <= SLOW:
        return f"{forgets}, as noise that a sensor's filter has smoothed."
    return (
        f"{forgets}. Slow noise is like that, and so is what no channel here tells of: a disturbance, "
        "or a state that neither the model nor these tests have."
    )


def _p(value: float) -> str:
    return "p < 0.000001" if value < SURE else f"p = {numeral(value, 2)}"


def _percent(share: float) -> str:
    return f"{numeral(100 * share, 2)} %"


def _listed(words: list[str]) -> str:
    if len(words) == 1:
        return words[0]
    return f"{', '.join(words[:-1])} and {words[-1]}"


def _lower(text: str) -> str:
    return text[0].lower() + text[1:]
