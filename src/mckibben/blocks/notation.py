"""Notation of models: symbol and unit of every field, as declared in its annotation, in LaTeX.

A class has its equations in ``formulas``, and the meanings of its fields in its docstring.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from html import unescape
from typing import NamedTuple

MANY = 12
"""Number of entries above which only the shape is written."""


class Symbol(NamedTuple):
    """Notation of a field: LaTeX symbol, first index, and unit (None if undeclared).

    In its annotation a field of numbers has its symbol, ``" from 0"`` where its index does not begin at
    1, and its unit in brackets: ``Annotated[Vector, "w_i [{y}/{u}]"]``. In units, ``{u}``, ``{y}`` and
    ``{x}`` are those of the first input, output and scheduling input, ``{in0}`` and ``{out0}``
    (``{in1}``, ``{out1}``) those of the channel that the first (second) index counts; units between bars
    belong to the numbers of a row, over and over. A field of channels has their symbol alone.
    """

    letter: str
    first: int = 1
    unit: str | None = None


@cache
def symbols(cls: type) -> dict[str, Symbol]:
    """Return the symbols that fields of a class have in their annotations."""
    result = {}
    for name, field in getattr(cls, "__pydantic_fields__", {}).items():
        for text in field.metadata:
            if isinstance(text, str):
                parts = re.fullmatch(r"(.*?)(?: from (\d))?(?: \[(.*)\])?", text)
                assert parts is not None
                result[name] = Symbol(parts[1], int(parts[2] or 1), parts[3] or "")
    return result


def declared(cls: type, field: str) -> Symbol:
    """Return the symbol of a field: as declared, or by its name."""
    text = rf"\mathrm{{{field.replace('_', chr(92) + ' ')}}}"
    return symbols(cls).get(field, Symbol(text))


@dataclass(frozen=True)
class Written:
    """Equations and parameters of a model, or of a part of one.

    Parameters
    ----------
    title : str
        What it is, in words.
    equations : tuple of str
        Its general form, in LaTeX.
    numbers : tuple of str
        Channels and values of the symbols, in LaTeX.
    remark : str
        What is not written, and why; empty for nothing.
    parts : tuple of Written
        What it is made of, in order.
    """

    title: str
    equations: tuple[str, ...]
    numbers: tuple[str, ...] = ()
    remark: str = ""
    parts: tuple[Written, ...] = ()


def indexed(symbol: str, index: Sequence[int], first: int) -> str:
    r"""Return a symbol with numeric subscripts.

    >>> indexed("w_i", (2,), 1), indexed("S_{kj}", (0, 1), 1), indexed("k_{p,i}", (0,), 1)
    ('w_{3}', 'S_{1,2}', 'k_{p,1}')
    """
    if not index:
        return symbol
    *outer, last = index
    numbers = ",".join([*(str(place + 1) for place in outer), str(last + first)])
    before, _, below = symbol.rpartition("_")
    if not before:
        return f"{symbol}_{{{numbers}}}"
    letters = re.findall(r"\\[a-z]+|\w", below)
    return f"{before}_{{{','.join([*letters[: -len(index)], numbers])}}}"


def stem(symbol: str) -> str:
    r"""Return a symbol without its indices: letters within a subscript that are words stay.

    >>> stem("w_{3}"), stem("k_{p,2}"), stem("T_p")
    ('w', 'k_{p}', 'T_p')
    """
    return re.sub(r"_\{,?\}", "", re.sub(r",?\b\d+\b", "", symbol))


def bare(letter: str) -> str:
    """Return the letter of a field of channels without its running index.

    >>> bare("y_i"), bare("p_{b,i}"), bare("y_{m}")
    ('y', 'p_{b}', 'y_{m}')
    """
    return re.sub(r",\w\}$", "}", re.sub(r"_\w$", "", letter))


def resolved(unit: str, place: int, units: Mapping[str, str]) -> str:
    """Return a unit without placeholders.

    >>> resolved("{y}/{u}", 0, {"y": "mm", "u": "bar"}), resolved("{y}/{u}", 0, {"y": "mm", "u": "mm"})
    ('mm/bar', '')
    >>> resolved("N|N/mm", 3, {}), resolved("1/{u}", 0, {"u": ""})
    ('N/mm', '')
    """
    choices = unit.split("|")
    text = choices[place % len(choices)]
    for name, own in units.items():
        text = text.replace(f"{{{name}}}", own or "1")
    over, _, under = text.partition("/")
    over = " ".join(word for word in over.split() if not re.fullmatch(r"1(\^\d)?", word))
    under = "" if re.fullmatch(r"1(\^\d)?", under) else under
    if not under or over == under:
        return over if not under else ""
    return f"{over or '1'}/{under}"


@cache
def meanings(cls: type) -> dict[str, str]:
    """Return the description of every field of a class and its bases, from docstrings."""
    result: dict[str, str] = {}
    for owner in reversed(cls.__mro__):
        text = inspect.cleandoc(owner.__dict__.get("__doc__") or "")
        _, _, section = text.partition("Parameters\n----------\n")
        section = re.split(r"\n\n?\S+\n-{3,}", section)[0]
        for entry in re.finditer(
            r"^(\S[^\n]*?) : [^\n]*\n((?:[ ]{4}[^\n]*\n?|\n)+)", section, re.M
        ):
            said = " ".join(entry[2].split())
            result |= dict.fromkeys(re.split(r",\s*", entry[1]), said)
    return result


def short(meaning: str) -> str:
    """Return the first sentence of a description, without units.

    >>> short("k, stiffness of the stops [N/mm], not negative. None by default.")
    'k, stiffness of the stops, not negative'
    """
    first = re.split(r"(?<=[^.])\.(?:\s|$)|;\s", meaning.replace("`", ""), maxsplit=1)[0]
    return re.sub(r"\s*\[[^\]]*\]", "", first).strip()


def tex(value: float, digits: int = 4) -> str:
    r"""Return a number in LaTeX.

    >>> tex(0.123456), tex(-1.5e-7), tex(2.0)
    ('0.1235', '-1.5 \\times 10^{-7}', '2')
    """
    text = f"{value:.{digits}g}"
    mantissa, _, exponent = text.partition("e")
    return rf"{mantissa} \times 10^{{{int(exponent)}}}" if exponent else mantissa


def in_unicode(symbol: str) -> str:
    r"""Return a symbol in LaTeX with its Greek letters as such.

    >>> in_unicode(r"\tau_{l}")
    'τ_{l}'
    """
    return re.sub(r"\\([a-z]+)", lambda word: unescape(f"&{word[1]};"), symbol)


def unit_tex(unit: str) -> str:
    r"""Return a unit in LaTeX.

    >>> unit_tex("N s/mm"), unit_tex("1/N^3")
    ('\\mathrm{N\\;s/mm}', '\\mathrm{1/N^{3}}')
    """
    text = re.sub(r"[\\{}$&#~_]|\^(?!\d)", " ", unit)  # files name units too: text, not LaTeX
    text = re.sub(r"\^(\d+)", r"^{\1}", " ".join(text.split()))
    text = text.replace(" ", r"\;").replace("%", r"\%")
    return rf"\mathrm{{{text}}}" if unit else ""


def lettered(letter: str, name: str, unit: str) -> str:
    r"""Return the meaning of a channel's letter.

    >>> lettered("u", "pressure", "bar")
    'u\\text{: pressure}\\,[\\mathrm{bar}]'
    """
    name = re.sub(r"[\\{}$&#^~%]", " ", name).replace("_", r"\_")
    measure = rf"\,[{unit_tex(unit)}]" if unit else ""
    return rf"{letter}\text{{: {name}}}{measure}"


def with_unit(text: str, unit: str) -> str:
    """Return a number in LaTeX with its unit."""
    return rf"{text}\,{unit_tex(unit)}" if unit else text
