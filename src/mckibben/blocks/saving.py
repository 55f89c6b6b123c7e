"""Reading saved blocks: JSON that is data only, never code. `Block.save` writes it.

A file starts with ``format`` and ``version``; every block names its ``kind``, which the registry
turns into a class. Unknown kinds, unknown and missing fields, numbers that are not finite and values of
the wrong type are refused. An older file may lack what was ``added`` to a class since, and no more.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from contextvars import ContextVar
from dataclasses import fields
from pathlib import Path
from typing import Any

from mckibben.blocks.base import FORMAT, VERSION, Block
from mckibben.errors import DataError, ModelError
from mckibben.registry import load as load_plugin
from mckibben.registry import names
from mckibben.system.ordinary import read_text

LARGEST_FILE = 64 * 2**20
"""Largest model file [bytes]; a larger one is refused before parsing."""

_READ: ContextVar[int | None] = ContextVar("version of the file that is read", default=None)


def from_dict(content: Mapping[str, Any]) -> Block:
    """Return the block of a dict from `Block.to_dict`; raise an error for invalid content."""
    if not isinstance(content, Mapping) or content.get("format") != FORMAT:
        raise ModelError(
            f'this is not a saved model (no "format": "{FORMAT}")',
            remedy="give a file that `fit()` or Block.save wrote",
        )
    version = content.get("version")
    if type(version) is not int or not 1 <= version <= VERSION:
        newer = type(version) is int and version > VERSION
        problem = f"it is of version {version!r:.60} of its format, and not of 1 to {VERSION}"
        raise ModelError(
            f"it was written by a newer mckibben: {problem}" if newer else problem,
            remedy="update mckibben" if newer else "save it again",
        )
    described = {key: value for key, value in content.items() if key not in ("format", "version")}
    token = _READ.set(version)
    try:
        block: Block = part_from_dict(described)
    except RecursionError:
        raise ModelError("nested too deeply", remedy="compose fewer blocks in each other") from None
    finally:
        _READ.reset(token)
    return block


def part_from_dict(content: Any, group: str = "blocks") -> Any:
    """Return the block (or other plug-in of ``group``) of a dict from `plain`.

    Of a saved file all fields must be there; what is written by hand may leave out those with defaults.
    """
    if not isinstance(content, Mapping) or not isinstance(content.get("kind"), str):
        raise ModelError('a block without a "kind"', remedy="save the model again")
    kind = content["kind"]
    if group == "blocks" and kind not in names(group):  # of older files: every inverse had its own
        older = {"adaptive-series": "adaptive"}
        undone = kind.removesuffix("-inverse") in names(group)
        kind = older.get(kind, "inverse" if undone else kind)
    cls = load_plugin(group, kind)
    values = {key: _tuples(value) for key, value in content.items() if key != "kind"}
    try:  # what an older file has
        values = getattr(cls, "converted", dict)(values)
    except (ArithmeticError, KeyError, TypeError, ValueError):
        raise ModelError(f"older fields of {kind!r} are invalid", remedy="save it again") from None
    for name, unused in getattr(cls, "retired", {}).items():
        if values.get(name) == unused:
            values.pop(name, None)
    known, read = {field.name for field in fields(cls)}, _READ.get()
    remedy = getattr(cls, "made_again", "save the model again")
    if unknown := sorted(values.keys() - known, key=str):
        raise ModelError(f"{kind!r} has no such field", parameter=unknown[0], remedy=remedy)
    since = getattr(cls, "added", {})
    lacking = (name for name in known - values.keys() if read and read >= since.get(name, 1))
    if missing := sorted(lacking):
        raise ModelError(f"{kind!r} lacks the field {missing[0]!r}", remedy=remedy)
    return cls(**values)


def nested(content: Any) -> Any:
    """Convert the dict of a block inside another to that block; for fields of compositions."""
    return part_from_dict(content) if isinstance(content, Mapping) else content


def load(path: str | Path) -> Block:
    """Read a block saved as JSON.

    Parameters
    ----------
    path : str or Path
        File that `Block.save` or a command wrote.

    Raises
    ------
    ModelError
        If the file is absent, unreadable, too large, truncated, or anything but a saved model.
    """
    from mckibben.files.formats import SOUGHT

    path = Path(path)
    try:
        text = read_text(path, most=LARGEST_FILE)
        return from_dict(json.loads(text, parse_constant=_refuse, object_pairs_hook=_unique))
    except DataError as error:
        problem, remedy = error.problem, error.remedy
    except ModelError as error:
        error.file = path
        raise error from None
    except (ValueError, RecursionError) as error:
        problem = f"it is not readable as a model ({str(error)[:200]})"
        remedy = "save the model again"
    if path.suffix.casefold() in SOUGHT and path.is_file():
        problem, remedy = (
            "this is a recording",
            "give a model first; recordings are read with mckibben.read",
        )
    raise ModelError(problem, file=path, remedy=remedy)


def is_saved(path: Path) -> bool:
    """Return whether a file of JSON is one that this package saved, and no recording."""
    try:
        return (
            re.search(r'"format"\s*:\s*"mckibben-', read_text(path, most=LARGEST_FILE)) is not None
        )
    except DataError:
        return False


def _tuples(value: Any) -> Any:
    return tuple(_tuples(item) for item in value) if isinstance(value, list) else value


def _refuse(constant: str) -> None:
    raise ModelError(
        f"the file holds {constant}, which no model has", remedy="save the model again"
    )


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) < len(pairs):
        raise ModelError("a field occurs twice in the file", remedy="save the model again")
    return content
