"""Settings of estimators, validated against their declarations."""

from __future__ import annotations

import json
import math
from dataclasses import MISSING, dataclass, fields
from types import NoneType
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

import numpy as np
from pydantic import ConfigDict, TypeAdapter, ValidationError

from mckibben.blocks.notation import meanings
from mckibben.errors import ModelError

STRICT_SETTINGS = ConfigDict(strict=True, allow_inf_nan=False)


Kind = Literal["choice", "flag", "whole", "number", "text"]

LARGE = 2**31
"""Limits with a larger magnitude are not shown in messages."""


@dataclass(frozen=True)
class Setting:
    """A setting of an estimator, as shown in a form.

    Parameters
    ----------
    name : str
    default : object
    meaning : str
        What it is.
    kind : {"choice", "flag", "whole", "number", "text"}
        What may be given; text is read by `setting_value`.
    choices : tuple
        Of a choice, all that may be chosen.
    low, high : float
        The least and the greatest number; infinite where there is none.
    optional : bool
        Whether it may be none.
    """

    name: str
    default: Any
    meaning: str
    kind: Kind
    choices: tuple[Any, ...] = ()
    low: float = -math.inf
    high: float = math.inf
    optional: bool = False


def settings_with_defaults(estimator: Any) -> list[Setting]:
    """Return the settings with defaults of an estimator, or of a preset."""
    cls = getattr(estimator, "of", estimator)
    hints, said = get_type_hints(cls, include_extras=True), meanings(cls)
    return [
        Setting(one.name, one.default, said.get(one.name, ""), **_kind(hints[one.name]))
        for one in fields(estimator)
        if one.default is not MISSING
    ]


def _kind(hint: Any) -> dict[str, Any]:
    """Return kind, choices and limits that a type allows."""
    parts = get_args(hint)
    if get_origin(hint) is Annotated:
        found = _kind(parts[0])
        for limit in parts[1:]:
            for word, end in (("ge", "low"), ("gt", "low"), ("le", "high"), ("lt", "high")):
                value = getattr(limit, word, None)
                if value is not None and abs(value) < LARGE:
                    found[end] = float(value)
        return found
    if get_origin(hint) is Literal:
        return {"kind": "choice", "choices": parts}
    if hint in _PLAIN:
        return {"kind": _PLAIN[hint]}
    others = [part for part in parts if part is not NoneType]
    if len(others) < len(parts) and len(others) == 1:
        return _kind(others[0]) | {"optional": True}
    return {"kind": "text"}


_PLAIN: dict[Any, Kind] = {int: "whole", float: "number", bool: "flag"}


def setting_value(text: str) -> Any:
    """Return a setting from text: JSON if it is valid, otherwise ``none`` or a word."""
    try:
        value = json.loads(text)
    except (ValueError, RecursionError):
        value = None if text.lower() == "none" else text
    return tuple(value) if isinstance(value, list) else value


def check_settings(estimator: Any) -> None:
    """Raise an error for settings that violate their declarations.

    Raises
    ------
    ModelError
        Naming the setting, what it is, and what it may be.
    """
    hints = get_type_hints(type(estimator), include_extras=True)
    for setting in fields(estimator):
        given = getattr(estimator, setting.name)
        value = given.tolist() if isinstance(given, np.generic | np.ndarray) else given
        try:
            TypeAdapter(hints[setting.name], config=STRICT_SETTINGS).validate_python(value)
        except ValidationError as error:
            wanted = error.errors()[0]["msg"]
            raise ModelError(
                f"it is {value!r}: {wanted[0].lower()}{wanted[1:]}",
                parameter=setting.name,
                remedy="give another, or leave it out",
            ) from None
