"""Settings of estimators, validated against their declarations."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, get_type_hints

import numpy as np
from pydantic import ConfigDict, TypeAdapter, ValidationError

from mckibben.errors import ModelError

STRICT_SETTINGS = ConfigDict(strict=True, allow_inf_nan=False)


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
