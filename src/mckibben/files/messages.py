"""Where the numbers are in a message of ROS, by the definition of its type.

Messages whose strings and arrays have the same lengths have their numbers in the same places: the
first is walked through, and the others are only compared with it. The definitions come with the file;
nothing is made of them but this walk.

By "XCDR version 1" (OMG, DDS-XTYPES 1.3) for ROS 2, and the serialization of ROS 1.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

BASE, NAME, ARRAY, SEQUENCE = 1, 2, 3, 4
"""Kinds of fields, as rosbags numbers them."""

MOST_ELEMENTS = 64
"""Numbers of an array that are channels; longer ones are pictures, clouds and the like."""

MOST_STEPS = 100_000
"""Fields that one message may have, with those within each other."""

_DEPTH = 32
_KINDS = {
    "bool": "u1", "byte": "u1", "char": "u1", "octet": "u1", "uint8": "u1", "int8": "i1",
    "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8",
    "float32": "f4", "float64": "f8",
}  # fmt: skip
_TIMES = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
_STAMP = ("header/stamp/sec", "header/stamp/nanosec")

Fields = list[tuple[str, Any]]
Types = Mapping[str, tuple[Any, Fields]]
"""Name of a type -> its constants, and its fields with what they are."""


@dataclass
class Layout:
    """Where the numbers of a message are.

    Parameters
    ----------
    size : int
        Bytes of the message.
    numbers : dict of str to (int, str)
        Place in the message and NumPy's type, by path of the field: ``wrench/force/x``, ``data[2]``.
    stamp : list of (int, str)
        Those of the seconds and nanoseconds in its header, if it has one.
    fixed : list of (int, bytes)
        What must stand in it so that this layout holds.
    """

    size: int
    numbers: dict[str, tuple[int, str]] = field(default_factory=dict)
    stamp: list[tuple[int, str]] = field(default_factory=list)
    fixed: list[tuple[int, bytes]] = field(default_factory=list)

    def holds(self, message: bytes) -> bool:
        """Tell whether a message has this layout."""
        return len(message) == self.size and all(
            message[at : at + len(what)] == what for at, what in self.fixed
        )


def layout(message: bytes, kind: str, types: Types, *, cdr: bool) -> Layout:
    """Return the layout of a message.

    Parameters
    ----------
    message : bytes
    kind : str
        Name of its type.
    types : mapping
    cdr : bool
        Whether it is serialized as in ROS 2, or else as in ROS 1.

    Raises
    ------
    ValueError
        If the message is not of that type, or too deep, or of another serialization.
    LookupError
        If a type is not known.
    """
    walk = _Walk(message, types, cdr)
    walk.through(kind, "", 0)
    found = walk.found
    for path in _STAMP:
        if path in walk.times:
            found.stamp.append(walk.times[path])
    _name(found, walk.names)
    return found


def _name(found: Layout, names: list[str]) -> None:
    """Call elements of arrays by the names in the message, as those of joints, if they are as many."""
    if not names or len(set(names)) < len(names):
        return
    for path in list(found.numbers):
        array, bracket, index = path.partition("[")
        last = f"{array}[{len(names) - 1}]"
        beyond = f"{array}[{len(names)}]"
        if bracket and "/" not in array and last in found.numbers and beyond not in found.numbers:
            found.numbers[f"{array}/{names[int(index[:-1])]}"] = found.numbers.pop(path)


class _Walk:
    """A walk through one message."""

    def __init__(self, message: bytes, types: Types, cdr: bool) -> None:
        self._message, self._types, self._cdr = message, types, cdr
        self._begin = 0
        self._order = "<"
        self._at = self._steps = 0
        self.found = Layout(len(message))
        self.times: dict[str, tuple[int, str]] = {}
        self.names: list[str] = []
        if cdr:
            head = message[:4]
            if len(head) < 4 or head[:2] not in (b"\x00\x00", b"\x00\x01"):
                raise ValueError("a message is not serialized as plain CDR")
            self._order = "<" if head[1] else ">"
            self._begin = self._at = 4
            self.found.fixed.append((0, head[:2]))

    def through(self, kind: str, path: str, depth: int) -> None:
        """Go through the fields of a type."""
        if depth > _DEPTH:
            raise ValueError("its types are nested too deeply")
        if kind in _TIMES:
            for part in ("sec", "nanosec"):
                place = self._take("i4" if part == "sec" and self._cdr else "u4")
                self.times[f"{path}/{part}"] = place
            return
        fields = self._types[kind][1]
        if not fields and self._cdr:
            self._take("u1")  # an empty type is one byte
        for name, what in fields:
            self._field(what, f"{path}/{name}" if path else name, depth)

    def _field(self, what: Any, path: str, depth: int) -> None:
        self._steps += 1
        if self._steps > MOST_STEPS:
            raise ValueError("a message has too many fields")
        sort, about = what
        if sort == BASE:
            self._base(about[0], path)
        elif sort == NAME:
            self.through(about, path, depth + 1)
        else:
            n = about[1] if sort == ARRAY else self._count()
            self._elements(about[0], n, path, depth)

    def _elements(self, what: Any, n: int, path: str, depth: int) -> None:
        kind = _KINDS.get(what[1][0]) if what[0] == BASE else None
        if kind is not None and n > MOST_ELEMENTS:
            self._align(int(kind[1]))
            self._skip(n * int(kind[1]))
            return
        for k in range(n):
            self._field(what, f"{path}[{k}]", depth)

    def _base(self, name: str, path: str) -> None:
        if name in _KINDS:
            place = self._take(_KINDS[name])
            if path.partition("/")[0] != "header" and _elements_of(path) < MOST_ELEMENTS:
                self.found.numbers[path] = place
            return
        if name != "string":
            raise ValueError(f"fields of type {name!r} are not read")
        n = self._count()
        text = self._message[self._at : self._at + n]
        if path.partition("[")[0] == "name" and path != "name":
            self.found.fixed.append((self._at, text))
            self.names.append(text.rstrip(b"\0").decode("utf-8", "replace"))
        self._skip(n)

    def _take(self, kind: str) -> tuple[int, str]:
        size = int(kind[1])
        self._align(size)
        place = self._at, self._order + kind
        self._skip(size)
        return place

    def _count(self) -> int:
        at, kind = self._take("u4")
        raw = self._message[at : at + 4]
        self.found.fixed.append((at, raw))
        return int.from_bytes(raw, "little" if kind[0] == "<" else "big")

    def _align(self, size: int) -> None:
        if self._cdr:
            self._at += (self._begin - self._at) % size

    def _skip(self, size: int) -> None:
        self._at += size
        if self._at > len(self._message):
            raise ValueError("a message is cut off")


def _elements_of(path: str) -> int:
    """Return the largest index in a path."""
    indices = [part.partition("]")[0] for part in path.split("[")[1:]]
    return max(map(int, indices), default=0)
