"""The vectors in a tree of groups, as MATLAB, Simulink, dSPACE, HDF5 and JSON files hold them.

Readers make a plain tree of a file: groups and structs are dicts, struct arrays and cells are lists,
numbers are arrays, text is str or a list of it. What follows is where those programs put signals, their
names, their units and their times in such a tree.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.files import timebase
from mckibben.files.headers import is_standard, is_time, parse
from mckibben.files.notices import listed
from mckibben.files.table import Column, Table, column, is_matrix
from mckibben.files.units import convert, find

DATA = {"data", "samples", "signal", "value", "values", "y"}
"""Fields with the samples of a struct that is one signal: the only one of their length but times."""

NAMES = {"name", "names", "label", "labels", "channels", "columns", "headers"}
"""Fields with the name of such a signal, or with those of the columns of a matrix."""

UNITS = {"unit", "units"}
"""Fields with the unit of such a signal, or with those of the vectors beside it."""

ATTRIBUTES = ""
"""Entry of a group that maps the names of its vectors to their units, if these are attributes."""


@dataclass(frozen=True)
class Unread:
    """What holds data and cannot be read, and the reason in a few words."""

    reason: str


Node: TypeAlias = "Mapping[str, Node] | Sequence[Node] | NDArray[Any] | str | Unread"
Group: TypeAlias = Mapping[str, Node]


@dataclass(frozen=True)
class _Vector:
    """A vector or a column of a matrix, and what is written about it.

    Its ``home`` are the groups around it: it shares the times in the innermost that has some. Its
    ``name`` is that of the channel, its ``header`` what a user calls it where that is unique.
    """

    place: str
    home: tuple[str, ...]
    name: str
    header: str
    values: NDArray[Any]
    unit: str | None
    matrix: str | None = None

    @property
    def seconds(self) -> Array | None:
        """The samples [s], if these are times."""
        unit = find(self.unit or parse(self.name).unit or "s")
        if not is_time(self.name) or unit is None or unit.target != "s":
            return None
        return convert(np.asarray(self.values, dtype=np.float64), unit.name, "s")


def table(
    tree: Group, path: Path, *, dot: str = ".", meta: Mapping[str, Any] | None = None
) -> Table:
    """Return the table of the vectors in a tree.

    Parameters
    ----------
    tree : mapping
    path : path
        The name to give in errors.
    dot : str
        Separates the names in a place.
    meta : mapping, optional
        What else the file holds.
    """
    walk = _Walk(dot)
    walk.group(tree, ())
    unread, texts = walk.unread, walk.texts
    vectors, times = _clocks([walk.with_unit(each) for each in walk.vectors])
    if times:
        without = sorted(each.place for each in vectors if each.place not in times)
        unread |= dict.fromkeys(without, "it has no times, and others have their own")
        vectors = [each for each in vectors if each.place in times]
    lengths = set() if times else {each.values.size for each in vectors}
    unread |= {place: "text" for place, lines in texts.items() if len(lines) not in lengths}
    if not vectors:
        raise without_numbers(unread, path)
    columns = _columns(vectors, times)
    for place, lines in texts.items():
        if len(lines) in lengths:
            columns.append(Column(place.rpartition(dot)[2], None, texts=lines))
    return Table(tuple(columns), meta=meta or {}, rates=walk.rates, unread=unread)


def without_numbers(unread: Mapping[str, str], path: Path) -> DataError:
    """Return the error for a file that has no vectors, only what is not read."""
    reasons = listed([f"{place} ({reason})" for place, reason in unread.items()])
    return DataError(
        "there are no vectors of numbers in it" + (f"; not read: {reasons}" if unread else ""),
        file=path,
        remedy="save each channel as one vector, all of one length, or as a column of one matrix",
    )


class _Walk:
    """What was found in a tree, by its place; ``legends`` are units by name, each with its group."""

    def __init__(self, dot: str) -> None:
        self.dot = dot
        self.vectors: list[_Vector] = []
        self.texts: dict[str, Sequence[Any]] = {}
        self.rates: dict[str, float] = {}
        self.unread: dict[str, str] = {}
        self.legends: list[tuple[tuple[str, ...], dict[str, str]]] = []

    def group(self, group: Group, home: tuple[str, ...]) -> None:
        """Add what is in a group."""
        nodes = {
            name: node
            for field, entry in group.items()
            if field != ATTRIBUTES
            for name, node in _spread(field, entry).items()
        }
        signal = _signal(nodes)
        names, units = _field(nodes, NAMES), _field(nodes, UNITS)
        attributes: Any = group.get(ATTRIBUTES, {})
        if isinstance(units, list) and isinstance(names, list) and len(names) == len(units):
            attributes = dict(zip(names, units, strict=True)) | attributes
        elif isinstance(units, list) and len(set(units) - {""}) == 1:  # one for each sample
            units = max(units)
        for field, node in nodes.items():
            place = self.dot.join((*home, field))
            if isinstance(node, Mapping):
                if legend := _legend(node, named=field.casefold() in UNITS):
                    self.legends.append((home, legend))
                self.group(node, (*home, field))
            elif isinstance(node, list):
                if node and field.casefold() not in NAMES | UNITS:
                    self.texts[place] = node
            elif isinstance(node, np.ndarray) and np.squeeze(node).ndim == 0:
                if node.dtype.kind in "biuf" and timebase.is_rate(field):
                    self.rates[place] = float(node.reshape(-1)[0])
            elif reason := _unreadable(node):
                self.unread[place] = reason
            elif isinstance(node, np.ndarray) and node.size:
                unit = attributes.get(field) or _field(nodes.get(f"{field}Info"), UNITS)
                if field == signal and unit is None:
                    unit = units
                if isinstance(unit, list) and len(unit) == node.size:
                    self.unread[place] = "its unit changes"
                    continue
                name, header, above, values = field, field, home, np.squeeze(node)
                if field == signal and home and field.casefold() in DATA:
                    if isinstance(names, str) and names.strip():
                        name = header = names
                    elif values.ndim == 1:
                        name, header = home[-1], place
                    above = home[:-1] if is_time(name) else home
                unit = unit if isinstance(unit, str) and unit else None
                if values.ndim == 1:
                    self.vectors.append(_Vector(place, above, name, header, values, unit))
                    continue
                rows = values if values.shape[0] < values.shape[1] else values.T
                named = isinstance(names, list) and len(names) == len(rows)
                for i, row in enumerate(rows, start=1):
                    one = str(names[i - 1]) if named else f"{parse(name).name}_{i}"
                    its = attributes.get(one) or unit or parse(name).unit
                    called = one if named else f"{header}[{i}]"
                    self.vectors.append(
                        _Vector(f"{place}[{i}]", above, one, called, row, its, place)
                    )

    def with_unit(self, vector: _Vector) -> _Vector:
        """Return a vector with the unit in a struct beside it or beside a group around it."""
        for i in range(len(vector.home), -1, -1) if vector.unit is None else ():
            found = {
                legend[vector.name]
                for at, legend in self.legends
                if at == vector.home[:i] and vector.name in legend
            }
            if found:
                return replace(vector, unit=found.pop() if len(found) == 1 else None)
        return vector


def _unreadable(node: Node) -> str | None:
    """Return why what is no scalar is no vector or matrix of channels, or None if it is."""
    if not isinstance(node, np.ndarray) or node.size == 0:
        return node.reason if isinstance(node, Unread) else None
    if node.dtype.kind not in "biuf":
        return "complex numbers" if node.dtype.kind == "c" else f"values of type {node.dtype}"
    shape = np.squeeze(node).shape
    fits = len(shape) == 1 or is_matrix(shape)
    return None if fits else f"an array of {' x '.join(map(str, node.shape))}"


def _spread(name: str, node: Node) -> dict[str, Node]:
    """Return the elements of a struct array or a cell by their places; anything else as it is."""
    if not isinstance(node, list) or not node:
        return {name: node}
    if len(node) == 1:
        return _spread(name, node[0])
    if (together := _together(node)) is not None:
        return {name: together}
    if all(
        isinstance(each, str) or (isinstance(each, np.ndarray) and each.size < 2) for each in node
    ):
        return {name: Unread("a cell of text and numbers")}
    form = "{}({})" if all(isinstance(each, Mapping) for each in node) else "{}{{{}}}"
    return {
        inner: one
        for i, each in enumerate(node, start=1)
        for inner, one in _spread(form.format(name, i), each).items()
    }


def _together(nodes: Sequence[Any]) -> Node | None:
    """Return the vector of scalars, the texts, or the struct of such of a struct array, or None."""
    if all(isinstance(each, str) for each in nodes):
        return list(nodes)
    if all(isinstance(each, np.ndarray) and each.size == 1 for each in nodes):
        return np.array([each.reshape(-1)[0] for each in nodes])
    if not all(isinstance(each, Mapping) and each.keys() == nodes[0].keys() for each in nodes):
        return None
    fields = {name: _together([each[name] for each in nodes]) for name in nodes[0]}
    found = {name: node for name, node in fields.items() if node is not None}
    return found if len(found) == len(fields) else None


def _signal(nodes: Group) -> str | None:
    """Return the longest vector or matrix beside times, or None if several are as long."""
    lengths = [
        (max(node.shape), name)
        for name, node in nodes.items()
        if isinstance(node, np.ndarray) and node.size > 1 and not is_time(name)
    ]
    longest = [name for length, name in lengths if length == max(lengths)[0]]
    return longest[0] if len(longest) == 1 else None


def _field(nodes: Node | None, names: set[str]) -> Any:
    group = nodes if isinstance(nodes, Mapping) else {}
    return next((node for name, node in group.items() if name.casefold() in names), None)


def _legend(group: Group, *, named: bool) -> dict[str, str]:
    """Return units by name from a struct of texts, or of structs with a field for the unit.

    Unless its name is that of units, it has to hold one that is known. Structs with ten samples or more
    are signals themselves, other arrays in them are ranges and the like.
    """
    units = {
        name: node if isinstance(node, str) else _field(node, UNITS)
        for name, node in group.items()
        if not isinstance(node, Mapping)
        or not any(isinstance(each, np.ndarray) and each.size > 9 for each in node.values())
    }
    found = {name: unit for name, unit in units.items() if isinstance(unit, str) and unit}
    return found if named or any(map(find, found.values())) else {}


def _clocks(vectors: Sequence[_Vector]) -> tuple[list[_Vector], dict[str, Array]]:
    """Return the vectors without repeated times, and the times [s] by place where clocks differ."""
    seconds = {each.place: times for each in vectors if (times := each.seconds) is not None}
    clocks: dict[str, str] = {}
    for each in vectors:
        shared = [
            time
            for time in vectors
            if time.place in seconds
            and time.values.size == each.values.size
            and each.home[: len(time.home)] == time.home
        ]
        depth = max((len(time.home) for time in shared), default=0)
        nearest = [time.place for time in shared if len(time.home) == depth]
        if len(nearest) == 1 and each.place not in seconds:
            clocks[each.place] = nearest[0]
    first, *others = dict.fromkeys(clocks.values()) or [""]
    alike = all(np.array_equal(seconds[first], seconds[other], equal_nan=True) for other in others)
    dropped = others if alike else [first, *others]
    rest = [each for each in vectors if each.place not in dropped]
    return rest, {} if alike else {place: seconds[time] for place, time in clocks.items()}


def _columns(vectors: Sequence[_Vector], times: Mapping[str, Array]) -> list[Column]:
    """Return the columns of vectors; where a name is not unique, the place is the header."""
    names = Counter(each.name for each in vectors)
    columns: list[Column] = []
    for each in vectors:
        name, header = each.name, each.header
        if names[name] > 1:
            header = each.place
            if not is_standard(name):
                name = re.sub(r"\W+", "_", each.place).strip("_")
        own = column(header, np.ascontiguousarray(each.values), each.unit)
        says = None if name == header else name
        columns.append(replace(own, says=says, times=times.get(each.place), matrix=each.matrix))
    return columns
