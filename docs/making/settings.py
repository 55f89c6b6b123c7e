"""Settings of an estimator, with their allowed values."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

from making.pages import plain, table
from mckibben.blocks.notation import meanings

WORDS = {
    int: "whole number",
    float: "number",
    bool: "true or false",
    str: "name",
    type(None): "none",
}


def allowed(hint: Any) -> str:
    """Return the allowed values of a setting, in words."""
    if get_origin(hint) is Annotated:
        of, *limits = get_args(hint)
        return " ".join(
            filter(None, (allowed(of), " and ".join(filter(None, map(limited, limits)))))
        )
    if get_origin(hint) is Literal:
        return ", ".join(f"`{value}`" for value in get_args(hint))
    if hint in WORDS:
        return WORDS[hint]
    if get_origin(hint) is tuple:
        inner = [one for one in get_args(hint) if one is not Ellipsis]
        return "several of: " + "; ".join(dict.fromkeys(map(allowed, inner)))
    if get_args(hint):
        return ", or ".join(dict.fromkeys(allowed(one) for one in get_args(hint)))
    return f"`{getattr(hint, '__name__', hint)}`"


def limited(limit: Any) -> str:
    """Return a limit of a number, in words."""
    words = {"ge": "from {}", "gt": "above {}", "le": "to {}", "lt": "below {}"}
    found = [
        text.format(f"{value:g}" if isinstance(value, float) else value)
        for name, text in words.items()
        if (value := getattr(limit, name, None)) is not None
        and abs(value) < 2**40
        and math.isfinite(value)
    ]
    return " ".join(found)


def settings_table(estimator: type[Any]) -> list[str]:
    """Return the settings of an estimator: default, allowed values, meaning."""
    hints, said = get_type_hints(estimator, include_extras=True), meanings(estimator)
    usual = estimator()
    rows = [
        [
            f"`{one.name}`",
            f"`{getattr(usual, one.name)}`",
            allowed(hints[one.name]),
            plain(said.get(one.name, "")),
        ]
        for one in fields(estimator)
    ]
    return table(["setting", "default", "allowed values", "meaning"], rows)
