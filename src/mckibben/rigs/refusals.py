"""Validation errors of pydantic as errors with field, range and meaning."""

from __future__ import annotations

from pathlib import Path
from typing import Any, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from mckibben.errors import DataError


def refused(
    error: ValidationError, model: type[BaseModel], file: str | Path | None = None
) -> DataError:
    """Return the first validation error as a `DataError`."""
    first = error.errors(include_url=False)[0]
    place = [part for part in first["loc"] if isinstance(part, str)]
    path = ".".join(str(part) for part in first["loc"])
    kind = first["type"]
    field = _field(model, place)
    if kind == "missing":
        return DataError(f"the parameter {path!r} is missing", file=file, remedy=_wanted(field))
    if kind == "extra_forbidden":
        return DataError(
            f"there is no parameter {path!r}", file=file, remedy="correct its name, or drop it"
        )
    if kind == "value_error":
        problem = str(first["ctx"]["error"])
        where = f"{path}: " if path else ""
        return DataError(f"{where}{problem}", file=file, remedy="change one of them")
    given = first["input"]
    shown = repr(given) if not isinstance(given, dict | list) else "a " + type(given).__name__
    return DataError(
        f"{path} is {shown}: {first['msg'][0].lower()}{first['msg'][1:]}",
        file=file,
        remedy=_wanted(field),
    )


def limits(field: FieldInfo) -> str:
    """Return the range of a field in words, empty if there is none."""
    words = []
    for rule in field.metadata:
        for name, text in (("ge", "at least"), ("gt", "above"), ("le", "at most"), ("lt", "below")):
            bound = getattr(rule, name, None)
            if bound is not None:
                words.append(f"{text} {bound:g}")
    return ", ".join(words)


def unit(field: FieldInfo) -> str:
    """Return the unit of a field, empty if there is none."""
    extra = field.json_schema_extra
    return str(extra["unit"]) if isinstance(extra, dict) and "unit" in extra else ""


def _wanted(field: FieldInfo | None) -> str:
    if field is None:
        return "correct its name, or drop it"
    of_unit = f" [{unit(field)}]" if unit(field) else ""
    bounds = limits(field)
    return f"give {field.description or 'section'}{of_unit}" + (f", {bounds}" if bounds else "")


def _field(model: type[BaseModel], place: list[str]) -> FieldInfo | None:
    """Return the field of a path within a model, or the last one on the path."""
    found: FieldInfo | None = None
    inner: Any = model
    for part in place:
        if get_origin(inner) is dict:
            inner = get_args(inner)[1]
            continue
        fields = getattr(inner, "model_fields", {})
        if part not in fields:
            return found
        found = fields[part]
        inner = found.annotation
    return found
