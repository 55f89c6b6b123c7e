"""Signals by name, with settings as on a command line."""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from typing import Any, Literal, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import ArrayLike

from mckibben import registry
from mckibben.arrays import Array
from mckibben.errors import DataError


def settings_of(name: str) -> dict[str, tuple[str, Any]]:
    """Return the settings of a signal: name -> (type, default or None if required).

    Raises
    ------
    ModelError
        If there is no signal of that name; the text lists those there are.

    Examples
    --------
    >>> settings_of("pulls")["n_pulls"]
    ('integer', 3)
    """
    signal = registry.load("signals", name)
    kinds = get_type_hints(signal)
    return {
        setting.name: (
            _words(kinds[setting.name]),
            None if setting.default is inspect.Parameter.empty else setting.default,
        )
        for setting in list(inspect.signature(signal).parameters.values())[1:]
    }


def build(name: str, time: ArrayLike, **settings: Any) -> Array:
    """Return a signal by name.

    Parameters
    ----------
    name : str
        As registered, for instance ``"decaying-triangle"``.
    time : array_like, shape (n,)
        Time [s].
    **settings
        Its settings; numbers may be texts, and sequences words joined by slashes: ``"1/2/3"``.

    Raises
    ------
    ModelError
        On an unknown name.
    DataError
        On an unknown or missing setting, or one that is not what it may be.

    Examples
    --------
    >>> build("staircase", [0.0, 1.0], levels="1/2", hold="1").tolist()
    [1.0, 2.0]
    """
    known = settings_of(name)
    signal = registry.load("signals", name)
    kinds = get_type_hints(signal)
    for setting in settings:
        if setting not in known:
            raise DataError(
                "the signal has no such setting",
                parameter=f"{name}:{setting}",
                remedy=f"use {', '.join(known)}",
            )
    for setting, (words, default) in known.items():
        if default is None and setting not in settings:
            raise DataError(
                "the signal needs this setting",
                parameter=f"{name}:{setting}",
                remedy=f"write for instance {name}:{setting}=..., {words}",
            )
    parsed = {key: _parsed(name, key, value, kinds[key]) for key, value in settings.items()}
    try:
        return np.asarray(signal(time, **parsed), dtype=float)
    except DataError as error:
        if error.parameter is not None:  # which is the signal's, not that of an operation
            error.parameter = f"{name}:{error.parameter}"
        raise


def _words(kind: Any) -> str:
    if get_origin(kind) is Literal:
        return " or ".join(get_args(kind))
    if kind in (int, float):
        return "integer" if kind is int else "number"
    return "numbers joined by /"


def _parsed(name: str, setting: str, value: Any, kind: Any) -> Any:
    try:
        if get_origin(kind) is Literal:
            if value not in get_args(kind):
                raise ValueError
            return value
        if kind is int:
            return int(value)
        if kind is float:
            return float(value)
        if isinstance(value, str):
            return [float(part) for part in value.split("/")]
        return [float(part) for part in value] if isinstance(value, Sequence) else float(value)
    except (TypeError, ValueError):
        raise DataError(
            f"it is {value!r}", parameter=f"{name}:{setting}", remedy=f"give {_words(kind)}"
        ) from None
