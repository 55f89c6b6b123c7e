"""The vectors in a tree of groups, as MATLAB, Simulink, dSPACE and HDF5 files hold them.

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
from mckibben.files.headers import channel_of, parse, unit_of
from mckibben.files.notices import listed
from mckibben.files.table import Column, Table, column, columns_of, is_matrix
from mckibben.files.units import convert, find

DATA = {"data", "samples", "signal", "value", "values", "y"}
"""Fields with the samples of a struct that is one signal: the only one of their length but times."""

NAMES = {"name", "names", "label", "labels", "channels", "headers"}
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
    """A vector or matrix, and what is written about it.

    Parameters
    ----------
    place : str
    home : tuple of str
        The groups that it is in. It shares the times in the innermost of them that has some; times
        belong to the vectors in their ``home`` and below.
    name : str
    values : numpy.ndarray
        Without axes of one element.
    unit : str, optional
    says : str, optional
        The name of its struct, where that names the channel.
    columns : mapping of str to (str or None)
        Names and units of the columns of a matrix.
    """

    place: str
    home: tuple[str, ...]
    name: str
    values: NDArray[Any]
    unit: str | None
    says: str | None
    columns: Mapping[str, str | None]

    @property
    def length(self) -> int:
        return max(self.values.shape)

    @property
    def is_time(self) -> bool:
        return self.values.ndim == 1 and _is_time(self.says or self.name)

    @property
    def time_unit(self) -> str | None:
        """The unit of times, or None if it is unknown or none of time."""
        unit = find(self.unit or parse(self.says or self.name).unit or "s")
        return unit.name if unit is not None and unit.target == "s" else None


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
    vectors, times = _clocks(walk.vectors)
    if times:
        without = {each.place for each in vectors if each.place not in times}
        unread |= dict.fromkeys(sorted(without), "it has no times, and others have their own")
        vectors = [each for each in vectors if each.place in times]
    lengths = set() if times else {each.length for each in vectors}
    unread |= {place: "text" for place, lines in texts.items() if len(lines) not in lengths}
    if not vectors:
        raise without_numbers(unread, path)
    columns = _columns(vectors, times)
    for place, lines in texts.items():
        if len(lines) in lengths:
            columns[place] = Column(place.rpartition(dot)[2], None, texts=lines)
    return Table(tuple(columns.values()), meta=meta or {}, rates=walk.rates, unread=unread)


def without_numbers(unread: Mapping[str, str], path: Path) -> DataError:
    """Return the error for a file that has no vectors, only what is not read."""
    reasons = [f"{place} ({reason})" for place, reason in unread.items()]
    return DataError(
        "there are no vectors of numbers in it"
        + (f"; not read: {listed(reasons)}" if reasons else ""),
        file=path,
        remedy="save each channel as one vector, all of one length, or as a column of one matrix",
    )


class _Walk:
    """What was found in a tree, by its place."""

    def __init__(self, dot: str) -> None:
        self.dot = dot
        self.vectors: list[_Vector] = []
        self.texts: dict[str, Sequence[str]] = {}
        self.rates: dict[str, float] = {}
        self.unread: dict[str, str] = {}

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
        if isinstance(names, list) and isinstance(units, list) and len(names) == len(units):
            units = dict(zip(names, units, strict=True))
        by_name = _texts(units) | _texts(group.get(ATTRIBUTES))
        for field, node in nodes.items():
            place = self.dot.join((*home, field))
            if isinstance(node, Mapping):
                self.group(node, (*home, field))
            elif isinstance(node, Unread):
                self.unread[place] = node.reason
            elif isinstance(node, list):
                if node and field.casefold() not in NAMES | UNITS:
                    self.texts[place] = node
            elif isinstance(node, np.ndarray) and self._is_vector(place, field, node):
                unit, name, says, above = by_name.get(field), field, None, home
                if field == signal and unit is None and isinstance(units, str):
                    unit = units
                if field == signal and home and field.casefold() in DATA:
                    if isinstance(names, str) and names.strip():
                        name = names
                    elif np.squeeze(node).ndim == 1:
                        says = home[-1]
                    above = home[:-1] if _is_time(says or name) else home
                values, columns = np.squeeze(node), {}
                if isinstance(names, list) and values.ndim == 2:
                    columns = {each: by_name.get(each) or unit for each in names}
                    if len(columns) != min(values.shape):
                        columns = {}
                self.vectors.append(_Vector(place, above, name, values, unit, says, columns))

    def _is_vector(self, place: str, field: str, node: NDArray[Any]) -> bool:
        """Return whether an array is a vector or a matrix of channels; others are added here."""
        number, shape = node.dtype.kind in "biuf", np.squeeze(node).shape
        if node.size == 0:
            return False
        if not shape:
            if number and timebase.is_rate(field):
                self.rates[place] = float(node.reshape(-1)[0])
            return False
        if not number:
            kind = "complex numbers" if node.dtype.kind == "c" else f"values of type {node.dtype}"
            self.unread[place] = kind
        elif len(shape) > 1 and not is_matrix(shape):
            self.unread[place] = f"an array of {' x '.join(map(str, node.shape))}"
        else:
            return True
        return False


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
    structs = all(isinstance(each, Mapping) for each in node)
    form = "{}({})" if structs else "{}{{{}}}"
    return {
        inner: one
        for i, each in enumerate(node, start=1)
        for inner, one in _spread(form.format(name, i), each).items()
    }


def _together(nodes: Sequence[Node]) -> Node | None:
    """Return the vector of scalars, the texts, or the struct of such of a struct array, or None."""
    if all(isinstance(each, str) for each in nodes):
        return list(nodes)
    if all(isinstance(each, np.ndarray) and each.size == 1 for each in nodes):
        return np.array([each.reshape(-1)[0] for each in nodes if isinstance(each, np.ndarray)])
    structs = [each for each in nodes if isinstance(each, Mapping)]
    if len(structs) < len(nodes) or any(each.keys() != structs[0].keys() for each in structs):
        return None
    fields = {name: _together([each[name] for each in structs]) for name in structs[0]}
    found = {name: node for name, node in fields.items() if node is not None}
    return found if len(found) == len(fields) else None


def _signal(nodes: Group) -> str | None:
    """Return the longest vector or matrix beside times, or None if several are as long."""
    lengths = {
        name: max(node.shape)
        for name, node in nodes.items()
        if isinstance(node, np.ndarray) and node.size > 1 and not _is_time(name)
    }
    longest = [name for name, length in lengths.items() if length == max(lengths.values())]
    return longest[0] if len(longest) == 1 else None


def _field(nodes: Group, names: set[str]) -> Node | None:
    return next((node for name, node in nodes.items() if name.casefold() in names), None)


def _texts(node: Node | None) -> dict[str, str]:
    found = node if isinstance(node, Mapping) else {}
    return {name: text for name, text in found.items() if isinstance(text, str) and text}


def _is_time(name: str) -> bool:
    return channel_of(parse(name)) == "time"


def _clocks(vectors: list[_Vector]) -> tuple[list[_Vector], dict[str, Array]]:
    """Return the vectors without repeated times, and the times [s] by place where clocks differ."""
    times = [each for each in vectors if each.is_time and each.time_unit is not None]
    clocks: dict[str, _Vector] = {}
    for each in vectors:
        mine = [
            time
            for time in times
            if time.length == each.length and each.home[: len(time.home)] == time.home
        ]
        depth = max((len(time.home) for time in mine), default=0)
        nearest = [time for time in mine if len(time.home) == depth]
        if len(nearest) == 1 and not each.is_time:
            clocks[each.place] = nearest[0]
    used = list({time.place: time for time in clocks.values()}.values())
    repeated = {
        time.place
        for time in used[1:]
        if time.time_unit == used[0].time_unit
        and np.array_equal(time.values, used[0].values, equal_nan=True)
    }
    if len(used) == len(repeated) + 1 or not used:
        return [each for each in vectors if each.place not in repeated], {}
    seconds = {
        time.place: convert(np.asarray(time.values, dtype=np.float64), time.time_unit or "s", "s")
        for time in used
    }
    rest = [each for each in vectors if each.place not in seconds]
    return rest, {place: seconds[time.place] for place, time in clocks.items()}


def _columns(vectors: Sequence[_Vector], times: Mapping[str, Array]) -> dict[str, Column]:
    """Return the columns of vectors by place; where a name is not unique, its place is the header."""
    names = Counter(name for each in vectors for name in each.columns or [each.name])
    columns: dict[str, Column] = {}
    for each in vectors:
        unique = names[each.name] == 1
        if each.values.ndim == 1:
            header = each.name if unique and each.says is None else each.place
            found = {each.place: column(header, each.values.reshape(-1), each.unit)}
            says = each.says or (None if unique else _label(each.name, each.place))
            found[each.place] = replace(found[each.place], says=says)
        else:
            header = each.says or (each.name if unique else each.place)
            found = columns_of(each.place, header, each.values, each.unit)
        for (place, one), (name, unit) in zip(found.items(), each.columns.items(), strict=False):
            said = (
                {"header": name, "says": None}
                if names[name] == 1
                else {"header": place, "says": _label(name, place)}
            )
            found[place] = replace(one, unit=unit, **said)
        if times:
            found = {place: replace(one, times=times[each.place]) for place, one in found.items()}
        columns |= found
    return columns


def _label(name: str, place: str) -> str:
    """Return what names the channel where several have a name: that, if it is a standard one."""
    standard = unit_of(channel_of(parse(name))) is not None
    return name if standard else re.sub(r"\W+", "_", place)
