"""What makes classes refuse bad fields, and numbers beyond all sense, in words of their own."""

from __future__ import annotations

from abc import ABCMeta
from collections.abc import Callable
from dataclasses import fields
from functools import wraps
from inspect import isfunction
from typing import Any, TypeVar

import numpy as np
from pydantic import ValidationError

from mckibben.errors import ModelError

Made = TypeVar("Made")

UNCOMPUTABLE = (ArithmeticError, np.linalg.LinAlgError)
COMPUTING = {"coefficients", "initial_state", "inverse", "inverse_start", "passes", "reachable"}
"""Methods in which numbers may be too large or too small to compute with, as where one is made."""


def _computing(method: Callable[..., Any]) -> Callable[..., Any]:
    """Return a method whose arithmetic errors are told as those of the model's numbers."""

    @wraps(method)
    def told(self: Any, *given: Any, **named: Any) -> Any:
        try:
            return method(self, *given, **named)
        except UNCOMPUTABLE as error:
            raise _beyond_sense(type(self), error) from error

    return told


def _beyond_sense(cls: type, error: Exception) -> ModelError:
    return ModelError(
        f"the numbers of {getattr(cls, 'kind', cls.__name__)!r} cannot be computed with ({error}). "
        "Remedy: identify the model again; numbers so large or small mean nothing."
    )


class Checked(ABCMeta):
    """What makes classes that refuse bad fields, and numbers beyond all sense, with a `ModelError`."""

    def __new__(
        mcs, name: str, bases: tuple[type, ...], namespace: dict[str, Any], **named: Any
    ) -> Checked:
        """Return the class, its arithmetic guarded."""
        for method in COMPUTING & namespace.keys():
            if isfunction(namespace[method]):
                namespace[method] = _computing(namespace[method])
        return super().__new__(mcs, name, bases, namespace, **named)

    def __call__(cls: type[Made], /, *values: Any, **named: Any) -> Made:
        """Return an instance, its fields validated."""
        try:
            return super().__call__(*values, **named)  # type: ignore[misc]
        except UNCOMPUTABLE as error:
            raise _beyond_sense(cls, error) from error
        except ValidationError as error:
            first = error.errors()[0]
            names = [field.name for field in fields(cls)]  # type: ignore[arg-type]
            field, *inside = first["loc"]
            if isinstance(field, int):
                field = names[field] if field < len(names) else f"argument {field + 1}"
            where = ".".join(str(step) for step in (field, *inside))
            kind = getattr(cls, "kind", cls.__name__)
            given = "" if first["type"] == "missing" else f", but it is {first['input']!r:.60}"
            raise ModelError(
                f"{where} of {kind!r}: {first['msg']}{given}. "
                f"Remedy: give what {cls.__name__} documents."
            ) from None
