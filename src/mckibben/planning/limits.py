"""Limits of commands: their range, rate and rest value."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from mckibben.diagnosis.excitation import Excitation
from mckibben.errors import DataError
from mckibben.recording import standard_unit
from mckibben.rigs import Rig

CROSSING = 2.0
"""Time in which a channel crosses its range, where no rate is known [s]."""

SHARE_OF_WAYS = 0.25
"""Most of the time of a plan that crossing a range once may take."""

BELOW_ZERO = 0.02
"""Share of its range by which the noise of a pressure goes below zero."""

BEYOND = 0.1
"""Share of their range by which a command may go beyond recordings."""

LOWEST, HIGHEST = -1.1, 50.0
"""Pressures beyond which no muscle is driven [bar]."""


@dataclass(frozen=True)
class Limit:
    """Range of a command in its unit (equal ends if constant), rate per second, rest value."""

    low: float
    high: float
    rate: float
    rest: float

    @property
    def span(self) -> float:
        """Width of the range."""
        return self.high - self.low

    def beyond(self, recorded: Limit | None) -> bool:
        """Return whether it exceeds the recorded range by more than a tenth."""
        if recorded is None:
            return False
        further = max(recorded.low - self.low, self.high - recorded.high)
        return further > BEYOND * recorded.span

    @property
    def crossing(self) -> float:
        """Time from end to end [s]."""
        return self.span / self.rate


Limits = dict[str, Limit]


def limits_of_rig(rig: Rig) -> Limits:
    """Return a rig's hardware limits, at a rate that crosses its range in 2 s."""
    limits = {}
    for name, rest in zip(rig.inputs, rig.resting[0].tolist(), strict=True):
        ends = rig.limits(name)
        rate = (ends.high - ends.low) / CROSSING
        if name == "length":
            rate = min(rate, float(getattr(rig, "drive_speed", rate)))
        limits[name] = Limit(ends.low, ends.high, rate, rest)
    return limits


def limits_of_recordings(excitation: Excitation) -> Limits:
    """Return the recorded ranges and rates of inputs and loads; those constant in each run stay so."""
    limits = {}
    for name in excitation.driven:
        low, high = excitation.ranges[name]
        if name.startswith("pressure") and -BELOW_ZERO * high < low < 0.0:
            low = 0.0
        rest = min(max(float(excitation.recordings[0][name][0]), low), high)
        if excitation.branches.get(name):
            rate = max(excitation.speed(name, branch) for branch in excitation.branches[name])
            limits[name] = Limit(low, high, rate, rest)
        else:
            limits[name] = Limit(rest, rest, 1.0, rest)
    return limits


def limits_as_wanted(limits: Limits, wanted_limits: Mapping[str, Iterable[float | None]]) -> Limits:
    """Return limits with some replaced: by channel low, high and optionally rate."""
    result = dict(limits)
    for name, ends in wanted_limits.items():
        if name not in limits:
            raise DataError(
                "limits are given for it, and it is not driven",
                channel=name,
                remedy=f"give them for {', '.join(limits)}",
            )
        limit, unit = limits[name], standard_unit(name) or ""
        low, high, rate = (*ends, None, None, None)[:3]
        low = limit.low if low is None else low
        high = limit.high if high is None else high
        if not (math.isfinite(low) and math.isfinite(high) and low <= high):
            raise DataError(
                f"the limits {low:g} to {high:g} {unit} are not in order",
                channel=name,
                remedy=f"give the lower one first, for instance {name}={limit.low:g}:{limit.high:g}",
            )
        if unit == "bar" and not LOWEST <= low <= high <= HIGHEST:
            raise DataError(
                f"the limits {low:g} to {high:g} bar are no muscle's",
                channel=name,
                remedy=f"give what your valve and muscle bear, for instance {name}=0:6",
            )
        if rate is None:
            rate = limit.rate if limit.span > 0 or high == low else (high - low) / CROSSING
        if not 0 < rate < math.inf:
            raise DataError(
                f"there is no motion at {rate:g} {unit}/s",
                channel=name,
                remedy=f"give a positive rate, for instance {name}={low:g}:{high:g}:{limit.rate:.3g}",
            )
        result[name] = Limit(low, high, rate, min(max(limit.rest, low), high))
    return result


def check_possible(limits: Limits, seconds: float, rig: Rig | None) -> None:
    """Raise an error for limits that allow no motion, take too long, or exceed a rig's."""
    for name, limit in limits.items():
        unit = standard_unit(name) or ""
        ends = rig.limits(name) if rig is not None and name in rig.inputs else limit
        if limit.low < ends.low or limit.high > ends.high:
            raise DataError(
                f"the limits {limit.low:g} to {limit.high:g} {unit} are beyond the {ends.low:g} to "
                f"{ends.high:g} {unit} of the rig",
                channel=name,
                remedy="stay within these",
            )
        if limit.crossing > SHARE_OF_WAYS * seconds:
            needed = math.ceil(limit.crossing / SHARE_OF_WAYS / 6) / 10
            raise DataError(
                f"at {limit.rate:.3g} {unit}/s, it takes {limit.crossing:.3g} s of {seconds:g} s from "
                "end to end",
                channel=name,
                remedy=f"give `minutes={needed:g}` or more, a higher rate, or limits closer together",
            )
    if not any(limit.span > 0 for limit in limits.values()):
        raise DataError(
            f"none of {', '.join(limits)} may move",
            parameter="limits",
            remedy="give wider limits with `limits`",
        )
