"""Equations of models with their numbers, and the meaning of their parameters."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from itertools import count, groupby
from typing import TYPE_CHECKING, Any

from mckibben.blocks.inverse import Inverse, commands
from mckibben.blocks.notation import (
    MANY,
    Written,
    bare,
    indexed,
    lettered,
    meanings,
    resolved,
    short,
    stem,
    symbols,
    tex,
    with_unit,
)
from mckibben.blocks.parameters import Parametrised, leaves

if TYPE_CHECKING:
    from mckibben.blocks.base import Block

Units = dict[str, str]

SEPARATOR = r",\; "
"""Between the entries of a vector."""


@dataclass(frozen=True)
class Quantity:
    """Meaning of one entry of a parameter vector.

    Parameters
    ----------
    name : str
        For people, unlike any other of the block.
    symbol : str
        In LaTeX.
    unit : str
        Empty for none.
    meaning : str
        In words.
    """

    name: str
    symbol: str
    unit: str
    meaning: str


def quantities(block: Block) -> tuple[Quantity, ...]:
    """Return the meanings of the entries of ``block.pack()``, in order."""
    result = list(_quantities(block, "", channel_units(block)))
    alike = Counter(quantity.name for _, quantity in result)
    return tuple(
        replace(quantity, name=prefix + quantity.name) if alike[quantity.name] > 1 else quantity
        for prefix, quantity in result
    )


def channel_units(part: Parametrised) -> Units:
    """Return the channel units of a part, from which units of parameters are derived."""
    if not hasattr(part, "inputs"):
        return {}
    block: Any = part
    scheduling = [c.unit for c in block.inputs if c.name in block.scheduling]
    return {
        "u": block.inputs[0].unit,
        "y": block.outputs[0].unit,
        "x": scheduling[0] if scheduling else "",
    }


def unit_of(part: Parametrised, field: str, index: tuple[int, ...], units: Units) -> str | None:
    """Return the unit of a parameter of a field; None if undeclared."""
    own = part.unit_of(field, index)
    if own is None:
        return None
    if "{in" in own or "{out" in own:
        block: Any = part
        for name, channels in (("in", block.inputs), ("out", block.outputs)):
            for level, place in enumerate(index):
                if place < len(channels):
                    units = units | {f"{name}{level}": channels[place].unit}
    return resolved(own, index[-1] if index else 0, units)


def _quantities(part: Parametrised, prefix: str, units: Units) -> Iterator[tuple[str, Quantity]]:
    """Yield every parameter with the names of the parts that contain it."""
    units = channel_units(part) or units
    names = iter(part.parameter_names)
    if not part.parameters:
        for k, name in enumerate(names):
            unit = part.unit_of("", (k,)) or ""
            yield prefix, Quantity(name, indexed(r"\theta_i", (k,), 1), unit, "")
        return
    said = meanings(type(part))
    for field in part.parameters:
        meaning, values = short(said.get(field, "")), getattr(part, field)
        for index, value in leaves(values):
            if isinstance(value, Parametrised):
                called = field.replace("_", " ")
                if index:
                    called = (
                        f"{value.kind} {index[0] + 1}:" if len(values) > 1 else f"{value.kind}:"
                    )
                for found in _quantities(value, f"{prefix}{called} ", units):
                    next(names)
                    yield found
                continue
            name = next(names)
            bracket = re.search(r" \[([^\]]*)\]$", name)
            unit = bracket[1] if bracket else unit_of(part, field, index, units) or ""
            letter = part.symbol_of(field, index)
            name = name[: bracket.start()] if bracket else name
            yield prefix, Quantity(name, letter, unit, meaning)


def written(part: Parametrised, title: str = "", units: Units | None = None) -> Written:
    """Return the equations of a block, or of a part of one.

    A muscle's model that is solved from a law, as a balance of forces, is that law with its letters.

    Parameters
    ----------
    title : str
        What to call it; default its kind and its channels.
    units : dict of str to str, optional
        Of the block that it is a part of.
    """
    if isinstance(part, Inverse) and not commands(part):
        law = part.forward
        return written(law, title or _title(part).replace(part.title, law.title, 1))
    units = channel_units(part) or units or {}
    inner = [
        written(
            value,
            f"{index[0] + 1}. {_title(value)}"
            if index
            else _title(value, field.name.replace("_", " ")),
            units,
        )
        for field in fields(part)  # type: ignore[arg-type]
        for index, value in leaves(getattr(part, field.name))
        if isinstance(value, Parametrised)
    ]
    numbers = (*_channels(part), *_numbers(part, units))
    remark = f"More than {MANY} numbers are not listed here; see the model file."
    large = any(r"\mathbb{R}" in line for line in numbers)
    equations = part.equations()
    return Written(title or _title(part), equations, numbers, remark * large, tuple(inner))


def _title(part: Parametrised, called: str = "") -> str:
    title = getattr(part, "title", part.kind)
    block: Any = part if hasattr(part, "inputs") else None
    if called:
        return f"{called}: {title}" if block else f"{called} ({title})"
    if block is None:
        return title
    ends = (", ".join(c.name for c in channels) for channels in (block.inputs, block.outputs))
    return f"{title}: {' → '.join(ends)}"


def channel_symbols(block: Parametrised) -> dict[str, str]:
    """Return channel name -> its letter in the equations of a block, or of its parts, in LaTeX.

    Channels are left out that have no letter of their own.
    """
    letters = {name: letter for letter, name, _ in _lettered(block)}
    if not letters:
        values = [getattr(block, field.name) for field in fields(block)]  # type: ignore[arg-type]
        parts = [part for value in values for _, part in leaves(value)]
        for part in parts:
            if isinstance(part, Parametrised):
                letters = channel_symbols(part) | letters
    counts = Counter(letters.values())
    return {name: letter for name, letter in letters.items() if counts[letter] == 1}


def _lettered(part: Any) -> list[tuple[str, str, str]]:
    """Return letter, name and unit of the channels of a part with formulas.

    Channels of one letter are counted, whichever fields they belong to.
    """
    if not hasattr(part, "ports") or not part.formulas:
        return []
    ports = zip("uxy", part.ports, strict=True)
    result = []
    for field, usual in {field: letter for letter, names in ports for field in names}.items():
        channels: Any = getattr(part, field, ())
        several = channels if isinstance(channels, tuple) else (channels,)
        result += [
            (part.letter_of(field, k) or f"{usual}_i", channel) for k, channel in enumerate(several)
        ]
    alike = Counter(letter for letter, _ in result)
    counted = {letter: count() for letter in alike}
    return [
        (
            indexed(letter, (next(counted[letter]),), 1) if alike[letter] > 1 else bare(letter),
            channel.name,
            channel.unit,
        )
        for letter, channel in result
    ]


def _channels(part: Any) -> Iterator[str]:
    """Yield the meanings of the channel letters."""
    if letters := [lettered(*entry) for entry in _lettered(part)]:
        yield r",\quad ".join(letters)


def _numbers(part: Parametrised, units: Units) -> Iterator[str]:
    """Yield the values of numbers, of vectors, and of the rows of matrices; of large ones the size.

    Numbers of one field that have several letters or units are written apart.
    """
    for field in symbols(type(part)):
        called = [
            (part.symbol_of(field, index), index, value)
            for index, value in leaves(getattr(part, field, None))
            if isinstance(value, float)
        ]
        large = len(called) > MANY

        def alike(one: tuple[str, tuple[int, ...], float]) -> tuple[object, ...]:
            letter, index, _ = one
            unit = "" if large else unit_of(part, field, index, units) or ""  # noqa: B023
            return unit, stem(letter), index[:-1]

        for (unit, *_), group in groupby(called, alike):
            letters, _, values = zip(*group, strict=True)
            listed = letters if len(letters) < 3 else (letters[0], r"\ldots", letters[-1])
            if large:
                yield rf"{_vector(listed)} \in \mathbb{{R}}^{{{len(letters)}}}"
            else:
                yield with_unit(f"{_vector(listed)} = {_vector([*map(tex, values)])}", str(unit))


def _vector(entries: Sequence[str]) -> str:
    return f"({SEPARATOR.join(entries)})" if len(entries) > 1 else entries[0]
