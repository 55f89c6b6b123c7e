"""Data quality: codes for missing samples, impossible values."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mckibben.arrays import Array, true_runs
from mckibben.files.headers import unit_of
from mckibben.files.notices import listed
from mckibben.files.request import Source
from mckibben.files.table import Column
from mckibben.files.units import SPELLINGS, convert
from mckibben.recording import PLAUSIBLE

TOO_SMALL = {"bar": (1e-12, 1e-7)}
"""By the package's unit: largest values that suggest another unit, and are more than rounding of 0.
"""

LONGEST_DROPOUT = 10
"""Samples of 0 on end, in the usual case, of a sensor that drops out; a muscle rests longer."""

_SIZES = (0.0, *(10.0**k - 1 for k in range(3, 8)), *(2.0**k - 1 for k in (15, 16)), 2.0**15)
CODES = np.array([sign * size for size in _SIZES for sign in (1.0, -1.0)])
"""Codes of instruments for a missing sample, even a single one."""


def without_codes(channel: str, values: Array, recorded: Array, source: Source) -> Array:
    """Return samples with codes for missing ones replaced by NaN, with a note.

    Codes are whole numbers as ``recorded`` in the file, not in the package's unit.
    """
    finite = recorded[np.isfinite(recorded)]
    integers, times = np.unique(finite[finite == np.rint(finite)], return_counts=True)
    recurring = integers[times >= 3]
    candidates = {*CODES, *recurring[:2], *recurring[-2:]}  # others are within the range of these
    coded = np.isin(recorded, [code for code in candidates if _is_code(code, finite)])
    huge = (np.abs(recorded) > 1e30) & np.isfinite(recorded)
    if not huge.all():  # SCPI's for not a number, and for beyond the range
        coded |= huge
    if not coded.any():
        return values
    codes = listed([f"{value:g}" for value in np.unique(recorded[coded])], most=5)
    source.warn(
        f"channel {channel!r}: {coded.sum()} sample(s) are {codes}, a code for missing ones "
        f"(first in row {source.table.row(int(np.argmax(coded)))}); "
        "use `raw` where that was measured"
    )
    return np.where(coded, np.nan, values)


def _is_code(code: float, finite: Array) -> bool:
    """Return whether a number is an isolated value far outside the range, as a dropout code."""
    at = finite == code
    # a muscle rests at 0 before and after it moves, and as often as not
    if not at.any() or at.all() or (code == 0 and (at[0] or at[-1] or at.mean() > 0.25)):
        return False
    if code == 0 and np.median(np.diff(true_runs(at))) > LONGEST_DROPOUT:
        return False
    rest = finite[~at]
    low, high = rest.min(), rest.max()
    steps = np.abs(np.diff(finite))
    inside = steps[~at[1:] & ~at[:-1]].max(initial=0.0)
    far = max(code - high, low - code) > high - low
    at_once = not low < code < high and steps[at[1:] != at[:-1]].min() > 5 * inside
    # one of few values is a level of the signal
    return bool(far or at_once) and np.unique(rest).size >= 10


def question_size(
    channel: str, column: Column, values: Array, read_in: str, source: Source, *, assumed: bool
) -> None:
    """Raise an error for values of a size that no rig has in the unit that the file states.

    Sizes that are rare are questioned too where the unit is ``assumed``. What a user states never is.
    """
    target = unit_of(channel)
    finite = values[np.isfinite(values)]
    if target not in PLAUSIBLE or not finite.size:
        return
    low, high, _, least, most = PLAUSIBLE[target]
    zero, small = (0.0, least) if assumed else TOO_SMALL.get(target, (0.0, 0.0))
    sizes, excess = np.abs(finite), np.maximum(finite - high, low - finite)
    rare = zero < sizes.max() < small or (assumed and sizes.max() > most)
    if excess.max() <= 0 and not rare:
        return
    suspect = finite[np.argmax(excess if excess.max() > 0 else sizes)]
    stated = read_in or "1"
    fitting = fitting_units(suspect, read_in, target)
    units = [*dict.fromkeys([*fitting, stated] if assumed else [stated, *fitting])]
    options: list[dict[str, Any]] = [{"units": {channel: unit}} for unit in units]
    if target == "" and assumed:
        options.insert(len(fitting), in_mm(channel, column, source))
    size = f"it reaches {suspect:.6g} {target}".rstrip()
    problem = f"{size}{', without a unit' if assumed else ''}"
    choices = fitting if assumed else units
    problem += f": is it in {' or '.join(choices)}?" if fitting else ", which is not usual"
    at = int(np.argmax(values == suspect))
    remedy = f"name another unit with `units[{channel}]=UNIT`, or correct that cell"
    raise source.error(problem, remedy, channel, at, options)


def in_mm(channel: str, column: Column, source: Source) -> dict[str, dict[str, str | None]]:
    """Return the options that read what is called a contraction as a displacement [mm]."""
    of = channel.replace("contraction", "displacement")
    without = {channel: None} if channel in source.request.units else {}
    return {"columns": {of: column.header}, "units": {of: "mm", **without}}


def fitting_units(value: float, read_in: str, target: str) -> list[str]:
    """Return the units in which a value is plausible, nearest to a usual size first."""
    read = convert(np.array([abs(value)]), target, read_in)
    sizes = {unit: float(convert(read, unit, target)[0]) for unit in SPELLINGS[target]}
    typical = math.log(PLAUSIBLE[target].typical)
    off = {unit: abs(math.log(max(size, 1e-300)) - typical) for unit, size in sizes.items()}
    low, high, *_ = PLAUSIBLE[target]
    possible = [unit for unit in off if low <= math.copysign(sizes[unit], value) <= high]
    nearest = sorted(possible, key=lambda unit: off[unit])
    return nearest[:1] + [unit for unit in nearest[1:] if off[unit] < math.log(10.0)]
