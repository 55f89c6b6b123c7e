"""Controls made from the options of operations, whose dataclasses say what each field is."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Any, Literal, get_args, get_origin, get_type_hints

from nicegui import ui

from mckibben.app.terms import GAPS, LABELS
from mckibben.app.widgets import mark
from mckibben.errors import DataError
from mckibben.options import Option, parsed

UNITS = {"S": "[s]", "SECONDS": "[s]", "MM": "[mm]", "HZ": "[Hz]"}
"""Units that metavariables are."""

FIXED: Mapping[str, Iterable[str]] = MappingProxyType({})
"""No choices but those that are declared."""


def fields(
    kind: type,
    names: Iterable[str],
    values: dict[str, Any],
    *,
    choices: Mapping[str, Iterable[str]] = FIXED,
    changed: Callable[[], Any] | None = None,
) -> None:
    """Make controls of some fields of a dataclass, bound to values of their names; see `given`.

    ``choices`` are values to choose from, where the declaration leaves them open, and ``changed`` is
    called when a value is.
    """
    hints, defaults = get_type_hints(kind, include_extras=True), kind()
    for name in names:
        of, option = _option(hints[name])
        default = getattr(defaults, name)
        plain = default is None or isinstance(default, bool | int | float | str)
        values.setdefault(name, default if plain else "")
        label = _label(name, option)
        if of is bool:
            made: Any = ui.switch(LABELS.get(name, option.help.rstrip(".")))
        elif get_origin(of) is Literal:
            labels = GAPS if name == "gaps" else {}
            made = ui.select({one: labels.get(one, one) for one in get_args(of)}, label=label)
        elif name in choices:
            made = ui.select([*choices[name]], label=label).props("clearable")
        elif {int, float} & {of, *get_args(of)} and not option.parse:
            made = ui.number(label)
        else:
            made = ui.input(label, placeholder=option.metavar or None)
        made.bind_value(values, name)
        if changed is not None:
            made.on_value_change(changed).props("debounce=600")
        if of is not bool:
            made.props("dense outlined").classes("option")
        mark(made, f"option-{name}").tooltip(option.help)


def given(kind: type, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return what was filled in, as JSON, without what is empty or as it is by default.

    `DataError` on a text that is not of the form of its option.
    """
    hints, defaults = get_type_hints(kind, include_extras=True), kind()
    found: dict[str, Any] = {}
    for name, value in values.items():
        of, option = _option(hints[name])
        default = getattr(defaults, name)
        plain = get_origin(of) is Literal or (str in {of, *get_args(of)} and not option.parse)
        if isinstance(value, str) and not plain:
            value = _parsed(option, name, value.strip())
        elif isinstance(value, float) and int in {of, *get_args(of)}:
            value = int(value)
        if value not in (None, "", {}, ()) and value != default:
            found[name] = value
    return found


def _option(hint: Any) -> tuple[Any, Option]:
    of, *more = get_args(hint)
    return of, next(one for one in more if isinstance(one, Option))


def _label(name: str, option: Option) -> str:
    """Return the name in words, with its unit."""
    if name in LABELS:
        return LABELS[name]
    unit = re.search(r"\[(s|bar|bar/s|mm or N)\]", option.help)
    known = unit[0] if unit else UNITS.get(option.metavar, "")
    return f"{name.replace('_', ' ').capitalize()} {known}".rstrip()


def _parsed(option: Option, name: str, text: str) -> Any:
    if not text:
        return None
    if option.parse is None:  # two numbers, such as LOW HIGH
        try:
            low, high = map(float, re.split(r"[\s,;:]+", text))
        except ValueError:
            problem = f"{text!r:.40} is not two numbers"
            raise DataError(problem, parameter=name, remedy="write two, such as 0 6") from None
        return low, high
    if option.metavar.count("=") == 1:
        separator = r"\s*;\s*" if " " in option.metavar else r"[\s,;]+"  # a value may have a unit
        return dict(parsed(option, piece, name) for piece in re.split(separator, text))
    return parsed(option, text, name)
