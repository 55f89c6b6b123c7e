"""Vectors in a tree of groups, from MATLAB, Simulink, dSPACE and HDF5 files.

Readers make a plain tree of a file: groups and structs are dicts, struct arrays and cells are lists,
numbers are arrays, text is str or a list of it. Each array of numbers is a vector, or a matrix of a few,
at its place: the names that lead to it. A text called ``name`` or ``unit`` describes the group that it
is in, and a text in a neighbouring group (``units.p``) the vector of its name. The time of a vector is
the nearest above it that has as many samples.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias, TypeGuard

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
"""Fields with the samples of a struct that is one signal: its only vector of their length but times."""

NAMES = {"name", "names", "label", "labels", "channels", "columns", "headers"}
"""Fields with the name of such a signal, or with those of the columns of a matrix."""

UNITS = {"unit", "units"}
"""Fields with the unit of such a signal, or with those of ``NAMES``."""

INFO = "Info"
"""Suffix of a group that describes another, as ``DataInfo`` does ``Data``."""


@dataclass(frozen=True)
class Unread:
    """Data that cannot be read, and the reason in a few words."""

    reason: str


Node: TypeAlias = "Mapping[str, Node] | Sequence[Node] | NDArray[Any] | str | Unread"
Place: TypeAlias = tuple[str, ...]


def table(
    tree: Mapping[str, Node], path: Path, *, dot: str = ".", meta: Mapping[str, Any] | None = None
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
    leaves = dict(_leaves(tree, ()))
    unread: dict[str, str] = {}
    arrays: dict[Place, NDArray[Any]] = {}
    rates: dict[str, float] = {}
    for place, leaf in leaves.items():
        where = dot.join(place)
        if isinstance(leaf, Unread):
            unread[where] = leaf.reason
        if not isinstance(leaf, np.ndarray) or not leaf.size:
            continue
        values = np.squeeze(leaf)
        if values.ndim == 0:
            if values.dtype.kind in "biuf" and timebase.is_rate(place[-1]):
                rates[where] = float(values)
        elif values.dtype.kind not in "biufmM":
            complex_ = values.dtype.kind == "c"
            unread[where] = "complex numbers" if complex_ else f"values of type {values.dtype}"
        elif values.ndim > 1 and not is_matrix(values.shape):
            unread[where] = f"an array of {' x '.join(map(str, leaf.shape))}"
        else:
            arrays[place] = values
    columns, unit_places = _vectors(_since_first(arrays), leaves, dot)
    for place, stated in _units(columns, unit_places, leaves).items():
        if len(stated) > 1:
            unread[dot.join(place)] = f"its units are {listed(sorted(stated))}"
            del columns[place]
        elif stated:
            columns[place] = replace(columns[place], unit=min(stated))
    columns = _timed(columns, unit_places, unread, dot)
    lengths = {vector.size for vector in columns.values() if vector.times is None}
    texts: list[Column] = []
    for place, lines in leaves.items():
        if isinstance(lines, list) and lines:
            if len(lines) in lengths:
                texts.append(Column(place[-1], None, texts=lines, place=dot.join(place)))
            elif place[-1].casefold() not in NAMES | UNITS:
                unread[dot.join(place)] = "text"
    if not columns:
        raise without_numbers(unread, path)
    labels = Counter(vector.label for vector in columns.values())
    for place, vector in columns.items():
        full = dot.join(place)
        columns[place] = replace(vector, place=full)
        if labels[vector.label] > 1:
            alias = (
                vector.label if is_standard(vector.label) else re.sub(r"\W+", "_", full).strip("_")
            )
            columns[place] = replace(vector, header=full, alias=alias, place=full)
    all_columns = (*columns.values(), *texts)
    return Table(all_columns, meta=meta or {}, rates=rates, unread=unread)


def runs(tree: Mapping[str, Node], path: Path, **how: Any) -> list[Table]:
    """Return a table of every run of a list of structs alike that each have times, else of the tree.

    ``how`` is what else `table` takes.
    """
    lists = {name: node for name, node in tree.items() if _is_of_runs(node)}
    if len(lists) != 1:
        return [table(tree, path, **how)]
    ((variable, structs),) = lists.items()
    shared = {name: node for name, node in tree.items() if name != variable}
    tables: list[Table] = []
    for number, struct in enumerate(structs, start=1):
        names = [node for key, node in struct.items() if key in NAMES and isinstance(node, str)]
        arrays = {key: node for key, node in struct.items() if not isinstance(node, str)}
        name = names[0] if names else f"{variable} {number}"
        tables.append(replace(table({**shared, **arrays}, path, **how), name=name))
    return tables


def _is_of_runs(node: Node) -> TypeGuard[Sequence[Mapping[str, Node]]]:
    """Return whether a node is a list of structs with the same names, of times and something else."""
    if not isinstance(node, list) or len(node) < 2 or not isinstance(node[0], dict):
        return False
    vectors = [name for name, of in node[0].items() if isinstance(of, np.ndarray) and of.size > 1]
    timed = any(map(is_time, vectors)) and len(vectors) > 1
    return timed and all(isinstance(struct, dict) and {*struct} == {*node[0]} for struct in node)


def _since_first(arrays: Mapping[Place, NDArray[Any]]) -> dict[Place, NDArray[Any]]:
    """Return instants as the time since the first of all, which clocks have in common."""
    instants = [values for values in arrays.values() if values.dtype.kind == "M"]
    finite = [values[~np.isnat(values)] for values in instants]
    first = min((values.min() for values in finite if values.size), default=np.datetime64(0, "ns"))
    return {at: x - first if x.dtype.kind == "M" else x for at, x in arrays.items()}


def without_numbers(unread: Mapping[str, str], path: Path) -> DataError:
    """Return the error for a file without vectors, listing what is not read."""
    reasons = listed([f"{place} ({reason})" for place, reason in unread.items()])
    return DataError(
        "there are no vectors of numbers in it" + (f"; not read: {reasons}" if unread else ""),
        file=path,
        remedy="save each channel as one vector, all of one length, or as a column of one matrix",
    )


def _leaves(node: Any, place: Place) -> Iterator[tuple[Place, Node]]:
    """Yield the arrays and texts in a tree; elements of other lists are numbered."""
    while isinstance(node, list) and len(node) == 1:
        node = node[0]
    if isinstance(node, list):
        node = node if (merged := _merged(node)) is None else merged
    if isinstance(node, Mapping):
        for name, child in node.items():
            yield from _leaves(child, (*place, name))
    elif not isinstance(node, list) or all(isinstance(child, str) for child in node):
        yield place, node
    else:
        form = "{}({})" if all(isinstance(child, Mapping) for child in node) else "{}{{{}}}"
        for i, child in enumerate(node, start=1):
            yield from _leaves(child, (*place[:-1], form.format(place[-1], i)))


def _merged(nodes: Sequence[Any]) -> Node | None:
    """Return the merged vector, texts, or struct of a struct array, or None."""
    words = [isinstance(item, str) for item in nodes]
    scalars = [isinstance(item, np.ndarray) and item.size == 1 for item in nodes]
    if all(words):
        return list(nodes)
    if all(scalars):
        return np.array([item.reshape(-1)[0] for item in nodes])
    if all(isinstance(item, Mapping) and item.keys() == nodes[0].keys() for item in nodes):
        fields = {name: _merged([item[name] for item in nodes]) for name in nodes[0]}
        merged = {name: node for name, node in fields.items() if node is not None}
        return merged if len(merged) == len(fields) else None
    mixed = all(word or scalar for word, scalar in zip(words, scalars, strict=True))
    return Unread("a cell of text and numbers") if mixed else None


def _vectors(
    arrays: Mapping[Place, NDArray[Any]], leaves: Mapping[Place, Node], dot: str
) -> tuple[dict[Place, Column], dict[Place, tuple[Place, ...]]]:
    """Return the vectors and matrix columns by path, and the paths where units of them may be.

    The first of these is the group that a vector represents, or itself.
    """
    names, units = (
        {at[:-1]: leaf for at, leaf in leaves.items() if at[-1].casefold() in fields}
        for fields in (NAMES, UNITS)
    )
    alike = Counter((at[:-1], max(a.shape)) for at, a in arrays.items() if not is_time(at[-1]))
    columns: dict[Place, Column] = {}
    unit_places: dict[Place, tuple[Place, ...]] = {}
    for place, values in arrays.items():
        home, field = place[:-1], place[-1]
        header = name = field
        unit_places[place] = (place,)
        if alike[home, max(values.shape)] == 1 and not is_time(field):
            unit_places[place] = (place, home)
            if home and field.casefold() in DATA:
                unit_places[place] = (home, place)
                title = names.get(home)
                if isinstance(title, str) and title.strip():
                    header = name = title
                elif values.ndim == 1:
                    header, name = dot.join(place), home[-1]
        if values.ndim == 1:
            columns[place] = _column(header, name, values)
            continue
        rows = values if values.shape[0] < values.shape[1] else values.T
        titles, stated = (_of_columns(texts.get(home), len(rows)) for texts in (names, units))
        plain = parse(header)
        for i, row in enumerate(rows):
            number = f"[{i + 1}]"
            named = titles[i] if titles else header + number
            name = f"{plain.name}_{i + 1}" + (f" [{plain.unit}]" if plain.unit else "")
            at = (*home, field + number)
            column = _column(named, named if titles else name, row)
            columns[at] = replace(column, unit=stated[i] if stated else None, matrix=True)
            unit_places[at] = ((*home, named), *(() if stated else unit_places[place]))
    return columns, unit_places


def _of_columns(texts: Node | None, n: int) -> Sequence[str] | None:
    """Return the texts for n columns of a matrix: a list, or one text with commas."""
    listed = texts.split(",") if isinstance(texts, str) else texts
    return (
        [str(text).strip() for text in listed]
        if isinstance(listed, list) and len(listed) == n
        else None
    )


def _column(header: str, name: str, values: NDArray[Any]) -> Column:
    made = column(header, np.ascontiguousarray(values))
    return replace(made, alias=None if name == header else name)


def _units(
    columns: Mapping[Place, Column],
    unit_places: Mapping[Place, tuple[Place, ...]],
    leaves: Mapping[Place, Node],
) -> dict[Place, set[str]]:
    """Return the units stated for vectors, or for their names in a neighbouring group."""
    groups = {at[:-1] for at, leaf in leaves.items() if isinstance(leaf, str) and find(leaf)}
    signals = {*unit_places, *(places[0] for places in unit_places.values())}
    units: dict[Place, set[str]] = {}
    neighbours: dict[Place, set[str]] = {}
    for place, leaf in leaves.items():
        home = place[:-1]
        if place[-1].casefold() in UNITS and isinstance(leaf, (str, list) if home else str):
            place = (*home[:-1], home[-1].removesuffix(INFO)) if home else ()
        elif not isinstance(leaf, str) or not (
            home in groups or (home and home[-1].casefold() in UNITS)
        ):
            continue
        stated = {leaf} if isinstance(leaf, str) else set(leaf)
        units.setdefault(place, set()).update(stated - {""})
        if len(place) > 1 and place not in signals:
            neighbours.setdefault((*place[:-2], place[-1]), set()).update(stated - {""})
    result: dict[Place, set[str]] = {}
    for place, vector in columns.items():
        above = [(*place[:i], vector.label) for i in range(len(place) - 1, -1, -1)]
        texts = [units.get(at) for at in unit_places[place]] + [neighbours.get(at) for at in above]
        result[place] = set() if vector.unit else next(filter(None, texts), set())
    return result


def _timed(
    columns: Mapping[Place, Column],
    unit_places: Mapping[Place, tuple[Place, ...]],
    unread: dict[str, str],
    dot: str,
) -> dict[Place, Column]:
    """Return the columns without repeated times, each with its times [s] if clocks differ."""
    seconds = {
        place: times for place, vector in columns.items() if (times := _seconds(vector)) is not None
    }
    clocks: dict[Place, Place] = {}
    for place, vector in columns.items():
        shared = [
            (len(unit_places[time][0]), time)
            for time in seconds
            if columns[time].size == vector.size
            and place[: len(unit_places[time][0]) - 1] == unit_places[time][0][:-1]
        ]
        nearest = [time for depth, time in shared if depth == max(shared)[0]]
        if len(nearest) == 1 and place not in seconds:
            clocks[place] = nearest[0]
    first, *repeated = dict.fromkeys(clocks.values()) or [()]
    if all(np.array_equal(seconds[first], seconds[time], equal_nan=True) for time in repeated):
        return {place: vector for place, vector in columns.items() if place not in repeated}
    untimed = [place for place in columns if place not in {first, *repeated, *clocks}]
    unread |= {dot.join(at): "it has no times, but others have" for at in sorted(untimed)}
    return {place: replace(columns[place], times=seconds[time]) for place, time in clocks.items()}


def _seconds(column: Column) -> Array | None:
    unit = find(column.unit or parse(column.label).unit or "s")
    if column.values is None or not is_time(column.label) or unit is None or unit.target != "s":
        return None
    return convert(column.values, unit.name, "s")
