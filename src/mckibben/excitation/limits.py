"""Within what commands have to stay: their ends, how fast they may go, and where they rest."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.recording import Recording, standard_unit
from mckibben.rigs import Rig

CROSSING = 2.0
"""Time in which a channel crosses its range, where nobody says how fast it may go [s]."""

SEEN = 0.2
"""Time over which the speed of a recorded channel is looked at [s]."""

SHARE_AT_ZERO = 0.02
"""Share of its range by which a measured pressure may be below nothing."""


VACUUM, IMPLAUSIBLE = -1.1, 50.0
"""Pressures that no muscle is driven below, or above [bar]."""

BEYOND = 0.1
"""Share of its range by which a command may go beyond recordings, unsaid."""


@dataclass(frozen=True)
class Limit:
    """What one channel may do.

    Parameters
    ----------
    low, high : float
        Its ends, in its unit; equal where it is held.
    rate : float
        Fastest that it may go, in its unit per second, positive.
    rest : float
        Where it starts and ends.
    """

    low: float
    high: float
    rate: float
    rest: float

    @property
    def span(self) -> float:
        """How far it is from end to end."""
        return self.high - self.low


Limits = dict[str, Limit]


def limits_of_rig(rig: Rig) -> Limits:
    """Return what a rig's hardware lets through, at a speed that crosses its range in 2 s."""
    found = {}
    for name, rest in zip(rig.inputs, rig.resting[0].tolist(), strict=True):
        ends = rig.limits(name)
        rate = (ends.high - ends.low) / CROSSING
        if name == "length":
            rate = min(rate, float(getattr(rig, "drive_speed", rate)))
        found[name] = Limit(ends.low, ends.high, rate, rest)
    return found


def limits_of_recordings(recordings: Sequence[Recording], channels: Iterable[str]) -> Limits:
    """Return between what ends, and how fast, channels went in recordings that have time."""
    found = {}
    for name in channels:
        having = [recording for recording in recordings if name in recording]
        low = min(float(recording[name].min()) for recording in having)
        high = max(float(recording[name].max()) for recording in having)
        if name.startswith("pressure") and -SHARE_AT_ZERO * high < low < 0.0:
            low = 0.0
        rest = min(max(float(having[0][name][0]), low), high)
        fastest = max(_fastest(recording, name) for recording in having)
        found[name] = Limit(low, high, fastest or 1.0, rest)
    return found


def _fastest(recording: Recording, name: str) -> float:
    """Return how fast a channel went."""
    step = recording.sample_time or 1.0
    every = max(round(SEEN / step), 1)
    moved = np.abs(recording[name][every:] - recording[name][:-every])
    return float(moved.max(initial=0.0)) / (every * step)


def narrowed(limits: Limits, asked: Mapping[str, Sequence[float | None]]) -> Limits:
    """Return limits of which some are given: by channel low, high and perhaps rate.

    Raises
    ------
    DataError
        On channels that are not driven, ends out of order, or beyond what the hardware does.
    """
    found = dict(limits)
    for name, given in asked.items():
        if name not in limits:
            raise DataError(
                f"limits are given for {name!r}, which is not driven",
                remedy=f"give them for {', '.join(limits)}",
            )
        own, unit = limits[name], standard_unit(name) or ""
        low, high, rate = (*given, None, None, None)[:3]
        low, high = own.low if low is None else low, own.high if high is None else high
        rate = own.rate if rate is None else rate
        if not (math.isfinite(low) and math.isfinite(high) and low <= high):
            raise DataError(
                f"the limits {low:g} to {high:g} {unit} are not in order",
                channel=name,
                remedy=f"give the lower one first, for instance {name}={own.low:g}:{own.high:g}",
            )
        if unit == "bar" and not VACUUM <= low <= high <= IMPLAUSIBLE:
            raise DataError(
                f"the limits {low:g} to {high:g} bar are no muscle's",
                channel=name,
                remedy=f"give what your valve and muscle bear, for instance {name}=0:6",
            )
        if not 0 < rate < math.inf:
            raise DataError(
                f"nothing moves at {rate:g} {unit}/s",
                channel=name,
                remedy=f"give a positive rate, for instance {name}={low:g}:{high:g}:{own.rate:.3g}",
            )
        found[name] = Limit(low, high, rate, min(max(own.rest, low), high))
    return found


def beyond(limits: Limits, recorded: Limits) -> list[str]:
    """Return in words which limits go further than recordings do, so that errors there are guesses."""
    said = []
    for name, limit in limits.items():
        own = recorded[name]
        margin = BEYOND * own.span
        if limit.low < own.low - margin or limit.high > own.high + margin:
            unit = standard_unit(name) or ""
            said.append(
                f"{name} goes from {limit.low:g} to {limit.high:g} {unit}, in the recordings from "
                f"{own.low:.3g} to {own.high:.3g}: what is expected beyond is extrapolated"
            )
    return said


def within_hardware(limits: Limits, rig: Rig) -> None:
    """Refuse limits beyond what a rig lets through.

    Raises
    ------
    DataError
        Naming the channel and what there is.
    """
    for name, limit in limits.items():
        ends = rig.limits(name)
        if limit.low < ends.low or limit.high > ends.high:
            raise DataError(
                f"the limits {limit.low:g} to {limit.high:g} are beyond the {ends.low:g} to "
                f"{ends.high:g} {standard_unit(name)} of {rig.name}",
                channel=name,
                remedy="stay within these",
            )


def parsed(items: Iterable[str]) -> dict[str, list[float | None]]:
    """Return limits from texts CHANNEL=LOW:HIGH[:RATE], of which numbers may be left out.

    >>> parsed(["pressure=1:5.5", "force=::20"])
    {'pressure': [1.0, 5.5], 'force': [None, None, 20.0]}

    Raises
    ------
    DataError
        On a text of another form.
    """
    found = {}
    for item in items:
        name, equals, text = item.partition("=")
        parts = text.split(":")
        try:
            if not (name and equals and text and 2 <= len(parts) <= 3):
                raise ValueError
            found[name] = [float(part) if part else None for part in parts]
        except ValueError:
            raise DataError(
                f"--limits {item!r} is not of the form CHANNEL=LOW:HIGH or CHANNEL=LOW:HIGH:RATE",
                remedy="write for instance --limits pressure=1:5.5:2, which is bar and bar/s",
            ) from None
    return found


def at_rates(limits: Limits) -> tuple[Array, Array, Array, Array]:
    """Return low ends, high ends, rates and rests, each of shape (channels,)."""
    table = np.array([[one.low, one.high, one.rate, one.rest] for one in limits.values()])
    return table[:, 0], table[:, 1], table[:, 2], table[:, 3]


def followed(targets: Array, start: Array, limits: Limits, step: float) -> Array:
    """Return the commands that go for targets, shape (n, channels), from a start, within limits."""
    low, high, rate, _ = at_rates(limits)
    wanted, most = np.clip(targets, low, high), rate * step
    columns = []
    for column in range(wanted.shape[1]):
        here, far = float(start[column]), float(most[column])
        path = []
        for target in wanted[:, column].tolist():
            here += min(max(target - here, -far), far)
            path.append(here)
        columns.append(path)
    return np.array(columns).T


def slower(limits: Limits, share: float) -> Limits:
    """Return the same limits at a share of the rates."""
    return {name: replace(limit, rate=share * limit.rate) for name, limit in limits.items()}
