"""Values that no muscle and no bench can have: the unit that they were read in is another."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.files.notices import warn
from mckibben.files.table import Table
from mckibben.files.units import SPELLINGS, convert

LARGEST: dict[str, float] = {
    "bar": 2e3,
    "mm": 1e6,
    "N": 1e7,
    "s": 1e11,
    "rad": 1e6,
    "V": 1e6,
    "mm/s": 1e8,
    "degC": 1e4,
    "": 1e4,
}
"""Package unit -> what no measurement reaches, wide of anything built; times since year 0 are fine."""

LEAST_TRAVEL = 0.1
"""A travel that is doubted below [mm]: muscles move by more, unless they are read in metres."""

SMALLEST_BAR, NO_BAR = 1e-7, 1e-12
"""A pressure between these is none: below a hundredth of a pascal, and above the rounding of zero."""

USUAL = {"bar": 5.0, "mm": 30.0, "N": 300.0, "s": 1.7e9, "rad": 1.0, "V": 5.0, "mm/s": 100.0}
"""Package unit -> what measurements often reach, by which the unit that was meant is guessed; times so
large count from 1970."""


def check(
    channel: str, values: Array, target: str | None, read_in: str, table: Table, path: Path
) -> None:
    """Refuse values of a standard channel or of time that cannot be.

    Parameters
    ----------
    channel : str
    values : numpy.ndarray, shape (n,)
        In the package's unit; those that are not finite are passed over.
    target : str or None
        The package's unit; None for channels that have none.
    read_in : str
        The unit that they were read in.

    Raises
    ------
    DataError
        Naming the largest, and the option for its unit.
    """
    if target not in LARGEST or not values.size:
        return
    largest = float(max(-values.min(), values.max()))
    if largest <= LARGEST[target] and (target != "bar" or largest >= SMALLEST_BAR):
        return  # as nearly always, without room for the sizes of all
    sizes = np.abs(np.where(np.isfinite(values), values, 0.0))
    at = int(np.argmax(sizes))
    largest = float(sizes[at])
    if largest > LARGEST[target]:
        problem = f"it reaches {values[at]:.6g} {target}"
    elif target == "bar" and NO_BAR < largest < SMALLEST_BAR:
        problem = f"it is {values[at]:.3g} bar at most"
    else:
        return
    raise DataError(
        f"read in {read_in or 'parts of one'!r}, {problem}, which cannot be",
        file=path,
        channel=channel,
        row=table.row(at),
        remedy=f"say its unit, as in --unit {channel}={meant(values[at], read_in, target)[0]}, or "
        "correct that cell",
    )


def doubt(channel: str, values: Array, path: Path) -> None:
    """Say of a travel [mm] that hardly is one that its unit may be another."""
    known = values[np.isfinite(values)]
    travel = float(np.ptp(known)) if known.size else 0.0
    if 0 < travel < LEAST_TRAVEL:
        warn(
            path,
            f"{channel} travels {travel:.3g} mm in all; where it is in m, use --unit {channel}=m",
        )


def meant(value: float, read_in: str, target: str) -> list[str]:
    """Return the units in which what was read is within ten times what is usual, or else nearest."""
    read = convert(np.array([abs(value)]), target, read_in)
    sizes = {unit: float(convert(read, unit, target)[0]) for unit in SPELLINGS[target]}
    usual = math.log(USUAL.get(target, 1.0))
    off = {unit: abs(math.log(max(size, 1e-300)) - usual) for unit, size in sizes.items()}
    nearest, *others = sorted(off, key=lambda unit: off[unit])
    return [nearest, *(unit for unit in others if off[unit] < math.log(10.0))]
