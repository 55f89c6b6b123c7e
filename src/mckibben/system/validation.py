"""Errors of pydantic and of other libraries in the words of the package."""

from __future__ import annotations

from pathlib import Path

from pydantic import ValidationError

from mckibben.errors import DataError


def invalid(error: ValidationError, file: str | Path | None, remedy: str) -> DataError:
    """Return the first validation error as a `DataError`, with the path of its field."""
    first = error.errors(include_url=False)[0]
    path = ".".join(str(part) for part in first["loc"])
    if first["type"] == "missing":
        problem = f"{path!r} is missing"
    elif first["type"] == "extra_forbidden":
        problem = f"there is no {path!r}"
    elif first["type"] == "value_error":
        problem = f"{path}: {first['ctx']['error']}" if path else str(first["ctx"]["error"])
    else:
        problem = f"{path} is {first['input']!r:.60}: {first['msg'][:1].lower()}{first['msg'][1:]}"
    return DataError(problem, file=file, remedy=remedy)


def reason(error: Exception) -> str:
    """Return a library's error in one line."""
    text = str(error)
    if isinstance(error, ValidationError):
        first = error.errors()[0]
        location, text = (
            ".".join(map(str, first["loc"])),
            first["msg"].removeprefix("Value error, "),
        )
        text = f"{location[:100]}: {text}".removeprefix(": ")
    return " ".join(text.split())[:300] or type(error).__name__
