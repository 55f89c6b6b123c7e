"""Controls made from the options of operations, whose dataclasses say what each field is."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any, Literal, get_args, get_origin, get_type_hints

from nicegui import ui

from mckibben.app.widgets import mark
from mckibben.errors import DataError
from mckibben.options import Option, parsed


def fields(kind: type, names: Iterable[str], values: dict[str, Any]) -> None:
    """Make controls of some fields of a dataclass, bound to values of their names; see `given`."""
    hints, defaults = get_type_hints(kind, include_extras=True), kind()
    for name in names:
        of, option = _option(hints[name])
        default = getattr(defaults, name)
        plain = default is None or isinstance(default, bool | int | float | str)
        values.setdefault(name, default if plain else "")
        label = _label(name, option)
        if of is bool:
            made: Any = ui.switch(option.help.rstrip("."))
        elif get_origin(of) is Literal:
            made = ui.select(list(get_args(of)), label=label)
        elif {int, float} & {of, *get_args(of)} and not option.parse:
            made = ui.number(label)
        else:
            made = ui.input(label, placeholder=option.metavar or None)
        made.bind_value(values, name)
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
    unit = re.search(r"\[(s|bar|bar/s|mm or N)\]", option.help)
    known = unit[0] if unit else "[s]" * (option.metavar in ("S", "SECONDS"))
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
        return dict(parsed(option, piece, name) for piece in re.split(r"[\s,;]+", text))
    return parsed(option, text, name)
