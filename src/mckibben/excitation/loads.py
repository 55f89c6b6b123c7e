"""Loads and stiffness: whether what acts on a muscle from outside ever changes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mckibben.excitation.gap import Gap, between, listing, value
from mckibben.excitation.seen import Seen, moves

LOAD = "force"
STIFFNESS = "pressure_extensor"
LENGTH = "length"

GRAVITY = 9.81
"""[m/s²]."""

HELD = 0.01
"""Share of itself that a held length may move."""

TIED = 0.98
"""Share of a load's variance that follows the output in a straight line, from which it is a spring's."""

EFFECT = (
    "how the load acts (balance, mpi-narmax, activation models), and every error under another load"
)


def loads(seen: Seen) -> Iterator[Gap]:
    """Give a load or a stiffness that is unknown, never changes, or is tied to the output."""
    stiffens = STIFFNESS in seen.recordings[0] and STIFFNESS not in seen.inputs
    if stiffens and seen.moving and not moves(seen.recordings, STIFFNESS):
        yield _stiffness(seen)
    if LOAD in seen.outputs:
        yield from _held_length(seen)
        return
    if LOAD in seen.inputs:
        return
    told = sum(LOAD in recording for recording in seen.recordings)
    if told < len(seen.recordings):
        why = f"a load is recorded in {told} of {len(seen.recordings)} recordings"
        none = "no load is recorded, so that there is one at most"
        yield _one(seen, why if told else none, ())
    elif not moves(seen.recordings, LOAD):
        level = value(float(seen.pooled(LOAD).mean()), seen.unit(LOAD))
        yield _one(seen, f"all recordings are under {level}", seen.pooled(LOAD)[:1].tolist())
    else:
        tied = [name for name in seen.outputs if _follows(seen, name) > TIED]
        if tied:
            yield Gap(
                "load",
                f"Load and stiffness cannot be told apart: {LOAD} follows {listing(tied)} as a spring's "
                "would.",
                f"Record cycles under a dead load too, none and about "
                f"{value(float(np.abs(seen.pooled(LOAD)).max()), seen.unit(LOAD))}.",
                EFFECT,
                0.6,
                {"share": _follows(seen, tied[0])},
            )


def _one(seen: Seen, why: str, levels: Sequence[float]) -> Gap:
    masses = {float(kg) for r in seen.recordings if (kg := r.meta.get("payload_kg")) is not None}
    known = abs(levels[0]) if levels else GRAVITY * max(masses, default=0.0)
    if len(masses) > 1:
        why = f"{len(masses)} masses hung on it, but no channel says the load in N"
    elif not levels and known > 0:
        why = f"all recordings are under {value(max(masses), 'kg')}"
    others = [f"{float(f'{share * known:.1g}'):g}" for share in (0.5, 1.5)]
    under = (
        f"{listing(others)} N"
        if known > 1
        else "two dead loads, about a quarter and half of what the muscle lifts"
    )
    return Gap(
        "load",
        f"What a load does cannot be told: {why}.",
        f"Record the same cycles under {under}, with a channel {LOAD} in N.",
        EFFECT,
        0.25,
        {"loads": len(levels) or len(masses)},
    )


def _stiffness(seen: Seen) -> Gap:
    unit = seen.unit(STIFFNESS)
    at = float(seen.recordings[0][STIFFNESS].mean())
    low = min(seen.scales[name].low for name in seen.moving)
    high = max(seen.scales[name].high for name in seen.moving)
    others = [
        level for level in (low, 0.5 * (low + high), high) if abs(level - at) > 0.1 * (high - low)
    ]
    return Gap(
        "stiffness",
        f"What stiffness does to motion and coupling cannot be told: {STIFFNESS} rests at "
        f"{value(at, unit)} in every recording.",
        f"Record again with {STIFFNESS} at {listing([value(level, unit) for level in others])}.",
        "springs that stiffen (balance), networks scheduled by stiffness (sdchm, tsfnn)",
        0.6,
        {"level": at},
    )


def _held_length(seen: Seen) -> Iterator[Gap]:
    """Give forces at held lengths only, at held pressures only, or never with both moving."""
    driven = [name for name in seen.inputs if name != LENGTH]
    if LENGTH not in seen.recordings[0] or not driven:
        return
    lengths = [float(np.ptp(r[LENGTH])) for r in seen.recordings]
    span = float(np.ptp(seen.pooled(LENGTH)))
    travel = max(span, HELD * float(np.abs(seen.pooled(LENGTH)).max()))
    moving = [own > 0.1 * travel for own in lengths]
    pushed = [
        any(np.ptp(r[name]) > 0.1 * seen.scales[name].span for name in driven)
        for r in seen.recordings
    ]
    unit = seen.unit(LENGTH)
    levels = between(float(seen.pooled(LENGTH).min()), float(seen.pooled(LENGTH).max()), unit)
    mid = value(float(seen.pooled(LENGTH).mean()), unit)
    if not any(moving):
        yield Gap(
            "isometric",
            f"Friction of a muscle that moves cannot be told: {LENGTH} is held in every recording "
            f"({levels}).",
            f"Hold the pressure at two levels and cycle {LENGTH} about {mid}, slowly and five times as "
            "fast, with smaller turns inside.",
            "friction and damping by velocity (multistate, balance)",
            0.8,
            {"moving": 0},
        )
    elif not any(pushed):
        yield Gap(
            "isobaric",
            f"How force follows {listing(driven)} in time cannot be told: no recording moves it.",
            f"Hold {LENGTH} at three levels over {levels}, and cycle the pressure over its range.",
            "memory and lag of the pressure (balance, air)",
            0.5,
            {"moving": 0},
        )
    elif not any(a and b for a, b in zip(moving, pushed, strict=True)):
        yield Gap(
            "isometric or isobaric",
            f"What happens while {listing(driven)} and {LENGTH} both move cannot be told: in every "
            "recording one of them is held.",
            f"Move {listing(driven)} and {LENGTH} at random and at once, over {levels}.",
            "friction that pressure changes while it slips (multistate, balance)",
            0.4,
            {"moving": float(sum(moving))},
        )


def _follows(seen: Seen, name: str) -> float:
    """Return the share of the load's variance that follows an output, in a straight line."""
    load, output = seen.pooled(LOAD), seen.pooled(name)
    if np.ptp(output) == 0:
        return 0.0
    return float(np.corrcoef(load, output)[0, 1] ** 2)
