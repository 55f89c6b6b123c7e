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

NO_CHOICES: Mapping[str, Iterable[str]] = MappingProxyType({})
"""No choices but those that are declared."""


def fields(
    kind: type,
    names: Iterable[str],
    values: dict[str, Any],
    *,
    choices: Mapping[str, Iterable[str]] = NO_CHOICES,
    changed: Callable[[], Any] | None = None,
) -> None:
    """Make controls of some fields of a dataclass, bound to values of their names; see `given`.

    ``choices`` are values to choose from, where the declaration leaves them open, and ``changed`` is
    called when a value is.
    """
    hints, defaults = get_type_hints(kind, include_extras=True), kind()
    for name in names:
        value_type, option = _option(hints[name])
        default = getattr(defaults, name)
        is_simple = default is None or isinstance(default, bool | int | float | str)
        values.setdefault(name, default if is_simple else "")
        label = _label(name, option)
        if value_type is bool:
            control: Any = ui.switch(LABELS.get(name, option.help.rstrip(".")))
        elif get_origin(value_type) is Literal:
            labels = GAPS if name == "gaps" else {}
            control = ui.select(
                {choice: labels.get(choice, choice) for choice in get_args(value_type)}, label=label
            )
        elif name in choices:
            control = ui.select([*choices[name]], label=label).props("clearable")
        elif {int, float} & {value_type, *get_args(value_type)} and not option.parse:
            control = ui.number(label)
        else:
            control = ui.input(label, placeholder=option.metavar or None)
        control.bind_value(values, name)
        if changed is not None:
            control.on_value_change(changed).props("debounce=600")
        if value_type is not bool:
            control.props("dense outlined").classes("option")
        mark(control, f"option-{name}").tooltip(option.help)


def given(kind: type, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return what was filled in, as JSON, without what is empty or as it is by default.

    `DataError` on a text that is not of the form of its option.
    """
    hints, defaults = get_type_hints(kind, include_extras=True), kind()
    settings: dict[str, Any] = {}
    for name, value in values.items():
        value_type, option = _option(hints[name])
        default = getattr(defaults, name)
        is_text = get_origin(value_type) is Literal or (
            str in {value_type, *get_args(value_type)} and not option.parse
        )
        if isinstance(value, str) and not is_text:
            value = _parsed(option, name, value.strip())
        elif isinstance(value, float) and int in {value_type, *get_args(value_type)}:
            value = int(value)
        if value not in (None, "", {}, ()) and value != default:
            settings[name] = value
    return settings


def _option(hint: Any) -> tuple[Any, Option]:
    value_type, *metadata = get_args(hint)
    return value_type, next(entry for entry in metadata if isinstance(entry, Option))


def _label(name: str, option: Option) -> str:
    """Return the name in words, with its unit."""
    if name in LABELS:
        return LABELS[name]
    unit = re.search(r"\[(s|bar|bar/s|mm or N)\]", option.help)
    unit_text = unit[0] if unit else UNITS.get(option.metavar, "")
    return f"{name.replace('_', ' ').capitalize()} {unit_text}".rstrip()


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
