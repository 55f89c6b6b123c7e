"""What fields of a balance of forces are called, and have to be: of one size, and as physics asks."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from mckibben.blocks.fields import Channel
from mckibben.errors import ModelError, ModelWarning

if TYPE_CHECKING:
    from mckibben.blocks.coupled.balance import Balance


def check_fields(balance: Balance) -> None:
    """Refuse a balance whose fields do not fit one another, or that would make energy.

    Raises
    ------
    ModelError
        Naming the field.
    """
    n = len(balance.driven)
    n_loads = len(balance.loads[0]) if balance.loads else 0
    if n_loads > len(balance.scheduled):
        raise ModelError(
            f"{balance.kind!r} has {n_loads} loads, and {len(balance.scheduled)} channels that schedule "
            "or load it. Remedy: give every load a channel, behind what schedules."
        )
    reach = balance.pressure_range
    if reach is not None and not reach[0] < reach[1]:
        raise ModelError(
            f"pressure_range of {balance.kind!r} is {reach}. Remedy: the lower end first."
        )
    n_powers = 1 + (len(balance.scheduled) - n_loads) * balance.degree
    widths = {
        "springs": n_powers * (1 + n),
        "elasticity": len(balance.elasticity[0]) if balance.elasticity else 0,
        "areas": max(len(balance.areas[0]) if balance.areas else 0, 1),
        "friction": len(balance.limits),
        "relaxation": len(balance.lags),
        "loads": n_loads,
        "hull": 2,
    }
    for name, width in widths.items():
        table = getattr(balance, name)
        if len(table) != n or any(len(row) != width for row in table):
            raise ModelError(
                f"{name} of {balance.kind!r} has rows of {[len(row) for row in table]}. "
                f"Remedy: give {n} rows of {width}."
            )
    lengths = {"damping": balance.damping, "walls": balance.walls, "given": balance.given}
    if balance.bladders or balance.pushes:
        lengths |= {"bladders": balance.bladders, "pushes": balance.pushes}
    if balance.lines:
        lengths["lines"] = balance.lines
    lengths |= {"mass": balance.mass} if balance.mass else {}
    for name, values in lengths.items():
        if len(values) != n:
            told = f"{name} of {balance.kind!r} has {len(values)} entries"
            raise ModelError(f"{told}. Remedy: give {n}.")
    at_rest = [row[0] for row in balance.areas]
    above = {"limits": balance.limits, "lags": balance.lags, "areas at rest": at_rest}
    for name, positive in above.items():
        rises = name == "areas at rest" or all(a < b for a, b in pairwise(positive))
        if any(not value > 0 for value in positive) or (name == "limits" and not rises):
            raise ModelError(
                f"{name} of {balance.kind!r} are {positive}. Remedy: give positive ones"
                f"{', in increasing order' if name == 'limits' else ''}."
            )
    stiff = ("friction", "relaxation", "damping", "walls")
    for name in (*stiff, "lines", "grip", "bladders", "pushes", "mass"):
        if np.any(np.array(getattr(balance, name)) < 0):
            raise ModelError(
                f"{name} of {balance.kind!r} has a number below 0, which would make energy. "
                "Remedy: give none below 0."
            )
    if balance.mass and balance.pushes:
        raise ModelError(
            f"{balance.kind!r} has mass and muscles that go slack. Remedy: give one of mass and pushes."
        )
    if balance.known and [len(row) for row in balance.known] != [2] * len(balance.scheduled):
        raise ModelError(
            f"known of {balance.kind!r} is {balance.known}. Remedy: give a pair for every channel that "
            "schedules or loads it, or none."
        )
    if any(not low < high for low, high in balance.hull):
        raise ModelError(f"hull of {balance.kind!r} is {balance.hull}. Remedy: lower ends first.")


ONE_EACH = {
    "damping": "damping",
    "lines": "resistance of the line",
    "walls": "stretch of the wall",
    "bladders": "spring of the bladder",
    "pushes": "force of slackening",
    "mass": "mass",
}
"""Fields that have one number for every muscle, in words."""


def number_name(balance: Balance, field: str, index: tuple[int, ...]) -> str:
    """Return what a number of a field is called, for people."""
    if field == "grip":
        return field
    n = len(balance.driven)
    of = f" of muscle {index[0] + 1}" if n > 1 else ""
    if field in ONE_EACH:
        return f"{ONE_EACH[field]}{of}"
    place = index[1]
    if field == "springs":
        power, to = divmod(place, 1 + n)
        own = "constant force" if to == 0 else "spring"
        other = f" to muscle {to}" if to not in (0, index[0] + 1) else ""
        if power == 0:
            return f"{own}{of}{other}"
        by, degree = divmod(power - 1, balance.degree)
        raised = f"^{degree + 1}" if degree else ""
        return f"{own}{of}{other} by {balance.scheduled[by].name}{raised}"
    if field == "loads":
        return f"share{of} of {balance.scheduled[place - len(balance.loads[0])].name}"
    if field == "friction":
        return f"stop {place + 1}{of}"
    if field == "relaxation":
        return f"relaxation {place + 1}{of}"
    if field == "areas" and place == 0:
        return f"area{of} at rest"
    raised = f"^{place + 2 * (field == 'elasticity')}"
    return f"{'area' if field == 'areas' else field}{of} by displacement{raised.replace('^1', '')}"


def tell_clipped(
    n_samples: float,
    given: Sequence[Channel],
    reach: tuple[float, float] | None,
    pushing: str = "",
) -> None:
    """Warn of samples that a balance's range of pressures did not reach, if there are any."""
    if not n_samples > 0:
        return
    low, high = reach or (-math.inf, math.inf)
    # what a sensor is off at rest is no end
    low = 0.0 if abs(low) < 1e-3 * (high - low) else low
    names = " or ".join(channel.name for channel in given)
    warnings.warn(
        f"{int(n_samples)} samples need {names} beyond {low:.4g} to {high:.4g} {given[0].unit} "
        f"(behind a dead zone, if there is one){pushing} and were clipped there by the compensator",
        ModelWarning,
        stacklevel=5,
    )
