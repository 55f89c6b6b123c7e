"""JSON: records, or columns by name, in groups; one value in a file, or one in a line.

Records that each have some of the fields are one table with missing samples. The layouts of
`pandas.DataFrame.to_json` are understood, and messages of a name and a value each.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from io import BufferedReader
from pathlib import Path
from typing import Any

import numpy as np

from mckibben.errors import DataError
from mckibben.files import cells, tree
from mckibben.files.decoding import decoded
from mckibben.files.instants import may_be_instant
from mckibben.files.table import Table, plain_meta
from mckibben.files.tree import Node, Unread

_NUMBER = re.compile(r"-?\d+(\.\d+)?([eE][+-]?\d+)?")
_SINCE_1970 = 1e11
"""Labels of rows from here on are no times since a start, but instants."""


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Read the vectors of a JSON file, or of one with a value in each line."""
    content = _content(decoded(file.read(), path).decode(), path)
    about = content if isinstance(content, dict) else {}
    if str(about.get("format")).startswith("mckibben-"):
        kind = about["format"].removeprefix("mckibben-")
        problem = f"it is no recording: this package saved a {kind} in it"
        raise DataError(
            problem, file=path, remedy="give a recording; models are read with mckibben.load"
        )
    node = _node(content)
    found = node if isinstance(node, Mapping) else {"data": node}
    return tree.runs(found, path, meta=plain_meta(about))


def _content(text: str, path: Path) -> Any:
    """Return the value in a text, or the list of those in its lines.

    Objects before the others without a field of these are about the whole, and are a group with them.
    """
    try:
        return _parsed(text)
    except json.JSONDecodeError as error:
        if error.msg != "Extra data":
            raise _damaged(error, path, error.lineno) from None
    values: list[Any] = []
    for row, line in enumerate(text.split("\n"), start=1):
        try:
            values += [_parsed(line)] if line.strip() else []
        except json.JSONDecodeError as error:
            raise _damaged(error, path, row) from None
    head: dict[str, Any] = {}
    if all(isinstance(value, dict) for value in values):
        while len(values) > 2 and not values[0].keys() & (values[1].keys() | values[2].keys()):
            head |= values.pop(0)
    return {**head, "records": values} if head else values


def _damaged(error: json.JSONDecodeError, path: Path, row: int) -> DataError:
    problem = f"it is no JSON there: {error.msg}, at character {error.colno}"
    remedy = "correct that line, or delete it where each line is a record"
    return DataError(problem, file=path, row=row, remedy=remedy)


def _parsed(text: str) -> Any:
    return json.loads(text, object_pairs_hook=_unique)


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    unique = dict(pairs)
    if len(unique) < len(pairs):
        raise ValueError("two fields of an object have one name")
    return unique


def _node(value: Any) -> Node:
    """Return a value as a plain tree."""
    if isinstance(value, list):
        return _series(value)
    if not isinstance(value, dict):
        return np.array(value, np.float64) if isinstance(value, int | float) else value or ""
    rows = value.get("data")
    if isinstance(names := value.get("columns"), list) and isinstance(rows, list):
        fields = {
            key: each for key, each in value.items() if key not in ("columns", "data", "index")
        }
        return {**_node_of(fields), **_index(value.get("index", [])), **_named(names, rows)}
    parts = [*value.values()]
    if parts and all(isinstance(each, dict) and _is_flat(each) for each in parts):
        if _are_labels([*value]):
            return {**_index([*value]), **_records(parts)}
        labels = [*parts[0]]
        if _are_labels(labels) and all([*each] == labels for each in parts):
            vectors = {name: _cells([*each.values()]) for name, each in value.items()}
            return {**_index(labels), **vectors}
    return _node_of(value)


def _is_flat(group: Mapping[str, Any]) -> bool:
    return not any(isinstance(each, dict | list) for each in group.values())


def _node_of(group: Mapping[str, Any]) -> dict[str, Node]:
    return {name: _node(each) for name, each in group.items()}


def _series(values: Sequence[Any]) -> Node:
    """Return the vector, the columns or the matrix of a list."""
    kinds = {type(value) for value in values} - {type(None)}
    if kinds == {dict}:
        return _records([value or {} for value in values])
    if kinds == {list} and None not in values:
        first, *rest = values
        if rest and first and all(isinstance(cell, str) for cell in first):
            return _named(first, rest)
        try:
            return np.array(values, np.float64)
        except (TypeError, ValueError):  # of several lengths, or of more than numbers
            return [_series(value) for value in values]
    return Unread("a list of unlike things") if kinds & {dict, list} else _cells(values)


def _records(records: Sequence[Mapping[str, Any]]) -> dict[str, Node]:
    """Return the columns of records."""
    names = dict.fromkeys(name for record in records for name in record)
    return {name: _series([record.get(name) for record in records]) for name in names}


def _named(names: Sequence[Any], rows: Sequence[Any]) -> dict[str, Node]:
    """Return the columns of rows by their names."""
    columns = zip(*rows, strict=True)
    return {str(name): _series(each) for name, each in zip(names, columns, strict=True)}


def _are_labels(names: Sequence[str]) -> bool:
    """Return whether names are labels of rows: numbers, or instants."""
    forms = (_NUMBER.fullmatch, may_be_instant)
    return bool(names) and any(all(map(form, names)) for form in forms)


def _index(labels: Sequence[Any]) -> dict[str, Node]:
    """Return the column of the labels of rows, unless they count these."""
    texts = [str(label) for label in labels]
    if texts == [str(row) for row in range(len(texts))]:
        return {}
    if not all(map(_NUMBER.fullmatch, texts)):
        return {"time" if may_be_instant(texts[0]) else "index": texts}
    numbers = np.array(texts, np.float64)
    return {"time" if numbers.min() > _SINCE_1970 else "index": numbers}


def _cells(values: Sequence[Any]) -> Node:
    """Return the numbers in a list, also where some are texts; or the texts."""
    if not any(isinstance(value, str) for value in values):
        return np.array([math.nan if value is None else value for value in values], np.float64)
    words = ["" if value is None else str(value) for value in values]
    found, doubtful = cells.column("", None, np.array(words, object), cells.Dialect(",", "."))
    if found.values is None:
        return words
    if doubtful:
        return Unread(f"sample 1: {doubtful!r} may mean several numbers")
    if found.flaw is not None and not found.flaw.bridgeable:
        return Unread(f"sample {found.flaw.sample + 1}: {found.flaw.problem}")
    return found.values if found.unit is None else {"data": found.values, "unit": found.unit}
