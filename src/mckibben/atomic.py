"""Files are written under a temporary name and renamed, so that none is ever half there."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mckibben.errors import DataError


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Give a temporary path in the same folder, and rename it to ``path`` when all went well.

    Raises
    ------
    DataError
        If the folder is missing or cannot be written to, or there is a folder of that name.
    """
    path = Path(path)
    if path.is_dir():
        raise DataError("there is a folder of that name", file=path, remedy="name a file")
    if not path.parent.is_dir():
        raise DataError("its folder does not exist", file=path, remedy="create the folder first")
    new = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        new.unlink(missing_ok=True)  # lest a link that someone left there be followed
        yield new
        new.replace(path)
    except OSError as error:
        raise DataError(
            f"it cannot be written ({error.strerror or error})",
            file=path,
            remedy="give a path in a folder that can be written to",
        ) from None
    finally:
        new.unlink(missing_ok=True)


def write_text(path: str | Path, text: str) -> None:
    """Write a text file in UTF-8; what was there before stays until all is written."""
    with replacing(path) as new:
        new.write_text(text, encoding="utf-8", newline="")


def to_json(value: Any) -> str:
    """Return a value as indented JSON text; numbers that are not finite become null."""
    return json.dumps(_plain(value), indent=2, allow_nan=False, ensure_ascii=False)


def write_json(path: str | Path, value: Any) -> None:
    """Write a value as JSON, likewise."""
    write_text(path, to_json(value) + "\n")


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
