"""Files are written under a temporary name and renamed, so that none is ever half there."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mckibben.errors import DataError


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a temporary path in the same folder, and rename it to ``path`` when all went well.

    Raises
    ------
    DataError
        If the folder is missing or cannot be written to.
    """
    new = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield new
        new.replace(path)
    except OSError as error:
        raise DataError(
            f"it cannot be written ({error.strerror or error})",
            file=path,
            remedy="give a path in a folder that is there and can be written to",
        ) from None
    finally:
        new.unlink(missing_ok=True)
