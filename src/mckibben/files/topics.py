"""The messages of a topic, as columns of numbers."""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mckibben.files.headers import channel_of, parse, unit_of
from mckibben.files.limits import Budget
from mckibben.files.messages import Layout, Types, layout
from mckibben.files.table import Column, Table

MOST_LAYOUTS = 256
"""Ways in which the messages of one topic may differ in the lengths of their strings and arrays."""

MOST_DEFINITION = 2**18
"""Characters of the definition of a type, with the types in it."""

_PIECE = 2**20
_PLAIN = ("data", "value")
"""Names of fields that tell nothing: there the topic's tells."""

_UNITS = {
    "sensor_msgs/msg/FluidPressure": {"fluid_pressure": "Pa"},
    "sensor_msgs/msg/Temperature": {"temperature": "degC"},
    "sensor_msgs/msg/Range": {"range": "m"},
    "geometry_msgs/msg/Wrench": {f"force/{axis}": "N" for axis in "xyz"},
    "geometry_msgs/msg/WrenchStamped": {f"wrench/force/{axis}": "N" for axis in "xyz"},
}
"""Units that a type of message demands, by field."""


@dataclass(frozen=True)
class Connection:
    """What is sent on a topic.

    Parameters
    ----------
    topic, kind : str
        Names of the topic and of the type of its messages, as in ``std_msgs/msg/Float64``.
    definition : str or None
        Of the type, in the language of ``.msg`` files; None where the file has none.
    cdr : bool
        Whether messages are serialized as in ROS 2, or else as in ROS 1.
    problem : str
        Why its messages cannot be read, if they cannot.
    """

    topic: str
    kind: str
    definition: str | None
    cdr: bool
    problem: str = ""


class Topic:
    """The messages of one topic, taken one by one.

    Parameters
    ----------
    connection : Connection
    budget : Budget
    """

    def __init__(self, connection: Connection, budget: Budget) -> None:
        self._connection = connection
        self._budget = budget
        self._groups: list[_Group] = []
        self._types: Types = {}
        self.n = 0
        self.problem = connection.problem
        if not self.problem:
            self._types, self.problem = _types(connection)

    def take(self, when: int, message: bytes) -> None:
        """Take a message, and the time at which it was recorded [ns]."""
        self.n += 1
        if self.problem:
            return
        place = next((k for k, one in enumerate(self._groups) if one.layout.holds(message)), None)
        if place is None:
            try:
                found = self._layout(message)
            except ValueError as error:
                self.problem = f"message {self.n}: {error}"
                return
            except LookupError as error:
                self.problem = f"the type {error} is not defined in it"
                return
            if len(self._groups) == MOST_LAYOUTS:
                self.problem = f"its messages have more than {MOST_LAYOUTS} shapes"
                return
            self._groups.insert(0, _Group(found, self._budget))
        elif place:
            self._groups.insert(0, self._groups.pop(place))  # the next one is most likely alike
        self._groups[0].take(self.n, when, message)

    def _layout(self, message: bytes) -> Layout:
        return layout(message, self._connection.kind, self._types, cdr=self._connection.cdr)

    def columns(self, began: int) -> list[Column]:
        """Return its columns, with times [s] since an instant [ns]."""
        for group in self._groups:
            group.unpack()
        groups = [group for group in self._groups if group.layout.numbers]
        paths = dict.fromkeys(path for group in groups for path in group.layout.numbers)
        stamped = all(group.is_stamped() for group in groups)
        found: list[Column] = []
        for path in paths:
            with_it = [group for group in groups if path in group.layout.numbers]
            order = np.argsort(np.concatenate([group.order for group in with_it]), kind="stable")
            whens = np.concatenate(
                [group.stamps() if stamped else np.array(group.whens) for group in with_it]
            )[order]
            values = np.concatenate([group.values(path) for group in with_it])[order]
            held = with_it[0].layout.numbers[path][1][1] in "iu"
            found.append(self._column(path, values, (whens - began) * 1e-9, held))
        return found

    def _column(
        self, path: str, values: NDArray[Any], times: NDArray[np.float64], held: bool
    ) -> Column:
        topic, kind = self._connection.topic, self._connection.kind
        header = f"/{topic.strip('/')}/{path}"
        last, of_topic = path.rpartition("/")[2], topic.rpartition("/")[2]
        unit = _UNITS.get(kind, {}).get(path)
        words = [of_topic if last in _PLAIN else last]
        if unit == "Pa":
            words = [of_topic, "pressure"]
        says = next((word for word in words if _is_standard(word)), _indexed(header))
        return Column(header, values.astype(np.float64), unit, says=says, times=times, held=held)


class _Group:
    """The messages of one layout."""

    def __init__(self, found: Layout, budget: Budget) -> None:
        self.layout = found
        self.order: list[int] = []
        self.whens: list[int] = []
        self._places = [*found.numbers.values(), *found.stamp]
        self._parts: list[list[NDArray[Any]]] = [[] for _ in self._places]
        self._waiting: list[bytes] = []
        self._budget = budget

    def take(self, number: int, when: int, message: bytes) -> None:
        if not self.layout.numbers:
            return
        self.order.append(number)
        self.whens.append(when)
        self._waiting.append(message)
        if len(self._waiting) * len(message) > _PIECE:
            self.unpack()

    def unpack(self) -> None:
        if not self._waiting:
            return
        self._budget.samples(len(self._waiting) * len(self._places))
        raw = np.frombuffer(b"".join(self._waiting), np.uint8).reshape(len(self._waiting), -1)
        self._waiting.clear()
        for (at, kind), parts in zip(self._places, self._parts, strict=True):
            cells = np.ascontiguousarray(raw[:, at : at + int(kind[2])])
            parts.append(cells.view(kind)[:, 0])

    def values(self, path: str) -> NDArray[Any]:
        return np.concatenate(self._parts[list(self.layout.numbers).index(path)])

    def stamps(self) -> NDArray[np.int64]:
        seconds, rest = (np.concatenate(parts).astype(np.int64) for parts in self._parts[-2:])
        return seconds * 10**9 + rest

    def is_stamped(self) -> bool:
        return bool(self.layout.stamp) and bool(np.all(self.stamps() > 0))


def _indexed(header: str) -> str:
    """Return a header without brackets, in which units stand elsewhere."""
    return header.replace("[", "/").replace("]", "")


def _is_standard(word: str) -> bool:
    channel = channel_of(parse(word))
    return channel != "time" and unit_of(channel) is not None


def _types(connection: Connection) -> tuple[Types, str]:
    """Return the types that a definition defines, or why it cannot be read."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    if connection.definition is None:
        return get_typestore(Stores.ROS2_JAZZY).fielddefs, ""
    if len(connection.definition) > MOST_DEFINITION:
        return {}, "the definition of its messages is too long"
    with contextlib.suppress(Exception):  # the parser raises anything at what it cannot read
        return get_types_from_msg(connection.definition, connection.kind), ""
    return {}, "the definition of its messages cannot be read"


def table(columns: Sequence[Column], began: int, left_out: list[str]) -> Table:
    """Return the table of the columns of a bag that began at an instant [ns since 1970].

    Where several say the same channel, none does: it is for the caller to name one.
    """
    said = Counter(channel_of(parse(column.label)) for column in columns)
    columns = [
        column
        if said[channel_of(parse(column.label))] == 1
        else replace(column, says=_indexed(column.header))
        for column in columns
    ]
    meta = {"ignored_columns": left_out} if left_out else {}
    return Table(tuple(columns), start_time=began * 1e-9, meta=meta)


def one_bag(found: Mapping[Path, list[Table]]) -> Table:
    """Return one table of those of the files that a bag was cut into."""
    parts = sorted((each for some in found.values() for each in some), key=lambda t: t.start_time)
    columns: dict[str, list[Column]] = {}
    for part in parts:
        for column in part.columns:
            assert column.times is not None
            since = part.start_time - parts[0].start_time
            moved = replace(column, times=column.times + since)
            columns.setdefault(column.header, []).append(moved)
    joined = (
        replace(
            pieces[0],
            values=np.concatenate([each.values for each in pieces if each.values is not None]),
            times=np.concatenate([each.times for each in pieces if each.times is not None]),
        )
        for pieces in columns.values()
    )
    return replace(parts[0], columns=tuple(joined))
