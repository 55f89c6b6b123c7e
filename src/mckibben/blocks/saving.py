"""Blocks as readable JSON: exact to the last bit, and data only, never code.

A file starts with ``format`` and ``version``; every block names its ``kind``, which the registry
turns into a class. Unknown kinds and fields, numbers that are not finite and values of the wrong type
are refused.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mckibben.errors import DataError, ModelError
from mckibben.registry import load as load_plugin
from mckibben.registry import names
from mckibben.system.atomic import write_text
from mckibben.system.ordinary import read_text

if TYPE_CHECKING:
    from mckibben.blocks.base import Block

FORMAT = "mckibben-model"
VERSION = 1
LARGEST_FILE = 64 * 2**20
"""Largest model file [bytes]; a larger one is refused before parsing."""


def to_dict(block: Block) -> dict[str, Any]:
    """Return a block as a JSON-ready dict, with ``format`` and ``version`` first."""
    return {"format": FORMAT, "version": VERSION, **part_to_dict(block)}


def from_dict(content: Mapping[str, Any]) -> Block:
    """Return the block of a dict from `to_dict`; raise an error for invalid content."""
    if not isinstance(content, Mapping) or content.get("format") != FORMAT:
        raise ModelError(
            f'this is not a saved model (no "format": "{FORMAT}")',
            remedy="give a file that `fit()` or Block.save wrote",
        )
    version = content.get("version")
    if type(version) is not int or version != VERSION:
        raise ModelError(
            f"the model has format version {version!r:.60}, this package reads version {VERSION}",
            remedy="save it again with a matching release of mckibben",
        )
    described = {key: value for key, value in content.items() if key not in ("format", "version")}
    try:
        block: Block = part_from_dict(described)
    except RecursionError:
        raise ModelError("nested too deeply", remedy="compose fewer blocks in each other") from None
    return block


def part_to_dict(part: Any) -> Any:
    """Return a block, or a value in one, as JSON-ready values."""
    if is_dataclass(part) and not isinstance(part, type):
        named = {"kind": part.kind} if hasattr(part, "kind") else {}
        return named | {f.name: part_to_dict(getattr(part, f.name)) for f in fields(part)}
    if isinstance(part, tuple):
        return [part_to_dict(item) for item in part]
    return part


def part_from_dict(content: Any, group: str = "blocks") -> Any:
    """Return the block (or other plug-in of ``group``) of a dict from `part_to_dict`."""
    if not isinstance(content, Mapping) or not isinstance(content.get("kind"), str):
        raise ModelError('a block without a "kind"', remedy="save the model again")
    kind = content["kind"]
    if group == "blocks" and kind not in names(group):  # of older files: every inverse had its own
        older = {"adaptive-series": "adaptive"}
        undone = kind.removesuffix("-inverse") in names(group)
        kind = older.get(kind, "inverse" if undone else kind)
    cls = load_plugin(group, kind)
    values = {key: _tuples(value) for key, value in content.items() if key != "kind"}
    for older, name in getattr(cls, "renamed", {}).items():
        if older in values:
            values[name] = values.pop(older)
    for name, unused in getattr(cls, "retired", {}).items():
        if values.get(name) == unused:
            values.pop(name, None)
    unknown = sorted(set(values) - {field.name for field in fields(cls)}, key=str)
    if unknown:
        remedy = getattr(cls, "made_again", "save the model again")
        raise ModelError(f"{kind!r} has no field {unknown[0]!r}", remedy=remedy)
    return cls(**values)


def nested(content: Any) -> Any:
    """Convert the dict of a block inside another to that block; for fields of compositions."""
    return part_from_dict(content) if isinstance(content, Mapping) else content


def to_text(block: Block) -> str:
    """Return a block as the text of its file."""
    return json.dumps(to_dict(block), indent=2, allow_nan=False) + "\n"


def save(block: Block, path: str | Path) -> None:
    """Save a block as JSON, through a temporary file that is then renamed."""
    write_text(path, to_text(block))


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
        raise ModelError(error.problem, file=path, remedy=error.remedy) from None
    except (ValueError, RecursionError) as error:
        problem = f"it is not readable as a model ({str(error)[:200]})"
        remedy = "save the model again"
    if path.suffix.casefold() in SOUGHT and path.is_file():
        problem, remedy = "this is a recording", "the model comes first, then recordings"
    raise ModelError(problem, file=path, remedy=remedy)


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
