"""Samples that stand alone, far off all others: a dropout, a sentinel such as -9999, a slip of the pen.

One of them sets the range of a channel, and with it whatever is told in shares of that range.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.files.notices import warn
from mckibben.files.table import Table

LONGEST = 3
"""Samples in a row that may be a glitch: what lasts longer was measured."""

MOST = 0.01
"""Share of the samples at either end of what is usual that may be glitches."""

OFF = 1.0
"""How far off the usual a glitch is, over what is usual."""

SENTINELS = frozenset({*(10.0**k - 1 for k in range(3, 8)), 2.0**15 - 1, 2.0**16 - 1})
"""Sizes that stand for no value in files."""

VACUUM, IMPLAUSIBLE = -1.1, 50.0
"""Pressures beyond which a glitch is none that could be [bar]."""

FEWEST = 100
"""Samples of which it can be said what is usual."""

REMEDY = "correct that cell, or leave its row out"


def check(channel: str, values: Array, unit: str, read: Array, table: Table, path: Path) -> None:
    """Tell of samples that stand alone off all others, and refuse those that no sensor gives.

    A pulse may be as short, so that others are told only.

    Parameters
    ----------
    channel : str
    values : numpy.ndarray, shape (n,)
        Those that are not finite are passed over.
    unit : str
    read : numpy.ndarray, shape (n,)
        The same as the file has them.
    table : Table
        What they are of.
    path : Path

    Raises
    ------
    DataError
        Naming the one that is furthest off.
    """
    finite = np.flatnonzero(np.isfinite(values))
    if finite.size < FEWEST:
        return
    known = values[finite]
    low, high = np.quantile(known, (MOST, 1 - MOST))
    usual = float(high - low)
    off = np.maximum(known - high, low - known)
    beyond = off > OFF * usual
    if usual == 0 or not beyond.any():
        return
    edges = np.flatnonzero(np.diff(np.concatenate([[False], beyond, [False]]).astype(np.int8)))
    begun, ended = edges[::2], edges[1::2]
    amid = (ended - begun <= LONGEST) & (begun > 0) & (ended < known.size)
    if not amid.any():
        return
    alone = np.concatenate(
        [np.arange(*ends) for ends in zip(begun[amid], ended[amid], strict=True)]
    )
    worst = int(alone[np.argmax(off[alone])])
    row = table.row(int(finite[worst]))
    problem = (
        f"it is {known[worst]:.6g} {unit}".rstrip()
        + f" there, and nearly everywhere else within {low:.4g} to {high:.4g}"
    )
    cannot_be = unit == "bar" and not VACUUM <= known[worst] <= IMPLAUSIBLE
    if cannot_be or abs(read[finite[worst]]) in SENTINELS:
        raise DataError(problem, file=path, channel=channel, row=row, remedy=REMEDY)
    more = f" ({alone.size} samples stand so far off)" if alone.size > 1 else ""
    warn(path, f"{channel}, row {row}: {problem}{more}; where that is no measurement, {REMEDY}")
