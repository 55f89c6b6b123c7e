"""Files are written under a temporary name and renamed, so that none is ever half there."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

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
