"""Tables in long format: a row for each number, with its time, the name of its signal, and its unit."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mckibben.files.headers import is_time, parse, snake_case
from mckibben.files.instants import seconds
from mckibben.files.request import Request, Source
from mckibben.files.table import WIDEST, Column, Table

VALUES = "value val reading wert messwert valeur valor valore 値 数值 值 값"
"""Headers of the column of all numbers."""

UNITS = "unit units einheit unité unidad unità unidade 単位 单位 단위"

Rows = NDArray[np.intp]


@dataclass(frozen=True)
class Stack:
    """The columns with times, names of signals, values and units of a table in long format."""

    time: int
    name: int
    value: int
    unit: int | None

    def signals(self, frame: Any) -> Iterator[tuple[str, str | None, Rows]]:
        """Yield the name, the unit and the rows of every signal."""
        by = [self.name, *([] if self.unit is None else [self.unit])]
        for key, rows in frame.groupby(by, sort=False, dropna=True).indices.items():
            name, *unit = key if isinstance(key, tuple) else (key,)
            yield str(name).strip(), str(unit[0]).strip() if unit else None, rows


def stack(headers: Sequence[str], frame: Any) -> Stack | None:
    """Return the columns of a table in long format, or None: one has values, and one some words."""
    names = [snake_case(parse(header).name) for header in headers]
    times = [i for i, header in enumerate(headers) if is_time(header)]
    values = [i for i, name in enumerate(names) if name in VALUES.split()]
    units = [i for i, name in enumerate(names) if name in UNITS.split()]
    if not len(times) == len(values) == 1:
        return None
    words = [
        i
        for i in range(len(headers))
        if i not in (*times, *values, *units)
        and frame[i].dtype.kind not in "iufb"
        and 2 <= frame[i].nunique() <= min(WIDEST, len(frame) / 2)
    ]
    alone = len(words) == 1 and len(units) <= 1
    return Stack(times[0], words[0], values[0], next(iter(units), None)) if alone else None


def unstacked(
    found: Stack,
    frame: Any,
    clock: Column,
    made: Callable[[int, str, str | None, Rows], Column],
    numbers: Sequence[int],
    path: Path,
) -> Table:
    """Return a table with a column for each signal, and their times: one column if all are alike."""
    if clock.values is None:
        whole = Table((clock,), np.array(numbers))
        since, _ = seconds(clock.texts, Source(whole, Request(), path))
        clock = Column("time", since, "s")
    times = clock.values
    assert times is not None
    clock = replace(clock, header="time", unit=clock.unit or parse(clock.header).unit)
    columns: list[Column] = []
    each = [*found.signals(frame)]
    first = times[each[0][2]]
    alike = all(np.array_equal(times[rows], first) for *_, rows in each)
    for name, unit, rows in each:
        if not (alike and columns):
            columns.append(replace(clock, values=times[rows]))
        columns.append(made(found.value, name, unit, rows))
    return Table(tuple(columns), np.array(numbers)[each[0][2]] if alike else None)
