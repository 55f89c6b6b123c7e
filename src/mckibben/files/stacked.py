"""Tables in long format: a row for each number, with its time, the name of its signal, and its unit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from mckibben.files.headers import is_time, parse, snake_case
from mckibben.files.instants import seconds
from mckibben.files.request import Request, Source
from mckibben.files.table import WIDEST, Column, Table, distinct

VALUES = "value val reading wert messwert valeur valor valore 値 数值 值 값"
"""Headers of the column of all numbers; of other headers it is by `SIGNALS` that it is one."""

SIGNALS = "channel key measurement name sensor signal topic variable"
"""Headers of the column with the names of signals."""

UNITS = "unit units einheit unité unidad unità unidade 単位 单位 단위"
"""Headers of the column with their units."""


def unstacked(table: Table, path: Path) -> Table:
    """Return a table with a column for each signal, and their times, of one in long format."""
    names = {id(c): snake_case(parse(c.label).name) for c in table.columns}
    times = [c for c in table.columns if is_time(c.label)]
    units = [c for c in table.columns if names[id(c)] in UNITS.split() and c.values is None]
    signals = [c for c in table.columns if not any(c is column for column in (*times, *units))]
    words = [c for c in signals if c.values is None and _are_few(c.texts)]
    values = [c for c in signals if c.values is not None]
    values = [c for c in values if names[id(c)] in VALUES.split()] or values
    if not len(times) == len(words) == len(values) == 1 or len(units) > 1 or table.own:
        return table
    (clock,), (signal,), (value,) = times, words, values
    if names[id(value)] not in VALUES.split() and names[id(signal)] not in SIGNALS.split():
        return table
    if clock.values is None:
        clock = Column("time", seconds(clock.texts, Source(table, Request(), path))[0], "s")
    of = dict(zip(signal.texts, units[0].texts, strict=True)) if units else {}
    columns: list[Column] = []
    for name in dict.fromkeys(filter(None, signal.texts)):
        rows = np.flatnonzero([text == name for text in signal.texts])
        for column in (
            clock,
            replace(value, header=name, alias=None, place=None, unit=of.get(name)),
        ):
            columns.append(replace(column, values=np.asarray(column.values)[rows]))
    return distinct(replace(table, columns=tuple(columns), lines=None))


def _are_few(texts: Sequence[str]) -> bool:
    return 2 <= len({*texts}) <= min(WIDEST, len(texts) / 2)
