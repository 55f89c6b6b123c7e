"""Units as people write them, converted to the package's: bar, mm, N, s, rad, V, mm/s, degC.

The spellings in common use are listed here, with their dimension; pint does the conversions and
reads everything that is not listed. It is only imported when there is something to convert.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any, Literal

from mckibben.arrays import Array

SPELLINGS: dict[str, dict[str, str]] = {
    "bar": {
        "bar": "bar bars",
        "mbar": "mbar",
        "Pa": "Pa",
        "hPa": "hPa",
        "kPa": "kPa",
        "MPa": "MPa",
        "mPa": "mPa",
        "psi": "psi lbf/in^2",
        "atm": "atm",
    },
    "mm": {
        "mm": "mm millimeter millimeters millimetre millimetres",
        "cm": "cm",
        "m": "m meter meters metre metres",
        "um": "um micron microns",
        "inch": "in inch inches",
    },
    "N": {
        "N": "N newton newtons",
        "kN": "kN",
        "mN": "mN",
        "gf": "gf",
        "kgf": "kgf kp",
        "lbf": "lbf",
    },
    "s": {
        "s": "s sec secs second seconds",
        "ms": "ms msec millisecond milliseconds",
        "us": "us usec microsecond microseconds",
        "ns": "ns nsec nanosecond nanoseconds",
        "min": "min minute minutes",
        "hour": "h hr hour hours",
        "day": "day days",
    },
    "rad": {
        "rad": "rad radian radians",
        "mrad": "mrad",
        "deg": "° deg degs degree degrees",
        "turn": "rev revolution revolutions turn turns",
    },
    "V": {"V": "V volt volts", "mV": "mV"},
    "mm/s": {
        "mm/s": "mm/s mm_s mmps",
        "cm/s": "cm/s cm_s",
        "m/s": "m/s m_s mps",
    },
    "degC": {"degC": "°C degC C celsius", "K": "K kelvin", "degF": "°F degF fahrenheit"},
    "": {"": "- 1 none dimensionless mm/mm m/m", "percent": "% percent pct"},
    "A": {"A": "A amp amps ampere", "mA": "mA"},
    "Hz": {"Hz": "Hz", "kHz": "kHz"},
}
"""Package unit -> unit as pint calls it -> spellings, separated by blanks."""

MASSES = {
    "gf": ("g", "gram", "grams"),
    "kgf": ("kg", "kilogram", "kilograms"),
    "lbf": ("lb", "lbs", "pound", "pounds"),
}
"""Unit of force -> those of the mass that hangs with it."""

_GAUGE = re.compile(
    r"(?P<unit>m?bar|[hkM]?Pa|psi)[\s_(\[]*(?P<kind>gauge|absolute|abs|g|a)[)\]]?", re.IGNORECASE
)
_WORD = r"[A-Za-zΩ°%]+(?:(?:\*\*|\^)?-?[1-3])?"
_READABLE = re.compile(rf"{_WORD}(?:[*/· ]\(?{_WORD}\)?)*")

LONGEST = 40
"""Characters of a unit; what is longer is none."""


@dataclass(frozen=True)
class Unit:
    """A unit: its name for pint, and the package's unit of the same dimension.

    Parameters
    ----------
    name : str
        As pint reads it.
    target : str or None
        The package's unit of that dimension; None where the package has none, so that the samples
        are kept as they are.
    reference : {"gauge", "absolute"} or None
        What a pressure is measured from, where the unit said so; no offset is ever removed.
    """

    name: str
    target: str | None
    reference: Literal["gauge", "absolute"] | None = None


def find_listed(text: str) -> Unit | None:
    """Return the unit of a spelling in `SPELLINGS`, or None; longer ones in any case.

    Not where that would make a thousandth of a million: MN are no mN.
    """
    text = text.strip()
    if len(text) > LONGEST:
        return None
    text = _plain(text)
    exact, folded = _lookup()
    found = exact.get(text)
    if found is not None or len(text) == 1 or (text.startswith("M") and text[1:] in exact):
        return found
    return folded.get(text.casefold())


def find(text: str) -> Unit | None:
    """Return the unit that ``text`` means, or None if it means none.

    >>> find("kPa"), find("psig").reference, find("nonsense")
    (Unit(name='kPa', target='bar', reference=None), 'gauge', None)
    """
    text = text.strip()
    if len(text) > LONGEST:
        return None
    text = _plain(text)
    if not text:
        return Unit("", "")
    listed = find_listed(text)
    if listed is not None:
        return listed
    gauge = _GAUGE.fullmatch(text)
    if gauge:
        unit = find_listed(gauge["unit"])
        if unit is not None:
            kind = "gauge" if gauge["kind"].casefold().startswith("g") else "absolute"
            return Unit(unit.name, unit.target, "gauge" if kind == "gauge" else "absolute")
    # pint evaluates numbers, so only products of words with small exponents are handed to it.
    return _ask_pint(text) if _READABLE.fullmatch(text) else None


def weight(text: str) -> str:
    """Return the unit of the force by which a mass hangs for that of a mass; others as they are.

    >>> weight("kg"), weight("kN")
    ('kgf', 'kN')
    """
    return next((force for force, mass in MASSES.items() if text.strip() in mass), text)


def convert(samples: Array, unit: str, target: str) -> Array:
    """Return samples in ``target``; untouched where it is the unit that they have.

    >>> import numpy as np
    >>> convert(np.array([100.0, 250.0]), "kPa", "bar").tolist()
    [1.0, 2.5]
    """
    if unit == target:
        return samples
    quantity = _registry().Quantity(samples, unit or "dimensionless")
    converted: Array = quantity.to(target or "dimensionless").magnitude
    return converted


@cache
def _lookup() -> tuple[dict[str, Unit], dict[str, Unit]]:
    exact = {
        spelling: Unit(name, target)
        for target, names in SPELLINGS.items()
        for name, spellings in names.items()
        for spelling in spellings.split(" ")
    }
    folded: dict[str, Unit] = {}
    for spelling, unit in exact.items():
        if spelling != "mPa":  # "mpa" in a lower-case header is never the millipascal
            folded[spelling.casefold()] = unit
    return exact, folded


@cache
def _registry() -> Any:
    import pint

    return pint.UnitRegistry()


@lru_cache(maxsize=4096)
def _ask_pint(text: str) -> Unit | None:
    registry = _registry()
    try:
        unit = registry.Unit(text)
    except Exception:  # pint raises a dozen types at what it cannot read, AssertionError among them
        return None
    parts = [name for name, _ in registry.Quantity(1.0, unit).unit_items()]
    if any(registry.Unit(name).dimensionless for name in parts):  # mm/deg is no length
        return Unit(text, None)
    for target in SPELLINGS:
        if target == "Hz" and "hertz" not in str(unit):  # turns in a minute are no frequency
            continue
        if target in ("", "rad"):  # pint takes angles for pure numbers; those in use are listed
            continue
        if unit.dimensionality == registry.Unit(target).dimensionality:
            return Unit(str(unit), target)
    return Unit(text, None)


def _plain(text: str) -> str:
    """Write the look-alikes of one sign in one way."""
    for looks, is_ in (("µ", "u"), ("μ", "u"), ("º", "°"), ("℃", "°C"), ("℉", "°F")):
        text = text.replace(looks, is_)
    return re.sub(r" ?([/*·]) ?", r"\1", " ".join(text.split()))
