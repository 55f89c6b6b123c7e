"""JSON of columns by name, or of records with one value of each."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from io import BufferedReader
from pathlib import Path
from typing import Any

import numpy as np

from mckibben.errors import DataError
from mckibben.files import timebase
from mckibben.files.table import MOST_TEXT, Column, Flaw, Table


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Read ``{"pressure": [...]}``, ``{"columns": {...}, "units": {...}}`` or ``[{"pressure": 1}]``."""
    content = json.loads(file.read(), object_pairs_hook=_distinct)
    if isinstance(content, list) and content and all(isinstance(one, dict) for one in content):
        names = dict.fromkeys(name for record in content for name in record)
        content = {name: [record.get(name) for record in content] for name in names}
    said = content.get("format") if isinstance(content, dict) else None  # models and jobs have one
    if isinstance(content, dict) and isinstance(content.get("meta"), dict):
        content = content["meta"] | content
    found = content
    for name in ("columns", "data"):
        found = content.get(name, found) if isinstance(content, dict) else None
    if said is not None or not isinstance(found, dict):
        what = "without columns" if said is None else f"of format {said!r:.40}"
        raise DataError(
            f"it is JSON {what}, not of columns of numbers",
            file=path,
            remedy='give JSON such as {"columns": {"time": [...], "pressure": [...]}}',
        )
    given = content.get("units")
    units = given if isinstance(given, dict) else {}
    columns: dict[str, Column] = {}
    unread: dict[str, str] = {}
    for name, cells in found.items():
        if not isinstance(cells, list):
            continue
        if any(isinstance(cell, (list, dict)) for cell in cells):
            unread[name] = "lists or objects within a list"
        else:
            columns[name] = _column(name, cells, units.get(name))
    strange = [name for name in units if name not in found or not isinstance(units[name], str)]
    if strange:
        raise DataError(
            f"its units have {strange[0]!r:.40}, which is no column, or no text",
            file=path,
            remedy="give units by the names of columns",
        )
    single = {**content, **found}.items()
    told = {name: float(one) for name, one in single if _is_number(one) and timebase.is_rate(name)}
    meta = {
        name: one
        for name, one in single
        if name not in told
        and (_is_number(one) or (isinstance(one, str) and len(one) <= MOST_TEXT))
    }
    return [Table(tuple(columns.values()), meta=meta, rates=told, unread=unread)]


def _column(name: str, cells: Sequence[Any], unit: str | None) -> Column:
    texts = [k for k, cell in enumerate(cells) if isinstance(cell, str)]
    if 2 * len(texts) > len(cells):
        return Column(name, None, unit, ["" if cell is None else str(cell) for cell in cells])
    flaw = None
    if texts:
        problem = f"{cells[texts[0]][:40]!r} is not a number"
        flaw = Flaw(texts[0], problem, "correct it, or write null and say --gaps split")
    numbers = [None if isinstance(cell, str) else cell for cell in cells]
    return Column(name, np.array(numbers, dtype=np.float64), unit, flaw=flaw)


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and np.isfinite(value)


def _distinct(pairs: Sequence[tuple[str, Any]]) -> Mapping[str, Any]:
    """Return an object, unless two of its names are one, of which json takes the last."""
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError("a name is there twice")
    return found
