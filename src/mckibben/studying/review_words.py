"""A log looked back on, in words."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from mckibben.numerals import numeral

if TYPE_CHECKING:
    from mckibben.diagnosis.check import OutputCheck
    from mckibben.studying.causes import Cause
    from mckibben.studying.chain import Chain
    from mckibben.studying.log import Loop
    from mckibben.studying.refitting import Refit
    from mckibben.studying.reviewing import Followed, Review
    from mckibben.studying.shifts import Delay

NOTABLE = 0.02
"""Share from which a cause is worth a word, on either side of zero."""

MOST = 2
"""Things that the model misses which are named."""

OFF = 0.02
"""By which a gain is other than 1."""

COVERED = 0.9
"""Share of the old model's pressures that a log covers at least, unsaid."""

UNDIVIDED = (
    "the loop answers what it misses, so that its faults, noise, delay and drift cannot be told apart "
    "in this log"
)
"""Of the model, where causes are large and opposite."""

NAMES = {
    "model": "the model",
    "actuator": "the actuator",
    "delay": "delay",
    "noise": "noise",
    "drift": "drift",
    "limits": "limits",
    "feedback": "feedback",
    "compensator": "the compensator",
}
"""Causes in a sentence."""


def verdict(review: Review) -> str:
    """Return achieved against predicted error, and the first cause, for every output."""
    return " ".join(_verdict(one, len(review.outputs) > 1) for one in review.outputs)


def _verdict(one: Followed, several: bool) -> str:
    about = f"{one.output}: achieved" if several else "Achieved"
    said = f"{about} error {_size(one, one.achieved)} RMS; model and compensator foresee "
    said += _size(one, one.predicted)
    if one.exact:
        return f"{said}. Nothing is wrong to speak of."
    first = one.causes[0]
    if first.kind == "noise":
        return f"{said}. Most of it ({_percent(first.share)}) is noise, which no motion explains."
    much = "Most of it" if first.share > 0.5 else "The largest part of it"
    return f"{said}. {much} ({_percent(first.share)}) is {NAMES[first.kind]}: {first.told}."


def sentences(review: Review) -> list[str]:
    """Return every cause worth a word, most important first, then what a refit brings."""
    found: list[str] = []
    if all(one.exact for one in review.outputs):
        return found
    for one in review.outputs:
        about = f"{one.output}: " if len(review.outputs) > 1 else ""
        found += [
            f"{about}{_cause(one, cause)}." for cause in one.causes if abs(cause.share) >= NOTABLE
        ]
    late = [delay for delay in delays(review) if delay.certain]
    found += [f"{_delay(delay)}." for delay in late]
    if not late:
        found.append(_none_late(delays(review)))
    if review.refit is not None:
        found.append(review.refit if isinstance(review.refit, str) else refit(review.refit))
    return found


def delays(review: Review) -> list[Delay]:
    """Return all shifts in time that were found."""
    return [*review.delays, *(delay for one in review.outputs for delay in one.delays)]


def _cause(one: Followed, cause: Cause) -> str:
    name = NAMES[cause.kind].capitalize()
    if cause.share < 0:
        verb = "work" if cause.kind == "limits" else "works"
        return f"{name} {verb} against the rest ({_percent(cause.share)}): {cause.told}"
    return f"{name}, {_percent(cause.share)} ({_size(one, cause.size)} RMS): {cause.told}"


def _delay(delay: Delay) -> str:
    low, high = (numeral(1000 * end, 2) for end in delay.interval)
    said = delay.where[0].upper() + delay.where[1:]
    lag = f", beside a lag of {numeral(1000 * delay.lag, 2)} ms" if delay.lag > 0 else ""
    between = "" if low == high else f" (95 %: {low} to {high})"
    return f"{said} by {numeral(1000 * delay.seconds, 2)} ms{between}{lag}"


def _none_late(tried: Sequence[Delay]) -> str:
    if not tried:
        return "No delay can be told from this log."
    said = [f"{d.where} by {numeral(1000 * d.interval[1], 2)} ms at most" for d in tried]
    return f"No delay is certain: {', '.join(said)} (95 %)."


def refit(found: Refit) -> str:
    """Return whether a model fitted to the log is better, and on what that was tried."""
    low, high = found.ratio
    of = f"running free on {found.n_folds} parts held back in turn"
    said = (
        f"The same kind of model fitted to the log{' and older data' if found.older else ''} has "
        f"{_percent(found.new / found.old)} of the old one's error, {of} "
        f"(95 %: {_percent(low)} to {_percent(high)})"
    )
    if found.ratio[0] > 1:
        return f"{said}: it is worse, so keep the old one."
    if not found.recommended:
        return f"{said}: no more than chance, so keep the old one."
    if found.covered < COVERED:
        said += (
            f"; but the log covers {_percent(found.covered)} of the old model's pressures only, and the "
            "new one knows nothing beyond: give older recordings beside the log"
        )
        return f"{said}."
    return f"{said}: take it."


def missing(one: OutputCheck) -> list[str]:
    """Return what a model misses, but for what has a cause of its own."""
    return [
        " of ".join(filter(None, (each.kind, each.channel)))
        for each in one.missing
        if each.kind not in ("lag", "drift")
    ]


def told(one: Followed, check: OutputCheck, chains: Sequence[Chain]) -> dict[str, str]:
    """Return what each cause is."""
    model = ", ".join(one.missing[:MOST]) or "the level, and how its memory was at the start"
    if abs(one.gain - 1) > OFF and any(each.kind in ("curve", "output") for each in check.missing):
        model += f"; measured motion is {numeral(one.gain, 3)} times the modelled"
    lagging = [d for c in chains for d in c.delays if d.lag > 0 or d.seconds > 0]
    slow = f", lag {numeral(1000 * max(d.lag for d in lagging), 2)} ms" if lagging else ""
    late = [d for d in (*one.delays, *chains[0].delays) if d.certain]
    n = sum(int(c.rows.sum()) for c in chains)
    clipped = sum(c.clipped for c in chains)
    alike = [each for each in check.missing if each.kind == "lag" and each.or_kinds]
    unsure = "; this log cannot tell it from hysteresis that the model misses" if alike else ""
    sensor = check.sensor_noise
    quiet = "" if sensor is None else f"; the sensor's own is about {_size(one, sensor)}"
    return {
        "model": f"it misses {model}",
        "actuator": f"measured pressures are not the wanted ones{slow}",
        "delay": "; ".join(_delay(d)[0].lower() + _delay(d)[1:] for d in late) + unsure
        or "of what moves in time with the model, no shift is certain",
        "noise": f"it follows no motion{quiet}",
        "drift": "what the model misses changes slowly over the log",
        "limits": f"{clipped} of {n} samples are at a limit of pressure, or their reference is out of "
        "reach",
        "feedback": "what it asks for is not what the model would need, or comes too late",
        "compensator": "it is not the inverse of this model; one that plans within limits foresees it",
    }


def notes(review: Review, loop: Loop) -> tuple[str, ...]:
    """Return what to know of a log before believing what is said of it."""
    found = []
    if not review.judged_by:
        found.append(
            "Commanded and measured pressures are not both logged, so the actuator's part is in what "
            "the model misses."
        )
    elif review.judged_by == "compensator" and review.feedback:
        found.append(
            "Commands go beyond what the compensator gives as an inner loop of pressure makes them, so "
            "measured pressures are compared with the compensator's; if motion is fed back too, its "
            "part is told as the actuator's."
        )
    elif review.judged_by == "compensator":
        found.append(
            "No commands are logged, so measured pressures are compared with what the compensator "
            "gives for the reference, as if there was no feedback."
        )
    if loop.learns:
        found.append(
            "The compensator learns: the model's share is what learning has left, and what is said of "
            "the model is said of the one fitted before."
        )
    if (review.feedback and review.judged_by != "compensator") or not loop.known:
        found.append(
            "Commands are others than a compensator alone gives, as with feedback. Feedback answers "
            "noise and faults with pressure, so that the model's part may look smaller or larger than "
            "it is, and a model fitted to this log may be biased. An open-loop run of the same motion "
            "tells more."
        )
    return tuple(found)


def _size(one: Followed, value: float) -> str:
    return f"{numeral(value, 2)} {one.unit}".rstrip()


def _percent(share: float) -> str:
    return f"{numeral(100 * share, 2)} %"
