"""JSON tables: columns by name, or records with one value per column."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from io import BufferedReader
from pathlib import Path
from typing import Any

import numpy as np

from mckibben.errors import DataError
from mckibben.files import timebase, tree
from mckibben.files.table import Table, plain_meta
from mckibben.files.tree import Node, Unread


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Read ``{"pressure": [...]}``, the same in ``columns`` or ``data``, or ``[{"pressure": 1}]``.

    ``units`` may be beside, also in ``meta``. A ``.jsonl`` file has a record a line.
    """
    text = file.read()
    if path.suffix.casefold() == ".jsonl":
        text = b"[" + b",".join(filter(None, map(bytes.strip, text.splitlines()))) + b"]"
    found = _node(json.loads(text, object_pairs_hook=_distinct))
    if not isinstance(found, dict) or "format" in found:  # models and jobs have a format
        what = (
            f"of format {found['format']!r:.40}" if isinstance(found, dict) else "without columns"
        )
        problem = f"it is JSON {what}, not of columns of numbers"
        remedy = 'give JSON such as {"columns": {"time": [...], "pressure": [...]}}'
        raise DataError(problem, file=path, remedy=remedy)
    for wrapper in ("meta", "columns", "data"):
        if isinstance(inner := found.get(wrapper), dict):
            del found[wrapper]
            found = inner | found if wrapper == "meta" else found | inner
    meta = {name: one for name, one in plain_meta(found).items() if not timebase.is_rate(name)}
    table = tree.table(found, path, meta=meta)
    columns = {word for column in table.columns for word in (column.header, column.label)}
    units = found.get("units")
    for name in units if isinstance(units, dict) else ():
        if name not in columns | found.keys():
            problem, remedy = f"its units have {name!r:.40}, which is no column", "name a column"
            raise DataError(problem, file=path, remedy=remedy)
    return [table]


def _node(value: Any) -> Node:
    """Return a value as a plain tree."""
    if isinstance(value, dict):
        return {name: _node(each) for name, each in value.items()}
    if isinstance(value, str) or value is None:
        return value or ""
    if not isinstance(value, list):
        return np.array(value)
    filled = [each for each in value if each is not None]
    if filled and all(isinstance(each, dict) for each in filled):
        return _records([each or {} for each in value])
    texts = [each for each in filled if isinstance(each, str)]
    if 2 * len(texts) > len(value):
        return ["" if each is None else str(each) for each in value]
    if texts:
        return Unread(f"{texts[0]!r:.40} is not a number")
    try:
        return np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        return Unread("lists or objects within a list")


def _records(records: Sequence[Mapping[str, Any]]) -> Node:
    """Return the columns of records; records without the usual numbers are events."""
    ((usual, _),) = Counter(tuple(record) for record in records if record).most_common(1)
    first = next(record for record in records if tuple(record) == usual)
    numbers = {name for name in usual if not isinstance(first[name], str)} or set(usual)
    rows = [record for record in records if not record or numbers & record.keys()]
    names = dict.fromkeys(name for record in rows for name in record)
    columns = {name: _node([record.get(name) for record in rows]) for name in names}
    if len(rows) < len(records):
        others = f"{len(records) - len(rows)} without {', '.join(usual)}"
        columns["other records"] = Unread(others)
    return columns


def _distinct(pairs: Sequence[tuple[str, Any]]) -> Mapping[str, Any]:
    """Return an object, unless a name is repeated, as json would use the last."""
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError("a name is there twice")
    return found
