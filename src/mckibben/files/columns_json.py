"""JSON as a tree of columns by name, or of records with one value of each."""

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
    text: Any = file.read()
    if path.suffix.casefold() == ".jsonl":
        text = b"[" + b",".join(filter(None, map(bytes.strip, text.splitlines()))) + b"]"
    found = _node(json.loads(text, object_pairs_hook=_distinct))
    said = found.get("format") if isinstance(found, dict) else None  # models and jobs have one
    if said is not None or not isinstance(found, dict):
        what = "without columns" if said is None else f"of format {said!r:.40}"
        raise DataError(
            f"it is JSON {what}, not of columns of numbers",
            file=path,
            remedy='give JSON such as {"columns": {"time": [...], "pressure": [...]}}',
        )
    for wrapper in ("meta", "columns", "data"):
        if isinstance(inner := found.get(wrapper), dict):
            del found[wrapper]
            found = inner | found if wrapper == "meta" else found | inner
    meta = {name: one for name, one in plain_meta(found).items() if not timebase.is_rate(name)}
    table = tree.table(found, path, meta=meta)
    units = found.get("units")
    columns = {word for column in table.columns for word in (column.header, column.label)}
    for name in units if isinstance(units, dict) else {}:
        if name not in columns and name not in found:
            raise DataError(
                f"its units have {name!r:.40}, which is no column",
                file=path,
                remedy="give units by the names of columns",
            )
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
    """Return the columns of records; those with none of the numbers that most have are events."""
    ((usual, _),) = Counter(tuple(record) for record in records if record).most_common(1)
    first = next(record for record in records if tuple(record) == usual)
    numbers = {name for name in usual if not isinstance(first[name], str)} or set(usual)
    rows = [each for each in records if not each or numbers & each.keys()]
    names = dict.fromkeys(name for record in rows for name in record)
    columns = {name: _node([record.get(name) for record in rows]) for name in names}
    others = len(records) - len(rows)
    return columns | (
        {"other records": Unread(f"{others} without {', '.join(usual)}")} if others else {}
    )


def _distinct(pairs: Sequence[tuple[str, Any]]) -> Mapping[str, Any]:
    """Return an object, unless two of its names are one, of which json takes the last."""
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError("a name is there twice")
    return found
