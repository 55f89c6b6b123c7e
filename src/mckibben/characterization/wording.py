"""Characterization in words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from mckibben.characterization.evidence import LEVEL

if TYPE_CHECKING:
    from mckibben.characterization.results import Characterization

NARROW, WIDE, VERY_WIDE = 5.0, 15.0, 40.0
"""Loop widths from which a loop is called moderate, wide, very wide [%]."""

ASYMMETRIC = 5.0
"""Asymmetry from which a loop is called asymmetric [%]."""

NOTABLE = 0.5
"""Creep, drift and minor-loop errors below this share of the output range are not spoken of as
such [%]."""

REMEMBERED = 2.0
"""Errors of minor loops below this are those of a muscle that remembers its turning points [%]."""

SPOKEN = 5
"""Levels of what is held that are spoken of; the table has all."""


def sentences(found: Characterization) -> list[str]:
    """Return what the muscle does, in plain words, most important first."""
    if not found.depends:
        return [_independent(found), *found.assumed]
    said = [
        _headline(found),
        _motion(found),
        *_effects(found),
        _levels(found),
        _memory(found),
        _rate(found),
        _trust(found),
    ]
    return [*(sentence for sentence in said if sentence), *found.assumed]


def _independent(found: Characterization) -> str:
    return (
        f"{found.output[0].upper()}{found.output[1:]} does not depend on {found.input} by more than "
        f"noise would give ({_level(found.p_dependence)}), so there is no loop, gain or saturation to "
        "tell: check the channels and the sensor."
    )


def _level(p: float | None) -> str:
    shown = "" if p is None else "p < 0.001, " if p < 0.001 else f"p = {p:.2g}, "
    return f"{shown}tested at {100 * LEVEL:g} %"


def _headline(found: Characterization) -> str:
    parts = []
    width = found.loop_width
    if found.has_loop is None:
        parts.append(_undecided(found))
    elif not found.has_loop:
        parts.append(
            f"no loop that noise would not give ({_level(found.p_loop)}): {found.output} follows "
            f"{found.input} along a curve without memory, the branches on average at most "
            f"{_apart(found, found.widest_gap or 0.0)} apart"
        )
    elif width is not None:
        size = (
            "narrow"
            if width < NARROW
            else "moderately wide"
            if width < WIDE
            else "wide"
            if width < VERY_WIDE
            else "very wide"
        )
        shape = ""
        if found.asymmetry is not None:
            shape = ", asymmetric" if found.asymmetry >= ASYMMETRIC else ", symmetric"
        ends = found.repeated_width
        apart = ends is not None and round(ends[1] - ends[0], 1) >= NOTABLE
        repeats = f"; {ends[0]:.2g} to {ends[1]:.2g} % in repeats" if ends and apart else ""
        parts.append(f"{size} ({_percent(width)}{repeats}){shape} loop")
    elif found.branch_gap is not None:
        parts.append(
            f"no cycle is sampled finely enough for a loop width; on average the branches are "
            f"{_apart(found, found.branch_gap)} apart"
        )
    else:
        parts.append(
            "the input never reaches a level from both sides, so no loop is seen"
            if found.p_loop is None
            else f"there is a loop ({_level(found.p_loop)}), and no whole cycle tells how wide it is"
        )
    if found.saturation is not None:
        parts.append(f"saturates above {_value(found.saturation, found.input_unit)}")
    if found.onset is not None:
        parts.append(f"hardly moves below {_value(found.onset, found.input_unit)}")
    if found.creep is not None and found.creep_time is not None:
        parts.append(_crept(found, found.creep, found.creep_time))
    return _sentence("; ".join(parts))


def _undecided(found: Characterization) -> str:
    """Return that there may be a loop: what is seen of it, and what may be."""
    seen = ""
    if found.branch_gap is not None:
        seen = (
            f"the branches seem {_apart(found, found.branch_gap)} apart, which noise or drift "
            "would give as well"
        )
    most = ""
    if found.widest_gap is not None and found.widest_gap < found.output_span:
        most = f"on average they may be up to {_apart(found, found.widest_gap)} apart"
    told = ", and ".join(part for part in (seen, most) if part)
    return (
        f"whether there is a loop cannot be told ({_level(found.p_loop)})"
        f"{': ' if told else ''}{told}; record several cycles, whole and alike"
    )


def _apart(found: Characterization, gap: float) -> str:
    share = _percent(100 * abs(gap) / found.output_span)
    return f"{_value(abs(gap), found.output_unit)} ({share})"


def _crept(found: Characterization, creep: float, time: float) -> str:
    if 100 * abs(creep) < NOTABLE * found.output_span:
        return f"hardly creeps in {time:.2g} s"
    back = " back" if creep < 0 else ""
    return f"creeps{back} {_value(abs(creep), found.output_unit)} over {time:.2g} s"


def _motion(found: Characterization) -> str:
    ends = found.output_range[::-1] if found.falls else found.output_range
    text = f"{found.output} {'falls' if found.falls else 'goes'} {spanning(ends, found.output_unit)} as "
    text += f"{found.input} {'rises' if found.falls else 'goes'} "
    text += spanning(found.input_range, found.input_unit)
    if found.gain is not None:
        unit = f"{found.output_unit}/{found.input_unit}" if found.input_unit else found.output_unit
        text += f", {_value(found.gain, unit)} at mid input"
    if found.falls and found.output == "displacement":
        text += " (with its sign turned, it counts contraction)"
    zones = [zone for zone in (found.dead_zone_upper, found.dead_zone_lower) if zone is not None]
    if (
        found.has_loop
        and zones
        and max(zones) >= 0.01 * (found.input_range[1] - found.input_range[0])
    ):
        low, high = (_value(zone, found.input_unit) for zone in (min(zones), max(zones)))
        dead = high if low == high else f"{low} to {high}"
        text += f"; after a reversal the input changes by {dead} before the output moves back"
    return _sentence(text)


def _effects(found: Characterization) -> list[str]:
    """Return what every other input does."""
    said = []
    for one in found.effects:
        share = 100 * abs(one.change) / found.output_span
        moved = f"{'rises' if one.change > 0 else 'falls'} by {_apart(found, one.change)}"
        said.append(
            f"At equal {found.input}, {found.output} {'hardly moves' if share < NOTABLE else moved} "
            f"as {one.channel} goes {spanning((one.low, one.high), one.unit)}."
        )
    return said


def _levels(found: Characterization) -> str:
    """Return the loops at all levels of what is held, or at some of them from end to end."""
    n = len(found.levels)
    if n < 2:
        return ""
    told = [found.levels[k] for k in sorted({round(k) for k in np.linspace(0, n - 1, SPOKEN)})]
    held = resting([name for name, *_ in told[0].held])
    first = f"Where {held} at {told[0].at}, {found.output} has {_loop(told[0].found)}"
    others = [f"at {level.at}, {_loop(level.found)}" for level in told[1:]]
    left = f" ({n} levels in all)" if n > len(told) else ""
    return f"{'; '.join([first, *others])}{left}."


def _loop(found: Characterization) -> str:
    if not found.depends:
        return f"no dependence on {found.input}"
    if not found.has_loop:
        loop = "no loop" if found.has_loop is False else "no loop that can be told"
    else:
        loop = "a loop" if found.loop_width is None else f"a loop of {_percent(found.loop_width)}"
    if found.gain is None:
        return loop
    unit = f"{found.output_unit}/{found.input_unit}" if found.input_unit else found.output_unit
    return f"{loop} and a gain of {_value(found.gain, unit)}"


def _memory(found: Characterization) -> str:
    parts = []
    if found.closure_error is not None and found.has_loop:
        share = f"{_percent(found.closure_error)} of the output range"
        closed = found.closure_error < REMEMBERED
        parts.append(f"minor loops {'close within' if closed else 'miss their start by'} {share}")
    if found.wiping_out_error is not None and found.has_loop:
        share = _percent(found.wiping_out_error)
        wiped = found.wiping_out_error < REMEMBERED
        off = "as without them, within" if wiped else "off that without them by"
        parts.append(f"beyond them the output is {off} {share}")
    if found.drift is not None and 100 * abs(found.drift) >= NOTABLE * found.output_span:
        parts.append(
            f"from cycle to cycle the output drifts by {_value(found.drift, found.output_unit)}"
        )
    return _sentence("; ".join(parts)) if parts else ""


def _rate(found: Characterization) -> str:
    if not found.has_loop:
        return ""
    if found.rate_verdict == "unknown":
        return (
            "Whether the loop depends on speed cannot be told: that takes several cycles between the "
            "same extremes at different speeds."
        )
    if found.rate_verdict == "none" or found.rate_dependence is None:
        slow, fast = found.speeds or (0.0, 0.0)
        unit = f"{found.input_unit}/s".lstrip("/")
        return (
            f"Between mean speeds of {slow:.2g} and {fast:.2g} {unit}, which are all that cycles alike "
            "were recorded at, the width of the loop does not depend on speed."
        )
    way = "wider" if found.rate_dependence > 0 else "narrower"
    return (
        f"The loop depends on speed ({found.rate_verdict}): twice as fast, it is "
        f"{abs(found.rate_dependence):.2g} % of the output range {way}."
    )


def _trust(found: Characterization) -> str:
    said = []
    if found.n_cycles == 0 and not found.cycles:
        said.append(
            "There is no whole cycle of the input: record at least one, minimum to minimum, for loop "
            "width, area and shape."
        )
    elif found.n_cycles == 0:
        one = max(found.cycles, key=lambda cycle: cycle.amplitude)
        said.append(
            f"No cycle of the input is whole: width, area and shape of the loop are those "
            f"{spanning((one.low, one.high), found.input_unit)}, where both branches are."
        )
    if found.has_loop and found.branch_gap is not None and not found.drift_excluded:
        said.append(
            "The input went up and down once, and drift would part the branches as well: record "
            "several cycles to tell them apart."
        )
    return " ".join(said)


def resting(beside: Sequence[str]) -> str:
    """Return that other inputs rest, in words."""
    return f"{' and '.join(beside)} {'rests' if len(beside) == 1 else 'rest'}"


def spanning(limits: tuple[float, float], unit: str) -> str:
    """Return limits to about a percent of their distance, so that noise at 0 is not spelled out."""
    digits = 2 - math.floor(math.log10(abs(limits[1] - limits[0])))
    low, high = (f"{round(limit, digits) + 0.0:.6g}" for limit in limits)
    return f"from {low} to {high} {unit}".rstrip()


def _value(value: float, unit: str) -> str:
    text = f"{value:.2g}" if abs(value) < 100 else f"{value:.0f}"
    return f"{text} {unit}" if unit else text


def _percent(share: float) -> str:
    return "less than 0.1 %" if share < 0.1 else f"{share:.2g} %"


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}."
