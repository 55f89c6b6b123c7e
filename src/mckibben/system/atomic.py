"""Atomic file writing, through a temporary name that is renamed."""

from __future__ import annotations

import json
import math
import os
import secrets
import stat
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import fields, is_dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

from mckibben.errors import DataError
from mckibben.printing import encoded

PART = ".mckibben-"
"""How temporary names begin."""


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Open a temporary path in the same folder, and rename it to ``path`` on success.

    The temporary file is new, and has the rights of the file that it replaces. A link of that name is
    replaced itself: the file that it leads to stays as it is.

    Raises
    ------
    DataError
        If the folder is missing or cannot be written to, or what has that name is no ordinary file.
    """
    path = Path(path)
    with written(path):
        before = _replaceable(path)
        new = _temporary(path)
        try:
            if before is not None and stat.S_ISREG(before.st_mode):
                new.chmod(stat.S_IMODE(before.st_mode) & 0o777)
            yield new
            new.replace(path)
        finally:
            with suppress(OSError):
                new.unlink(missing_ok=True)


@contextmanager
def written(path: str | Path) -> Iterator[None]:
    """Convert an `OSError` to a `DataError` that names this file."""
    try:
        yield
    except OSError as error:
        raise DataError(
            f"it cannot be written ({error.strerror or error})",
            file=path,
            remedy="give a path in a folder that can be written to, on a disk that is not full",
        ) from None


def demand_room(path: Path) -> None:
    """Raise an error for a path that `replacing` would reject, before any work."""
    with written(path):
        _replaceable(path)
        tempfile.TemporaryFile(dir=path.parent).close()


def _temporary(path: Path) -> Path:
    """Create a new temporary file in the same folder."""
    new = path.with_name(f"{PART}{secrets.token_hex(8)}.part")
    os.close(os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
    return new


def _replaceable(path: Path) -> os.stat_result | None:
    """Return an existing file of that name, if any; raise an error for folders, pipes and devices."""
    try:
        status = path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        if path.parent.is_dir():
            return None
        remedy = "create the folder first"
        raise DataError("its folder does not exist", file=path, remedy=remedy) from None
    except ValueError as error:
        raise DataError(f"no file has that name ({error})", file=path, remedy="rename it") from None
    if path.is_dir():
        raise DataError("there is a folder of that name", file=path, remedy="name a file")
    if not (stat.S_ISREG(status.st_mode) or stat.S_ISLNK(status.st_mode)):
        raise DataError("there is a device or a pipe of that name", file=path, remedy="name a file")
    return status


def digest(content: bytes) -> str:
    """Return the SHA-256 of bytes, in hexadecimal digits."""
    return sha256(content).hexdigest()


def write_text(path: str | Path, text: str) -> None:
    """Write a text file in UTF-8; an earlier file is replaced when all is written."""
    with replacing(path) as new:
        new.write_bytes(encoded(text))


def to_json(value: Any) -> str:
    """Return a value as indented JSON text; numbers that are not finite become null."""
    return json.dumps(plain(value), indent=2, allow_nan=False, ensure_ascii=False)


def write_json(path: str | Path, value: Any) -> None:
    """Write a value as JSON, in the same way."""
    write_text(path, to_json(value) + "\n")


class Numbers:
    """A dataclass whose fields are given as JSON values, but those that ``repr`` leaves out."""

    def to_dict(self) -> dict[str, Any]:
        """Return it for JSON, with None for numbers that are not finite."""
        of: Any = self
        return {one.name: plain(getattr(self, one.name)) for one in fields(of) if one.repr}


def plain(value: Any) -> Any:
    """Return dataclasses, arrays and paths as JSON values; non-finite numbers become None."""
    if isinstance(value, Numbers):
        return plain(value.to_dict())
    if isinstance(value, Path):
        return str(value)
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    if hasattr(value, "tolist"):  # NumPy's
        return plain(value.tolist())
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
