"""Data frames that pandas saved in HDF5, as the groups of a tree.

The format "fixed" has blocks of columns of one type with their names beside them; the format "table"
one table with a field per block, and the names in pickles. A pickle is a program, and none is run: the
opcodes of one are listed, and where they are those of a list of texts, these are the names.
"""

from __future__ import annotations

import pickletools
import re
from collections.abc import Iterable, Iterator, Mapping
from itertools import dropwhile
from typing import Any

import numpy as np

from mckibben.files.tree import Node, Unread

_TEXT = re.compile("(SHORT_)?BIN(UNICODE8?|STRING)|UNICODE|STRING|INT|BININT[12]?")
"""Opcodes of texts, and of the numbers by which columns without names go."""

_LIST = re.compile("PROTO|FRAME|MARK|(EMPTY_)?LIST|APPENDS?|(LONG_)?(BIN)?PUT|MEMOIZE|STOP")
"""Opcodes of a list, and of remembering what is in it."""

_INSTANTS = re.compile(r"((?:datetime|timedelta)64)(?:\[(s|ms|us|ns)\b)?")
_PICKLED = Unread("pandas pickled it; save the frame with `to_csv` or `to_parquet`")


def columns(group_tree: Mapping[str, Node], group: Any) -> dict[str, Node]:
    """Return the columns of a frame or a series by their names, its index first where that is data.

    Parameters
    ----------
    found : mapping
        What is in the group, as `mckibben.files.hdf5` reads it.
    group : h5py.Group
        With pandas' attributes.
    """
    parts = _of_table if isinstance(group_tree.get("table"), Mapping) else _of_blocks
    made: dict[str, Node] = {}
    for name, node in parts(group_tree, group):
        if name in made:
            raise ValueError(f"two columns are named {name!r}")
        made[name] = node
    order = group_tree.get("axis0")
    if isinstance(order, list):
        return {name: made[name] for name in (*(made.keys() - {*order}), *order) if name in made}
    return made


def _of_blocks(group_tree: Mapping[str, Node], group: Any) -> Iterator[tuple[str, Node]]:
    """Yield the columns of the format "fixed"."""
    index = "index" if "index" in group else "axis1"
    about = group[index].attrs if index in group else {}
    yield from _index(group_tree.get(index, _PICKLED), about.get("name"), about.get("kind"))
    if "values" in group:  # a series
        yield _text(group.attrs.get("name")) or "values", group_tree["values"]
    for block in (name.removesuffix("_values") for name in group if name.endswith("_values")):
        items, about = group_tree.get(f"{block}_items"), group[f"{block}_values"].attrs
        if isinstance(items, np.ndarray):
            items = [str(item) for item in items]
        values = group_tree.get(f"{block}_values", _PICKLED)
        if isinstance(values, np.ndarray) and not about.get("transposed"):
            values = values.T
        names = items if isinstance(items, list) else None
        yield from _split(f"{block}_values", names, values, about.get("value_type"))


def _of_table(group_tree: Mapping[str, Node], group: Any) -> Iterator[tuple[str, Node]]:
    """Yield the columns of the format "table"."""
    fields, about = group_tree["table"], group["table"].attrs
    assert isinstance(fields, Mapping)
    for field, values in fields.items():
        if field == "index":
            opcodes = _opcodes(group.attrs.get("info"))
            after = dropwhile(lambda opcode: opcode[1] != "index_name", opcodes)
            index_name = [opcode for opcode in after if not _LIST.fullmatch(opcode[0])][1:2]
            name = next((text for code, text in index_name if _TEXT.fullmatch(code)), None)
            yield from _index(values, name, about.get("index_kind"))
        else:
            names = _texts(about.get(f"{field}_kind"))
            yield from _split(field, names, values, about.get(f"{field}_dtype"))


def _index(values: Node, name: Any, kind: Any) -> Iterator[tuple[str, Node]]:
    """Yield the index, unless it counts the rows."""
    values, name = _typed(values, kind), _text(name)
    counts = isinstance(values, np.ndarray) and np.array_equal(values, np.arange(values.size))
    if name is not None or not counts:
        yield name or ("time" if "time" in str(_text(kind)) else "index"), values


def _split(
    path: str, names: list[str] | None, values: Node, kind: Any
) -> Iterator[tuple[str, Node]]:
    """Yield the columns of a block by their names."""
    if names is None:
        yield path, _PICKLED
    elif isinstance(values, np.ndarray):
        rows = _typed(values.reshape(len(values), -1), kind)
        yield from zip(names, rows.T, strict=True)
    elif isinstance(values, list):  # texts, row by row
        yield from ((name, values[at :: len(names)]) for at, name in enumerate(names))
    else:
        yield from dict.fromkeys(names, _PICKLED).items()


def _typed(values: Any, kind: Any) -> Any:
    """Return whole numbers as the instants or durations that they are."""
    match = _INSTANTS.match(_text(kind) or "")
    if match is None or not isinstance(values, np.ndarray) or values.dtype.kind != "i":
        return values
    return values.astype("i8").view(f"{match[1]}[{match[2] or 'ns'}]")


def _text(value: Any) -> str | None:
    """Return an attribute's text, or None for the pickle of None."""
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    return value if isinstance(value, str) and value != "N." else None


def _texts(pickled: Any) -> list[str] | None:
    """Return the texts of a pickled list of these, or None."""
    opcodes = list(_opcodes(pickled))
    texts = [(code, text) for code, text in opcodes if not _LIST.fullmatch(code)]
    is_text = opcodes and all(_TEXT.fullmatch(code) for code, _ in texts)
    return [text for _, text in texts] if is_text else None


def _opcodes(pickled: Any) -> Iterable[tuple[str, str]]:
    """Return the opcodes of a pickle, each with its argument; none if it is damaged."""
    try:
        return [(code.name, str(value)) for code, value, _ in pickletools.genops(pickled or b"")]
    except (TypeError, ValueError):
        return []
