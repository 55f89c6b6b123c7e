"""Units, converted to the package's: bar, mm, N, s, rad, V, mm/s, degC.

The symbols in common use are listed here, with their dimension, and the words for them in `names`;
pint does the conversions and reads all that is not listed. It is imported when something is converted.
"""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any, Literal

from mckibben.arrays import Array
from mckibben.files.names import UNITS, words_of

SPELLINGS: dict[str, dict[str, str]] = {
    "bar": {
        "bar": "bar bars", "mbar": "mbar", "Pa": "Pa", "hPa": "hPa", "kPa": "kPa", "MPa": "MPa",
        "mPa": "mPa", "psi": "psi lbf/in^2 lbf/in2", "atm": "atm"},
    "mm": {"mm": "mm", "cm": "cm", "m": "m", "inch": "in inch", "um": "um"},
    "N": {"N": "N", "kN": "kN", "mN": "mN", "gf": "gf", "kgf": "kgf kp", "lbf": "lbf"},
    "s": {
        "s": "s sec secs", "ms": "ms msec", "us": "us usec", "ns": "ns nsec nanosecond nanoseconds",
        "min": "min", "hour": "h hr hour", "day": "day"},
    "rad": {"rad": "rad", "mrad": "mrad", "deg": "° deg degs", "turn": "rev turn"},
    "V": {"V": "V", "kV": "kV", "mV": "mV"},
    "mm/s": {"mm/s": "mm/s mm_s mmps", "cm/s": "cm/s cm_s", "m/s": "m/s m_s mps"},
    "degC": {"degC": "°C degC C", "K": "K kelvin", "degF": "°F degF fahrenheit"},
    "": {"": "- 1 none dimensionless mm/mm m/m", "percent": "% percent pct"},
    "A": {"A": "A amp amps", "mA": "mA"},
    "Hz": {"Hz": "Hz", "kHz": "kHz"},
    "N*m": {"N*m": "N*m N·m N-m N.m Nm N_m", "mN*m": "mN*m mN·m mNm", "N*mm": "N*mm N·mm Nmm"},
    "rad/s": {
        "rad/s": "rad/s rad_s", "deg/s": "deg/s deg_s °/s dps", "rpm": "rpm r/min rev/min U/min"},
}  # fmt: skip
"""Package unit -> unit as pint calls it -> symbols, separated by blanks; any of them is proposed."""

RARE: dict[str, dict[str, str]] = {
    "bar": {
        "ksi": "ksi", "kgf/cm^2": "kgf/cm^2 kgf/cm2 kg/cm^2 kg/cm2", "torr": "Torr torr",
        "mmHg": "mmHg", "inHg": "inHg", "cmH2O": "cmH2O", "inH2O": "inH2O"},
    "mm": {"nm": "nm nanometer nanometers", "thou": "mil mils thou", "dm": "dm", "km": "km"},
    "N": {"daN": "daN", "cN": "cN"},
}  # fmt: skip
"""The same for units that are understood and never suggested."""

MASSES = {"g": "gf", "kg": "kgf", "lb": "lbf", "lbs": "lbf", "pound": "lbf", "pounds": "lbf"}
"""Unit of mass -> unit of force of that weight."""

COUNTS = frozenset(
    (
        *("count", "counts", "cnt", "cts", "lsb", "lsbs", "tick", "ticks", "digits", "bits"),
        *("px", "pixel", "pixels", "adc", "raw", "pulse", "pulses", "inc", "steps"),
    )
)
"""Units of converter counts and pixels, which are no units of a channel."""

GAUGE = re.compile(
    r"(?P<unit>m?bar|[hkM]?Pa|psi)[\s_(\[]*(?P<kind>gauge|absolute|abs|g|a)[)\]]?", re.IGNORECASE
)
_WORD = r"[A-Za-zΩ°%]+(?:(?:\*\*|\^)?-?[1-3])?"
_READABLE = re.compile(rf"{_WORD}(?:[*/· ]\(?{_WORD}\)?)*")
_POWER = re.compile(r"(?<=[A-Za-z])(?=-?[1-3](?![\d.]))")
_LETTERS = re.compile(r"[^\W\d_]+")
_LOOK_ALIKES = str.maketrans({"º": "°", "µ": "u", "μ": "u", "⋅": "·", "∙": "·", "−": "-"})


@dataclass(frozen=True)
class Unit:
    """A unit by its pint name, and the package's unit of that dimension, or None.

    ``reference`` is what a pressure is measured from, where the unit states it; no offset is ever
    removed.
    """

    name: str
    target: str | None
    reference: Literal["gauge", "absolute"] | None = None


def find_listed(text: str) -> Unit | None:
    """Return the unit of a spelling in `SPELLINGS`, or None; longer ones in any case.

    Not where that would make a thousandth of a million: MN are no mN. Nor where two would be meant:
    NM may be newton metres or nanometres.
    """
    text = _plain(text)
    exact, folded = _lookup()
    if text in exact or len(text) == 1 or (text.startswith("M") and text[1:] in exact):
        return exact.get(text)
    return folded.get(text.casefold())


def find(text: str) -> Unit | None:
    """Return the unit of ``text``, or None if it is not one.

    >>> find("kPa"), find("psig").reference, find("nonsense")
    (Unit(name='kPa', target='bar', reference=None), 'gauge', None)
    """
    text = _plain(text)
    if not text:
        return Unit("", "")
    if text.casefold() in COUNTS:
        return Unit("count", None)
    gauge = GAUGE.fullmatch(text)
    unit = find_listed(text)
    if unit is None and gauge and (unit := find_listed(gauge["unit"])):
        kind = gauge["kind"].casefold()
        return Unit(unit.name, unit.target, "gauge" if kind.startswith("g") else "absolute")
    # pint evaluates numbers, so only products of words with small exponents are handed to it.
    return unit or (_ask_pint(_POWER.sub("^", text)) if _READABLE.fullmatch(text) else None)


def weight(text: str) -> str:
    """Return the unit of weight for a unit of mass; others unchanged.

    >>> weight("kg"), weight("kN")
    ('kgf', 'kN')
    """
    return MASSES.get(_plain(text), text)


def convert(samples: Array, unit: str, target: str) -> Array:
    """Return samples in ``target``; unchanged if it is their unit.

    >>> import numpy as np
    >>> convert(np.array([100.0, 250.0]), "kPa", "bar").tolist()
    [1.0, 2.5]
    """
    if unit == target:
        return samples
    quantity = _registry().Quantity(samples, unit or "dimensionless")
    return quantity.to(target or "dimensionless").magnitude


@cache
def _lookup() -> tuple[dict[str, Unit], dict[str, Unit]]:
    exact = {
        spelling: Unit(name, target)
        for target, names in (*SPELLINGS.items(), *RARE.items())
        for name, spellings in names.items()
        for spelling in spellings.split(" ")
    }
    folded: dict[str, set[Unit]] = {}
    for spelling, unit in exact.items():
        if spelling != "mPa":  # "mpa" in a lower-case header is never the millipascal
            folded.setdefault(spelling.casefold(), set()).add(unit)
    return exact, {word: units.pop() for word, units in folded.items() if len(units) == 1}


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
        # angles are pure numbers to pint, joules torques, and turns in a minute a frequency
        pure = target in ("", "rad", "rad/s", "N*m")
        if pure or (target == "Hz" and "hertz" not in str(unit)):
            continue
        if unit.dimensionality == registry.Unit(target).dimensionality:
            size, base = (registry.Quantity(1.0, each).to_base_units().m for each in (unit, target))
            # RN is a record number, not 1e27 newtons
            return Unit(str(unit), target) if 1e-10 < size / base < 1e10 else None
    return Unit(text, None)


def _plain(text: str) -> str:
    """Replace look-alike characters by one form, and words by symbols.

    >>> _plain("Millimètres"), _plain("milímetros por segundo"), _plain("毫米/秒")
    ('mm', 'mm/s', 'mm/s')
    """
    text = unicodedata.normalize("NFKC", text.replace("º", "°")).translate(_LOOK_ALIKES)
    text = " ".join(text.split()).rstrip(".")
    words = _words()
    unit_word = words.get(text.casefold().replace(" ", "_"))
    text = unit_word or _LETTERS.sub(lambda word: words.get(word[0].casefold(), word[0]), text)
    return re.sub(r" ?([/*·]) ?", r"\1", text)


@cache
def _words() -> dict[str, str]:
    return words_of(UNITS)
