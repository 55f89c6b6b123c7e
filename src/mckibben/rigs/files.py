"""Rigs as readable TOML files, each number with its unit, meaning and range."""

from __future__ import annotations

import math
import tomllib
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from mckibben import registry
from mckibben.errors import DataError
from mckibben.recording import Recording
from mckibben.system.atomic import write_text
from mckibben.system.ordinary import DESCRIPTION, read_text
from mckibben.system.validation import invalid

if TYPE_CHECKING:
    from mckibben.rigs.rig import Rig  # which says what was changed of a published one

CHANGES = "rig_changes"
"""In the ``meta`` of what a rig recorded: how it differs from the published one."""

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


def load_rig(rig: str | Path) -> Rig:
    """Return a rig by name, or from a file.

    Parameters
    ----------
    rig : str or path
        A name of `rig_names`, or a path that ends in ``.toml``.

    Raises
    ------
    DataError
        On an unknown name, or a file that is not a rig: the text names the parameter and its range.
    """
    path = Path(rig)
    if path.suffix != ".toml":
        if str(rig) not in rig_names():
            raise DataError(
                f"there is no rig {str(rig)!r}",
                remedy=f"use one of {', '.join(rig_names())}, or a file that ends in .toml",
            )
        path = PUBLISHED / f"{rig}.toml"
    return _from_fields(_read(path), path)


def save_rig(rig: Rig, path: str | Path) -> None:
    """Write a rig as a documented file; an earlier file is replaced when all is written."""
    path = Path(path)
    if path.suffix != ".toml":
        raise DataError("a rig's file ends in .toml", file=path, remedy="name it so")
    write_text(path, describe(rig))


def describe(rig: Rig) -> str:
    """Return the text of a rig's file: every parameter with its unit, meaning and range."""
    lines = [f'format = "{FORMAT}"', f"format_version = {FORMAT_VERSION}"]
    _write_section(rig, "", lines)
    return "\n".join(lines) + "\n"


def changes(rig: Rig) -> dict[str, Any] | None:
    """Return the differences of a rig from the published one of its name; None without one.

    >>> changes(load_rig("mas20-hanging").changed({"payload": 10.0}))
    {'payload': 10.0}
    """
    if rig.name not in rig_names():
        return None
    return _differing(_fields(load_rig(rig.name)), _fields(rig))


def recorded_on(recording: Recording) -> Rig | None:
    """Return the rig of a recording, rebuilt; None if it names no published one.

    Raises
    ------
    DataError
        If that was another version, or what was changed is not known or makes no rig.
    """
    named = str(recording.meta.get("rig", ""))
    name, given = named.partition(" ")[0], recording.meta.get(CHANGES)
    if name not in rig_names():
        return None
    rig = load_rig(name)
    if named != rig.signature:
        raise DataError(
            f"{recording.name} is of {named[:60]}, not of {rig.signature}",
            remedy="record it again, or name the rig",
        )
    if not isinstance(given, dict):
        raise DataError(
            f"{recording.name} does not record whether its rig {name} was changed",
            remedy="record it again, or name the rig",
        )
    return rig.changed(given)


def _fields(rig: Rig) -> dict[str, Any]:
    """Return the fields of a rig as JSON values."""
    return rig.model_dump(mode="json", exclude={"title", "source"})


def _differing(known: dict[str, Any], own: dict[str, Any], path: str = "") -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in own.items():
        before = known.get(name)
        if isinstance(before, dict) and isinstance(value, dict) and value.keys() == before.keys():
            found |= _differing(before, value, f"{path}{name}.")
        elif value != before:
            found[path + name] = value
    return found


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
        whole = f"{path}.{name}" if path else name
        lines += ["", f"[{whole}]"]
        _write_section(inner, whole, lines)


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


def _read(path: Path) -> dict[str, Any]:
    try:
        fields = _plain(tomllib.loads(read_text(path, most=DESCRIPTION)))
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


def _from_fields(fields: dict[str, Any], path: Path) -> Rig:
    known = registry.names("setups")
    setup = fields.get("setup")
    if setup not in known:
        raise DataError(
            f"setup is {setup!r:.60}", file=path, remedy=f"give one of {', '.join(known)}"
        )
    model: type[Rig] = registry.load("setups", str(setup))
    try:
        return model.model_validate(fields)
    except ValidationError as error:
        raise invalid(error, path, REMEDY) from None


def _plain(value: Any) -> Any:
    """Return TOML's nan, inf and very large integers as text, which every number field rejects."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_plain(item) for item in value]
    if isinstance(value, int) and value.bit_length() > 63:
        return "an integer beyond 64 bits"
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value
