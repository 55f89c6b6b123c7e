"""Models on paper: their equations with their numbers, and the quantities in their parameter vectors."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

from mckibben.blocks.inverse import Inverse, commands
from mckibben.blocks.notation import (
    FEW,
    MANY,
    Written,
    indexed,
    lettered,
    meanings,
    resolved,
    short,
    tex,
    unit_tex,
    with_unit,
)

if TYPE_CHECKING:
    from mckibben.blocks.base import Block
    from mckibben.blocks.parameters import Parametrised

Units = dict[str, str]


@dataclass(frozen=True)
class Quantity:
    """One number of a parameter vector.

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
    """Return what every number of ``block.pack()`` is, in its order."""
    found = list(_quantities(block, "", channel_units(block)))
    alike = Counter(one.name for _, one in found)
    return tuple(
        replace(one, name=prefix + one.name) if alike[one.name] > 1 else one
        for prefix, one in found
    )


def channel_units(part: Parametrised) -> Units:
    """Return the units that those of a part's numbers are made of; none of what has no channels."""
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
    """Return the unit of a number of a field; None where nothing is declared."""
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
    """Give every number, each behind the names of the parts that it is in."""
    units = channel_units(part) or units
    names = iter(part.parameter_names)
    if not part.parameters:
        for place, name in enumerate(names):
            unit = part.unit_of("", (place,)) or ""
            yield prefix, Quantity(name, indexed(r"\theta_i", (place,), 1), unit, "")
        return
    said = meanings(type(part))
    for field in part.parameters:
        meaning = short(said.get(field, ""))
        for index, value in _walked(getattr(part, field)):
            if hasattr(value, "parameter_names"):
                named = f"{prefix}{_called(part, field, index, value)}"
                for found in _quantities(value, f"{named} ", units):
                    next(names)
                    yield found
                continue
            name = next(names)
            bracket = re.search(r" \[([^\]]*)\]$", name)
            unit = bracket[1] if bracket else unit_of(part, field, index, units) or ""
            symbol = indexed(part.notation.symbol(field), index, part.notation.first(field))
            name = name[: bracket.start()] if bracket else name
            yield prefix, Quantity(name, symbol, unit, meaning)


def _called(part: Parametrised, field: str, index: tuple[int, ...], value: Parametrised) -> str:
    """Return what a part of a part is called: its field, or its kind where it is one of several."""
    if not index:
        return field.replace("_", " ")
    alike = len(getattr(part, field)) > 1
    return f"{value.kind}{f' {index[0] + 1}' if alike else ''}:"


def _walked(value: Any, index: tuple[int, ...] = ()) -> Iterator[tuple[tuple[int, ...], Any]]:
    """Give numbers and parts of a field, each with its indices."""
    if isinstance(value, tuple):
        for place, item in enumerate(value):
            yield from _walked(item, (*index, place))
    elif isinstance(value, float) or hasattr(value, "parameter_names"):
        yield index, value


def written(part: Parametrised, title: str = "", units: Units | None = None) -> Written:
    """Return a block, or a part of one, on paper.

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
        return written(law, title or _title(part, "").replace(part.title, law.title, 1))
    units = channel_units(part) or units or {}
    inner: list[Written] = []
    for field in fields(part):  # type: ignore[arg-type]
        for index, value in _walked(getattr(part, field.name)):
            if hasattr(value, "parameter_names"):
                called = "" if index else field.name.replace("_", " ")
                place = f"{index[0] + 1}. " if index else ""
                inner.append(
                    written(
                        value, f"{place}{_title(value, called)}" if place or called else "", units
                    )
                )
    numbers = (*part.worked(), *_channels(part), *_numbers(part, units))
    large = any(r"\mathbb{R}" in line for line in numbers)
    return Written(
        title or _title(part, ""),
        part.equations(),
        numbers,
        f"More than {MANY} numbers are not written out: the model file holds them."
        if large
        else "",
        tuple(inner),
    )


def _title(part: Parametrised, called: str) -> str:
    title = getattr(part, "title", part.kind)
    if called and hasattr(part, "inputs"):
        return f"{called}: {title}"
    if called:
        return f"{called} ({title})"
    if not hasattr(part, "inputs"):
        return title
    block: Any = part
    given = ", ".join(channel.name for channel in block.inputs)
    return f"{title}: {given} → {', '.join(channel.name for channel in block.outputs)}"


def _channels(part: Parametrised) -> Iterator[str]:
    """Give what the letters of channels stand for."""
    if not hasattr(part, "inputs") or not part.notation.equations:
        return
    told = []
    for field, default in (("input", "u"), ("pressure", "p"), ("force", "f"), ("output", "y"),
                           ("driven", "u_i"), ("scheduled", "x_i"), ("given", "y_i")):  # fmt: skip
        value = getattr(part, field, None)
        several = value if isinstance(value, tuple) else (value,)
        if not several or not all(hasattr(channel, "unit") for channel in several):
            continue
        symbol = part.notation.symbols.get(field, default)
        for place, channel in enumerate(several):
            letter = indexed(symbol, (place,), 1) if len(several) > 1 else symbol
            told.append(lettered(letter, channel.name, channel.unit))
    if told:
        yield r",\quad ".join(told)


def _numbers(part: Parametrised, units: Units) -> Iterator[str]:
    """Give what every number is, in lines and tables."""
    scalars: list[str] = []
    vectors: dict[int, list[str]] = {}
    for field in part.notation.symbols:
        value = getattr(part, field, None)
        symbol = part.notation.symbol(field)
        if isinstance(value, float):
            unit = unit_of(part, field, (), units) or ""
            scalars.append(f"{symbol} = {with_unit(tex(value), unit)}")
        elif isinstance(value, tuple) and value and isinstance(value[0], float):
            vectors.setdefault(len(value), []).append(field)
        elif isinstance(value, tuple) and any(isinstance(row, tuple) and row for row in value):
            yield _matrix(symbol, value)
    for place in range(0, len(scalars), 4):
        yield r",\quad ".join(scalars[place : place + 4])
    for size, names in vectors.items():
        yield from _vectors(part, names, size, units)


def _matrix(symbol: str, rows: tuple[tuple[float, ...], ...]) -> str:
    """Return a table of numbers as a matrix, or its shape where that is large."""
    n, width = len(rows), max(map(len, rows))
    stem = re.sub(r"_(\{[^}]*\}|\w)$", "", symbol)
    if n * width > MANY:
        return rf"{stem} \in \mathbb{{R}}^{{{n} \times {width}}}"
    body = r" \\ ".join(" & ".join(map(tex, row)) for row in rows)
    return rf"{stem} = \begin{{pmatrix}} {body} \end{{pmatrix}}"


def _vectors(part: Parametrised, names: list[str], size: int, units: Units) -> Iterator[str]:
    """Give vectors of one size: short ones in a line, long ones side by side in tables."""
    firsts = {name: part.notation.first(name) for name in names}
    for name in names:
        symbol = part.notation.symbol(name)
        one = {unit_of(part, name, (place,), units) for place in range(size)}
        unit = (one.pop() or "") if len(one) == 1 else ""
        if size <= FEW:
            values = r",\; ".join(map(tex, getattr(part, name)))
            ends = [indexed(symbol, (place,), firsts[name]) for place in (0, size - 1)]
            letters = (r",\ldots," if size > 2 else ",\\,").join(dict.fromkeys(ends))
            yield f"{letters} = {with_unit(values, unit)}"
        elif size > MANY:
            stem = re.sub(r"_(\{[^}]*\}|\w)$", "", symbol)
            yield rf"{stem} \in \mathbb{{R}}^{{{size}}}"
    if FEW < size <= MANY:
        heads = ["i"]
        for name in names:
            found = unit_of(part, name, (0,), units)
            unit = rf"\,[{unit_tex(found)}]" if found else ""
            heads.append(part.notation.symbol(name) + unit)
        columns_of = [getattr(part, name) for name in names]
        lines = [
            " & ".join(
                [str(place + firsts[names[0]]), *(tex(column[place]) for column in columns_of)]
            )
            for place in range(size)
        ]
        columns = "r" * (1 + len(names))
        body = r" \\ ".join([" & ".join(heads) + r" \\ \hline " + lines[0], *lines[1:]])
        yield rf"\begin{{array}}{{{columns}}} {body} \end{{array}}"
