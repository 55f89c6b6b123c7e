"""Folders are written whole: under a temporary name, then renamed."""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping
from pathlib import Path

from mckibben.errors import DataError


def write_folder(folder: Path, files: Mapping[str, bytes], *, overwrite: bool = False) -> None:
    """Write files, by their path in the folder; what was there before stays until all is written.

    Parameters
    ----------
    folder : Path
        Where; its parent must exist.
    files : mapping of str to bytes
        Contents by relative path.
    overwrite : bool
        Whether a folder that is there and not empty may be replaced; only one whose files an export
        wrote.

    Raises
    ------
    DataError
        If there is something of that name and it is not to be replaced, or it cannot be written.
    """
    if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
        raise DataError(
            "there is a file of that name", file=folder, remedy="name a folder of its own"
        )
    taken = folder.is_dir() and any(folder.iterdir())
    if taken and not overwrite:
        raise DataError(
            "the folder exists and is not empty", file=folder, remedy="name another, or --overwrite"
        )
    if taken:
        _check_own(folder, files)
    if not folder.absolute().parent.is_dir():
        raise DataError("its folder does not exist", file=folder, remedy="create the folder first")
    new = folder.absolute().with_name(f".{folder.absolute().name}.{os.getpid()}.part")
    old = new.with_suffix(".old")
    try:
        for path, content in files.items():
            target = new / path
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(content)
        if folder.exists():
            folder.absolute().rename(old)
        new.rename(folder.absolute())
    except OSError as error:
        if old.exists() and not folder.exists():
            old.rename(folder.absolute())
        raise DataError(
            f"it cannot be written ({error.strerror or error})",
            file=folder,
            remedy="give a path in a folder that can be written to",
        ) from None
    finally:
        shutil.rmtree(new, ignore_errors=True)
        shutil.rmtree(old, ignore_errors=True)


def _check_own(folder: Path, files: Mapping[str, bytes]) -> None:
    """Refuse to replace a folder that holds anything that this export would not write itself."""
    kept = {
        path.relative_to(folder).as_posix()
        for path in folder.rglob("*")
        if path.is_file() or path.is_symlink()
    }
    foreign = sorted(kept - set(files))
    if foreign:
        raise DataError(
            f"the folder holds {len(foreign)} file(s) that are not of this export, such as "
            f"{foreign[0]}",
            file=folder,
            remedy="move them away, or name another folder",
        )
