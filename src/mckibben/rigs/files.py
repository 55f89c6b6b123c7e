"""The text of a rig's file: readable TOML, each number with its unit, meaning and range."""

from __future__ import annotations

import math
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from mckibben.errors import DataError
from mckibben.system.ordinary import DESCRIPTION, read_text

REMEDY = "see `mckibben rig show` for all parameters, with units and ranges"

FORMAT = "mckibben-rig"
FORMAT_VERSION = 1
PUBLISHED = Path(__file__).parent / "published"


@cache
def rig_names() -> tuple[str, ...]:
    """Return the names of the rigs of the package, in alphabetical order.

    >>> "mas20-hanging" in rig_names()
    True
    """
    return tuple(sorted(path.stem for path in PUBLISHED.glob("*.toml")))


def describe(rig: BaseModel) -> str:
    """Return the text of a rig's file: every parameter with its unit, meaning and range."""
    lines = [f'format = "{FORMAT}"', f"format_version = {FORMAT_VERSION}"]
    _write_section(rig, "", lines)
    return "\n".join(lines) + "\n"


def _write_section(section: BaseModel, path: str, lines: list[str]) -> None:
    later: list[tuple[str, BaseModel]] = []
    for name, field in type(section).model_fields.items():
        value = getattr(section, name)
        if isinstance(value, BaseModel):
            later.append((name, value))
        elif (
            isinstance(value, dict) and value and isinstance(next(iter(value.values())), BaseModel)
        ):
            later += [(f"{name}.{key}", item) for key, item in value.items()]
        else:
            words = ", ".join(part for part in (field.description, _limits(field)) if part)
            extra = field.json_schema_extra
            unit = extra.get("unit") if isinstance(extra, dict) else None
            comment = f"  # [{unit}] {words}" if unit else f"  # {words}" * bool(words)
            lines.append(f"{name} = {_toml(value)}{comment}")
    for name, inner in later:
        full_name = f"{path}.{name}" if path else name
        lines += ["", f"[{full_name}]"]
        _write_section(inner, full_name, lines)


def _limits(field: FieldInfo) -> str:
    """Return the range of a field, empty if there is none."""
    words = []
    for rule in field.metadata:
        for name, text in (("ge", "at least"), ("gt", "above"), ("le", "at most"), ("lt", "below")):
            bound = getattr(rule, name, None)
            if bound is not None:
                words.append(f"{text} {bound:g}")
    return ", ".join(words)


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {_toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, tuple | list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    text = str(value).replace("\\", "\\\\").replace('"', '\\"').replace("\n", " ")
    return f'"{text}"'


def fields_of(path: Path) -> dict[str, Any]:
    """Return the fields in a rig's file; raise a `DataError` if it is none."""
    text = read_text(path, most=DESCRIPTION)
    try:
        fields = _plain(tomllib.loads(text))
    except (ValueError, RecursionError) as error:
        raise DataError(
            f"this is not TOML: {str(error)[:200]}", file=path, remedy="correct the file"
        ) from None
    if fields.pop("format", None) != FORMAT:
        raise DataError(
            f"it does not begin with format = {FORMAT!r}",
            file=path,
            remedy="start from a rig of the package, saved as a file",
        )
    version = fields.pop("format_version", None)
    if version != FORMAT_VERSION:
        raise DataError(
            f"format_version is {version!r:.60}, not {FORMAT_VERSION}",
            file=path,
            remedy="write it with this version of the package",
        )
    return fields


def _plain(value: Any) -> Any:
    """Return TOML's nan, inf and very large integers as text, which every number field rejects."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_plain(item) for item in value]
    if isinstance(value, int) and value.bit_length() > 63:
        return "an integer beyond 64 bits"
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value
