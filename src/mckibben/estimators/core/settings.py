"""Settings of estimators, checked against how they are declared."""

from __future__ import annotations

import json
from dataclasses import fields
from typing import Any, get_type_hints

import numpy as np
from pydantic import ConfigDict, TypeAdapter, ValidationError

from mckibben.errors import ModelError

STRICT_SETTINGS = ConfigDict(strict=True, allow_inf_nan=False)


def setting_value(text: str) -> Any:
    """Return a setting that was written as text: JSON where it is that, else ``none`` or a word."""
    try:
        value = json.loads(text)
    except (ValueError, RecursionError):
        value = None if text.lower() == "none" else text
    return tuple(value) if isinstance(value, list) else value


def check_settings(estimator: Any) -> None:
    """Refuse settings that are not as they are declared.

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
                f"{setting.name} is {value!r}: {wanted[0].lower()}{wanted[1:]}. "
                f"Remedy: choose {setting.name} accordingly, or leave it out."
            ) from None
