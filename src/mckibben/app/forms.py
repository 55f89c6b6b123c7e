"""Controls made from the options of operations, whose dataclasses say what each field is."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Literal, get_args, get_origin, get_type_hints

from nicegui import ui

from mckibben.app.widgets import mark
from mckibben.errors import DataError
from mckibben.options import Option, parsed


def fields(
    kind: type,
    names: Iterable[str],
    values: dict[str, Any],
    changed: Callable[[], Any] | None = None,
) -> None:
    """Make a control for each of some options, bound to a value of its name.

    Parameters
    ----------
    kind : type
        Dataclass of `mckibben.options`.
    names : iterable of str
    values : dict
        Values by name, which the controls read and set; see `given`.
    changed : callable, optional
        Called after every change.
    """
    hints = get_type_hints(kind, include_extras=True)
    defaults = kind()
    for name in names:
        of, option = _option(hints[name])
        default = getattr(defaults, name)
        plain = default is None or isinstance(default, bool | int | float | str)
        values.setdefault(name, default if plain else "")
        label = _label(name, of, option)
        if of is bool:
            made: Any = ui.switch(label).bind_value(values, name)
        elif get_origin(of) is Literal:
            made = ui.select([*get_args(of)], label=label).bind_value(values, name)
        elif (
            {int, float} & {of, *get_args(of)} and get_origin(of) is not tuple and not option.parse
        ):
            made = ui.number(label).bind_value(values, name)
        else:
            made = ui.input(label, placeholder=option.metavar or None).bind_value(values, name)
        if of is not bool:
            made.props("dense outlined").classes("option")
        if changed is not None:
            made.on_value_change(lambda _: changed())
        mark(made, f"option-{name}").tooltip(option.help)


def given(kind: type, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return what was filled in, as JSON, without what is empty or as it is by default.

    Raises
    ------
    DataError
        On a text that is not of the form of its option.
    """
    hints, defaults = get_type_hints(kind, include_extras=True), kind()
    found: dict[str, Any] = {}
    for name, value in values.items():
        of, option = _option(hints[name])
        default = getattr(defaults, name)
        if isinstance(value, str) and not isinstance(default, str):
            value = _parsed(of, option, name, value.strip())
        elif isinstance(value, float) and int in {of, *get_args(of)}:
            value = int(value)
        if value not in (None, "", {}, ()) and value != default:
            found[name] = value
    return found


def _option(hint: Any) -> tuple[Any, Option]:
    of, *more = get_args(hint)
    return of, next(one for one in more if isinstance(one, Option))


def _label(name: str, of: Any, option: Option) -> str:
    """Return the name in words with its unit, or of a switch its help."""
    if of is bool:
        return option.help.rstrip(".")
    unit = re.search(r"\[(s|bar|bar/s|mm or N)\]", option.help)
    known = unit[0] if unit else "[s]" * (option.metavar in ("S", "SECONDS"))
    return f"{name.replace('_', ' ').capitalize()} {known}".rstrip()


def _parsed(of: Any, option: Option, name: str, text: str) -> Any:
    if not text:
        return None
    kind = next((one for one in (of, *get_args(of)) if get_origin(one) in (tuple, Mapping)), None)
    if get_origin(kind) is tuple and option.parse is None:
        try:
            low, high = (float(word) for word in re.split(r"[\s:,]+", text))
        except ValueError:
            problem = f"{text!r:.40} is not two numbers"
            raise DataError(problem, parameter=name, remedy="write two, such as 0 6") from None
        return low, high
    pieces = [parsed(option, piece, name) for piece in re.split(r"[\s,;]+", text)]
    if all(isinstance(piece, tuple) for piece in pieces) and option.metavar.count("=") == 1:
        return dict(pieces)
    return parsed(option, text, name)
