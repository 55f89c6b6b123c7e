"""Values that no muscle and no bench can have: the unit that they were read in is another."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.files.table import Table

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

SMALLEST_BAR, NO_BAR = 1e-7, 1e-12
"""A pressure between these is none: below a hundredth of a pascal, and above the rounding of zero."""

_EXAMPLES = {"bar": "MPa", "mm": "um", "N": "mN", "s": "ms", "rad": "deg", "V": "mV", "": "%"}


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
        remedy=f"say its unit, as in --unit {channel}={_EXAMPLES.get(target, 'UNIT')}, or correct "
        "that cell",
    )
