"""Checkpoints: finished parts of long work, stored with its results, for resuming it.

Each is a JSON file under a digest of all that it depends on: the data, settings, seed, and the program
itself. A part under another digest is not used.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import warnings
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, fields, is_dataclass, replace
from functools import cache
from importlib.metadata import version
from inspect import getsourcefile
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

import mckibben
from mckibben.blocks.base import Block
from mckibben.blocks.saving import LARGEST_FILE, from_dict
from mckibben.errors import DataWarning, MckibbenError
from mckibben.outputs import UNFINISHED
from mckibben.recording import PROVENANCE, Recording
from mckibben.system import ordinary
from mckibben.system.atomic import PART, write_text, written

Result = TypeVar("Result")

_NAMES = re.compile(rf"-[0-9a-f]{{16}}\.json$|^{re.escape(PART)}[0-9a-f]{{16}}\.part$")
"""Names of checkpoints, and of temporary files left by a killed process."""


class Checkpoints:
    """Checkpoints of a long computation.

    Parameters
    ----------
    folder : path or None
        Of the results; None to write nothing.
    depends : object
        What everything depends on: anything that `digest` takes.
    """

    def __init__(self, folder: str | Path | None, *depends: object) -> None:
        self._folder = None if folder is None else Path(folder) / UNFINISHED
        self._digest = digest(program(), depends) if folder is not None else ""

    def get(self, name: str, kind: type[Result], *depends: object) -> Result | None:
        """Return a stored part, a block or a dataclass, if its inputs are unchanged; else None."""
        path = self._path(name, depends)
        if path is None or not path.is_file():
            return None
        try:
            return _from_json(kind, json.loads(ordinary.read_text(path, most=LARGEST_FILE)))
        except Exception as error:  # a damaged part is computed again
            _warn(path, error)
            return None

    def put(self, name: str, result: object, *depends: object) -> None:
        """Write a part; on failure, work continues without it."""
        path = self._path(name, depends)
        if path is not None:
            text = json.dumps(_to_json(result)) + "\n"
            try:
                with written(path):
                    path.parent.mkdir(parents=True, exist_ok=True)
                write_text(path, text)
            except MckibbenError as error:
                _warn(path, error)

    def once(
        self, name: str, kind: type[Result], compute: Callable[[], Result], *depends: object
    ) -> Result:
        """Return a part, computed if it is not stored yet."""
        result = self.get(name, kind, *depends)
        if result is None:
            result = compute()
            self.put(name, result, *depends)
        return result

    def inside(self, name: str) -> Path | None:
        """Return a folder for nested parts, or None without checkpoints."""
        return None if self._folder is None else self._folder / name

    def clear(self) -> None:
        """Remove all parts, but no other files."""
        if self._folder is None or self._folder.is_symlink():
            return
        for folder, _, names in os.walk(self._folder, topdown=False):
            for name in filter(_NAMES.search, names):
                with suppress(OSError):
                    Path(folder, name).unlink()
            with suppress(OSError):  # not empty
                Path(folder).rmdir()

    def _path(self, name: str, depends: object) -> Path | None:
        if self._folder is None:
            return None
        plain = "".join(c if c.isalnum() or c in "-." else "-" for c in name)
        return self._folder / f"{plain}-{digest(self._digest, depends)[:16]}.json"


def _warn(path: Path, error: Exception) -> None:
    warnings.warn(f"{path} is not used: {error}", DataWarning, stacklevel=4)


def digest(*what: object) -> str:
    """Return a digest of numbers, words, arrays, and mappings, sequences or dataclasses of those."""
    hashed = hashlib.sha256()

    def take(value: object) -> None:
        if isinstance(value, np.ndarray):
            hashed.update(f"{value.dtype}{value.shape}".encode())
            hashed.update(np.ascontiguousarray(value).tobytes())
        elif isinstance(value, Recording):  # wherever it was read from
            meta = {key: what for key, what in value.meta.items() if key not in PROVENANCE}
            take((dict(value.channels), value.sample_time, value.start_time, value.units, meta))
        elif is_dataclass(value) and not isinstance(value, type):
            hashed.update(type(value).__qualname__.encode())
            take({f.name: getattr(value, f.name) for f in fields(value) if f.compare})
        elif isinstance(value, Mapping):
            take([(str(key), value[key]) for key in sorted(value, key=str)])
        elif isinstance(value, list | tuple):
            hashed.update(f"[{len(value)}".encode())
            for item in value:
                take(item)
        else:
            hashed.update(f"{type(value).__name__} {value!r};".encode())

    take(what)
    return hashed.hexdigest()


@cache
def program() -> str:
    """Return a digest of the package's files, and of its numerical libraries."""
    home = Path(mckibben.__file__).parent
    files = [p for p in sorted(home.rglob("*")) if p.is_file() and "__pycache__" not in p.parts]
    libraries = {name: version(name) for name in ("numpy", "scipy", "numba")}
    return digest({str(p.relative_to(home)): p.read_bytes() for p in files}, libraries)


def source(plugin: Any) -> str:
    """Return a digest of an estimator's source file."""
    path = getsourcefile(plugin)
    return "" if path is None else digest(Path(path).read_bytes())


def _to_json(value: Any) -> Any:
    if isinstance(value, Block):
        return value.to_dict()
    if not is_dataclass(value) or isinstance(value, type):
        raise TypeError(f"{type(value).__name__} is neither a block nor a dataclass")
    blocks = {f.name: getattr(value, f.name) for f in fields(value)}
    blocks = {name: block for name, block in blocks.items() if isinstance(block, Block)}
    plain = asdict(replace(value, **dict.fromkeys(blocks)))
    return plain | {name: block.to_dict() for name, block in blocks.items()}


def _from_json(kind: type[Result], content: Any) -> Result:
    if issubclass(kind, Block):
        block: Any = from_dict(content)
        return block
    from pydantic import TypeAdapter

    blocks = {
        name: from_dict(value)
        for name, value in content.items()
        if isinstance(value, Mapping) and "format" in value
    }
    found: Any = TypeAdapter(kind).validate_python(content | blocks)
    return found
