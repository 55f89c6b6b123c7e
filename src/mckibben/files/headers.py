"""Column headers, parsed to a channel and a unit."""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

from mckibben.channels import QUANTITIES
from mckibben.files.names import AMBIGUOUS, CHANNELS, MEASURED, MUSCLES, ROLES, UNITS, words_of
from mckibben.files.units import COUNTS, GAUGE, find, find_listed, weight
from mckibben.recording import base_name, standard_unit

LONGEST_HEADER = 256
"""Longest header that is parsed [characters]."""

_ROLES, _CHANNELS, _UNITS = words_of(ROLES), words_of(CHANNELS), words_of(UNITS)
_MEASURED, _MUSCLES = words_of(MEASURED), words_of(MUSCLES)
_BEFORE = sorted({*_ROLES, *_MUSCLES}, key=len, reverse=True)
_ATTACHED = re.compile("|".join(word for word in _BEFORE if word > "\u3000"))
"""Words that languages without blanks put before the channel: 目標圧力."""
_ABOUT = {"variance", "var", "covariance", "std", "stddev", "status", "valid", "flag", "count"}
"""Words for properties of a channel that do not have its unit: ``pressure_variance``."""
_DOUBTFUL = {"in", "min", "rev", "turn", "second", "grad", "pouce", "tour", "pollice", "segundo"}
"""Endings that are units only where the channel suits: ``pressure_in`` is that of an inlet."""
_LETTERS = {"m", "s", "N", "V"}
"""Single letters that are units after any name but a standard one: ``u1_V``, not ``pressure_A``."""
_AMOUNTS = {"l", "L", "ml", "g", "kg"}
"""What flows in a time, where it is no name: ``flow_l_s``, but ``muscle_l_mm``."""
_REFERENCES = {word: kind for word, kind in _UNITS.items() if kind in ("absolute", "gauge")}
"""What a pressure is measured from, where it is in the name: ``p_abs [bar]``."""

_BRACKETED = re.compile(r"(?P<name>.*?)[\s_,/]*[\[(](?P<unit>[^\[\]()]*(?:\([^()]*\))?)[\])]")
_IN = re.compile(r"(?P<name>.*\S)\s+in\s+(?P<unit>\S+)")  # Kraft in N
_COMPOSITE = re.compile(  # speed mm/s, flow_l/min
    r"(?P<name>.*[^\s_,.:;-])[\s_,.:;-]+(?P<unit>[^\s_,.:;/*·^-]+[/*·^][^\s_,:;]+)"
)
_OVER = re.compile(r"(?P<name>[^/]*[^/\s])\s*/\s*\(?(?P<unit>[^()]*)\)?")  # length/mm
_ENDINGS = (
    re.compile(r"(?P<name>.*[^\s_])[\s_]*(?P<unit>%|°C|°F|°)"),  # contraction_%, angle°
    re.compile(r"(?P<name>.*[^\s_,])[\s_,]+(?P<unit>[^\s_,]+[\s_][^\s_,]+)"),  # p kPa abs, v_mm_s
    re.compile(r"(?P<name>.*[^\s_,.:;-])[\s_,.:;-]+(?P<unit>[^\s_,.:;-]+)"),  # force_N, Druck, bar
)


@dataclass(frozen=True)
class Header:
    """The parts of a header: ``name`` without the unit, and the unit's text or None."""

    name: str
    unit: str | None


@lru_cache(maxsize=8192)
def parse(text: str) -> Header:
    """Split a header into name and unit.

    >>> parse("Pressure (kPa)"), parse("length/mm")
    (Header(name='Pressure', unit='kPa'), Header(name='length', unit='mm'))
    >>> parse("valve_voltage_V"), parse("pressure_in")
    (Header(name='valve_voltage', unit='V'), Header(name='pressure_in', unit=None))
    >>> parse("/pam/pressure_bar/data")
    Header(name='pam pressure', unit='bar')
    >>> parse("current (2)")
    Header(name='current 2', unit=None)
    """
    text = " ".join(_plain(text).split())
    if len(text) > LONGEST_HEADER:  # the forms below take time by the square of the length
        return Header(text, None)
    if text.startswith("/"):  # a topic of ROS, whose last word but these has the unit
        *path, last = [word for word in text.split("/") if word not in ("", "data", "value")] or [
            ""
        ]
        inner = parse(last)
        return Header(" ".join([*path, inner.name]), inner.unit)
    bracketed = _BRACKETED.fullmatch(text)
    if bracketed and bracketed["name"] and _MUSCLES.keys().isdisjoint(_words(bracketed["unit"])):
        name, unit = bracketed["name"], bracketed["unit"].strip()
        if GAUGE.fullmatch(f"{_last(name)} {unit}"):  # Pressure kPa(a)
            return Header(name.removesuffix(_last(name)).rstrip(" _,"), f"{_last(name)} {unit}")
        if unit.isdecimal() and not (unit == "1" and _expected(name) == ""):  # but contraction [1]
            inner = parse(name)  # the second of several alike: pos (2)
            return Header(f"{inner.name} {unit}", inner.unit)
        return Header(name, _referred(unit, name))
    over = _OVER.fullmatch(text)
    reading = over and _names(_last(over["name"]), over["unit"])
    for form in (_IN, _OVER if reading else _COMPOSITE, _OVER, *_ENDINGS):
        match = form.fullmatch(text)
        if match is None:
            continue
        name, unit = match["name"], match["unit"].strip()
        if _is_unit(unit, name) if form in _ENDINGS else find(unit) is not None:
            stroke = form is _OVER
            if (stroke or form in _ENDINGS) and _is_part(name, unit, stroke=stroke):
                break
            return Header(name, _referred(unit, name))
    return Header(text, None)


def channel_of(header: Header) -> str:
    """Return the channel of a header: a standard one, or its name in lower snake case.

    >>> channel_of(parse("P1 [bar]")), channel_of(parse("u1_V")), channel_of(parse("f [Hz]"))
    ('pressure_1', 'u1', 'f')
    """
    name = snake_case(header.name)
    unit = None if header.unit is None else find(header.unit)
    if unit is not None and unit.reference is not None:
        words = [word for word in _words(name) if _REFERENCES.get(word) != unit.reference]
        name = "_".join(words) or name
    standard = _standard(name)
    word, number = _numbered(name)
    if word in AMBIGUOUS and unit is not None and unit.target in QUANTITIES:
        return QUANTITIES[unit.target] + (f"_{number}" if number else "")
    if standard is None:
        stem, _, about = name.rpartition("_")
        plain = f"{about}_of_{stem}" if unit_of(name) is not None and about in _ABOUT else name
        return _of_loop(name, header) or plain
    base = base_name(standard)
    if unit is None or unit.target == _expected(base):
        return standard
    if base == "contraction" and unit.target == "mm":
        return standard.replace("contraction", "displacement")
    # The unit decides about names that can mean other things: "f [Hz]" is no force, "load [kg]" is
    # no newtons. A plain "pressure [mm]" stays a pressure, and is refused later.
    return standard if name.startswith(base) else name


def _of_loop(name: str, header: Header) -> str | None:
    """Return the channel of a loop's reference or command, or None: a desired pressure is a command."""
    words = _apart(name.replace("set_point", "setpoint"))
    roles = [_ROLES[word] for word in words if word in _ROLES]
    if len(roles) != 1:
        return None
    role, rest = roles[0], "_".join(word for word in words if word not in _ROLES)
    unit = None if header.unit is None else find(header.unit)
    if _standard(rest):
        channel = channel_of(Header(rest, header.unit))
    elif unit is not None and not (len(rest) == 1 and rest.isalpha()):  # a letter names an axis
        channel = QUANTITIES.get(unit.target or "", "")
    elif not rest or rest.isdigit():
        channel = "pressure" if role == "command" else "displacement"
    else:
        return None
    channel = f"{channel}_{rest}" if channel and rest.isdigit() else channel
    if unit_of(channel) is None:
        return None
    return f"{'command' if channel.startswith(('pressure', 'voltage')) else role}_{channel}"


def by_words(units: Mapping[str, str]) -> dict[str, str]:
    """Return channels by a word in longer names, where it is the only one and the unit is its.

    Several that are numbered are the channels of these numbers.

    >>> by_words({"zylinderdruck": "bar", "loadcell_force_z": "N", "motor_temp": "A"})
    {'zylinderdruck': 'pressure', 'loadcell_force_z': 'force'}
    >>> by_words({"pam1_pressure": "bar", "pam2_pressure": "bar", "관절각도": "rad"})
    {'pam1_pressure': 'pressure_1', 'pam2_pressure': 'pressure_2', '관절각도': 'angle'}
    >>> by_words({"p_ist": "bar", "p_soll": "bar"})
    {'p_ist': 'pressure'}
    """
    candidates: dict[str, list[str]] = {}
    for name, unit in units.items():
        words = name.split("_")
        words_left = "_".join(word for word in words if word not in _MEASURED)
        plain = _standard(words_left) if words_left != name else None
        meant = {plain} if plain else {*filter(None, map(_in_word, words))}
        has_role = {*_ABOUT, *_ROLES, *_REFERENCES} & {*words}
        if unit_of(name) is None and len(meant) == 1 and not has_role:
            (channel,) = meant
            if unit == unit_of(channel) and channel not in units:
                candidates.setdefault(channel, []).append(name)
    renamed = {}
    for channel, names in candidates.items():
        numbers = [re.findall(r"\d+", name)[-1:] for name in names]
        several = ["_".join([channel, *number]) for number in numbers]
        if len(names) == 1:
            renamed[names[0]] = channel
        elif all(numbers) and len(set(several)) == len(names):
            renamed |= dict(zip(names, several, strict=True))
    return renamed


def names_channel(name: str) -> bool:
    """Return whether a word of a name, which no standard channel has, names one."""
    words = {*name.split("_")}
    return not words & {*_ABOUT} and any(map(_in_word, words))


def _in_word(word: str) -> str | None:
    """Return the channel that a word names, alone or at its end, as in Zylinderdruck and 관절각도."""
    word = word.rstrip("0123456789")
    ends = (word[at:] for at in range(len(word)))
    spelt = (end for end in ends if end in _CHANNELS and (len(end) >= 4 or not end.isascii()))
    channel = _CHANNELS.get(next(spelt, ""))
    return None if channel == "time" else channel


def by_units(units: Mapping[str, str]) -> dict[str, str]:
    """Return channels by units for columns named u1, output or similar."""
    result = {}
    for name, unit in units.items():
        unnamed = re.fullmatch(r"(?:[a-z]|in|out|input|output|column)(?:_?(\d+))?", name)
        if unnamed and unit in QUANTITIES:
            alone = len(name) > 2 and [*units.values()].count(unit) == 1
            result[name] = QUANTITIES[unit] + (f"_{unnamed[1]}" if unnamed[1] and not alone else "")
    names = Counter(result.get(name, name) for name in units)
    return {name: new for name, new in result.items() if names[new] == 1}


def unit_of(channel: str) -> str | None:
    """Return the package's unit of a standard channel or of time, or None for other channels."""
    return "s" if channel == "time" else standard_unit(channel)


def is_standard(text: str) -> bool:
    """Return whether a header names a standard channel or the time.

    >>> is_standard("Pressure (kPa)"), is_standard("t_s"), is_standard("status")
    (True, True, False)
    """
    return unit_of(channel_of(parse(text))) is not None


def is_time(text: str) -> bool:
    """Return whether a header names times, perhaps one of several.

    >>> is_time("Time 2 (s)"), is_time("time.1"), is_time("T2 [°C]")
    (True, True, False)
    """
    header = parse(text)
    unit = None if header.unit is None else find(header.unit)
    timed = header.unit is None or (unit is not None and unit.target == "s")
    return timed and _CHANNELS.get(re.sub(r"_?\d+$", "", snake_case(header.name))) == "time"


def time_unit(text: str) -> str | None:
    """Return the unit of time that is a whole header; None if it is none, or one letter.

    >>> time_unit("sec"), time_unit("s"), time_unit("mm")
    ('sec', None, None)
    """
    unit = find_listed(text)
    return text if len(text) > 1 and unit is not None and unit.target == "s" else None


def snake_case(name: str) -> str:
    """Return a name in lower snake case.

    >>> snake_case("Valve Voltage"), snake_case("TipPosition-2")
    ('valve_voltage', 'tip_position_2')
    """
    return "_".join(_words(re.sub(r"(?<=[a-z])(?=[A-Z])", " ", _plain(name))))


def foreign_words(text: str) -> int:
    """Return the number of non-ASCII letters in known words and units, to rate an encoding.

    >>> foreign_words("Länge (µm)"), foreign_words("Lضnge (╡m)")
    (6, 0)
    """
    text = _plain(text).casefold()
    vocabulary = (*_CHANNELS, *_ROLES, *_UNITS, "°", "μ")
    words = {word for word in vocabulary if not word.isascii()}
    return sum(text.count(word) * len(word) for word in words)


def unknown_ending(text: str) -> str:
    """Return the first word after a channel's name that may be an unknown unit; empty if none.

    >>> unknown_ending("pressure_qux"), unknown_ending("Inlet pressure 2"), unknown_ending("data")
    ('qux', '', '')
    """
    vocabulary = {part for word in (*_CHANNELS, *_ROLES) for part in word.split("_")} | {*_MUSCLES}
    words = re.findall(r"[^\W\d_]+", snake_case(text.rpartition("/")[2]))  # not of a topic
    n_known = next((k for k, word in enumerate(words) if word in vocabulary), len(words))
    return next((word for word in words[n_known:] if word not in vocabulary), "")


def _plain(text: str) -> str:
    """Return text with Unicode variants replaced by one character each."""
    return text if text.isascii() else unicodedata.normalize("NFKC", text.replace("º", "°"))


def _words(text: str) -> list[str]:
    return [word for word in re.split(r"[\W_]+", text.casefold()) if word]


def _apart(name: str) -> list[str]:
    """Return the words of a name, also of those that languages without blanks write as one."""
    return [word for word in _ATTACHED.sub(r"_\g<0>_", name).split("_") if word]


def _standard(name: str) -> str | None:
    words = _apart(name)
    places = {_MUSCLES[word] for word in words if word in _MUSCLES}
    stem = "_".join(word for word in words if word not in _MUSCLES)
    pressure, number = _numbered(stem)
    if len(places) == 1 and _CHANNELS.get(pressure) == "pressure":
        return "_".join(["pressure", *places, *filter(None, [number.lstrip("0")])])
    alias, number = _numbered(name)
    if name in _CHANNELS or not number:
        return _CHANNELS.get(name)
    channel = _CHANNELS.get(alias, "time")
    several = len(alias) > 1 or alias == "p" or not alias.isascii()
    return f"{channel}_{number}" if several and channel != "time" else None


def _numbered(name: str) -> tuple[str, str]:
    """Return a name without its number, and that."""
    return re.sub(r"_?\d+$", "", name), re.sub(r".*\D", "", name)


def _expected(name: str) -> str | None:
    """Return the package's unit of a header's channel, or None."""
    return unit_of(_standard(snake_case(name)) or snake_case(name))


def _is_unit(text: str, name: str) -> bool:
    """Return whether the ending of a header is a unit and not part of the name."""
    if text in ("-", "1", "none"):
        return False
    unit = find_listed(text) or (find(text) if GAUGE.fullmatch(text) else None)
    expected = _expected(name)
    if unit is None and (text.casefold() in COUNTS or text.casefold() == "nm"):
        return expected is not None  # which the unit is has to be asked, instead of the usual one
    if unit is None:  # load_kg, force_n, valve_voltage_v
        capital = find_listed(text.upper()) if len(text) == 1 else None
        fits = capital is not None and capital.target == expected
        return fits or (expected == "N" and weight(text) != text)
    if unit.target == expected or (expected == "" and unit.target == "mm"):
        return True
    return not _is_doubtful(text) and (expected is None or text not in _LETTERS)


def _is_doubtful(text: str) -> bool:
    """Return whether a unit word may also be part of a name."""
    letter = len(text) == 1 and text.isalpha() and text not in _LETTERS
    return letter or text.casefold() in _DOUBTFUL


def _referred(unit: str, name: str) -> str:
    """Return a unit with the pressure reference of the name."""
    references = [f"{unit} {word}" for word in _words(name) if word in _REFERENCES]
    return references[0] if references and getattr(find(references[0]), "reference", None) else unit


def _last(name: str) -> str:
    return re.split(r"[\s_,.:;-]+", name)[-1]


def _names(word: str, unit: str) -> bool:
    """Return whether a word is a quantity with a unit: the l of ``muscle_l/mm`` is not a litre."""
    channel, found = _CHANNELS.get(word.casefold()), find(unit)
    if found is not None and word.casefold() in _DOUBTFUL:  # pressure_in/bar, but speed_in/s
        return found.target != "s"
    return channel is not None and found is not None and unit_of(channel) == found.target


def _is_part(name: str, unit: str, *, stroke: bool) -> bool:
    """Return whether the last word of a name belongs to the unit after it, or after a slash.

    As in ``flow_Nl/min``, ``rate_1/s``, ``stiffness_N_mm`` and ``q_deg_per_s``.
    """
    word, found = _last(name), find(unit)
    if word == name or _names(word, unit):
        return False
    amount = len(word) <= 4 or word.isdigit() if stroke else word in _AMOUNTS
    timed = found is not None and found.target == "s"
    symbol = None if _is_doubtful(word) else find_listed(word)
    return word == "per" or (timed and amount) or bool(symbol and symbol.target)
