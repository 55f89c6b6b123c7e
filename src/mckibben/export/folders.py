"""Folders are written whole: under a temporary name, then renamed.

Each holds a manifest with a digest of every file, by which a later export knows what it may replace:
only what an export wrote, and nobody has changed since.
"""

from __future__ import annotations

import hashlib
import io
import os
import shutil
import sys
import zipfile
from collections.abc import Mapping
from pathlib import Path

from mckibben.errors import DataError
from mckibben.ordinary import DESCRIPTION, opened, read_text

MANIFEST = "manifest.sha256"

OLDEST = (1980, 1, 1, 0, 0, 0)
"""Date of the files in a zip, so that the same model gives the same bytes."""


def write_folder(folder: Path, files: Mapping[str, bytes], *, overwrite: bool = False) -> None:
    """Write files, by their path in the folder; what was there before stays until all is written.

    Parameters
    ----------
    folder : Path
        Where; its parent must exist.
    files : mapping of str to bytes
        Contents by relative path.
    overwrite : bool
        Whether what an export wrote there before may be replaced.

    Raises
    ------
    DataError
        If there is something of that name that is not to be replaced, or it cannot be written.
    """
    folder = folder.absolute()
    if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
        raise DataError(
            "there is a file of that name", file=folder, remedy="name a folder of its own"
        )
    if folder.is_dir() and any(folder.iterdir()):
        if not overwrite:
            raise DataError(
                "the folder exists and is not empty",
                file=folder,
                remedy="name another, or --overwrite",
            )
        _check_own(folder)
    if not folder.parent.is_dir():
        raise DataError("its folder does not exist", file=folder, remedy="create the folder first")
    new = folder.with_name(f".{folder.name}.{os.getpid()}.part")
    old = folder.with_name(f".{folder.name}.{os.getpid()}.old")
    try:
        for path, content in {**files, MANIFEST: _manifest(files)}.items():
            target = new / path
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(content)
        if folder.exists():
            folder.rename(old)
        new.rename(folder)
    except OSError as error:
        raise DataError(
            f"it cannot be written ({error.strerror or error})",
            file=folder,
            remedy="give a path in a folder that can be written to",
        ) from None
    finally:
        # whatever happened in between, one of the two is there
        if old.exists() and not folder.exists():
            old.rename(folder)
        shutil.rmtree(new, ignore_errors=True)
        shutil.rmtree(old, ignore_errors=True)


def _manifest(files: Mapping[str, bytes]) -> bytes:
    lines = [f"{_digest(content)}  {path}\n" for path, content in sorted(files.items())]
    return "".join(lines).encode()


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _digest_of(path: Path) -> str:
    with opened(path, most=sys.maxsize) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _check_own(folder: Path) -> None:
    """Refuse to replace a folder that holds anything but what an export wrote."""
    try:
        lines = read_text(folder / MANIFEST, most=DESCRIPTION).splitlines()
    except DataError:
        lines = []
    written = {line[66:]: line[:64] for line in lines}
    found = [path for path in folder.rglob("*") if path.is_file() or path.is_symlink()]
    for path in sorted(found):
        name = path.relative_to(folder).as_posix()
        own = not path.is_symlink() and written.get(name) == _digest_of(path)
        if name != MANIFEST and not own:
            raise DataError(
                f"{name} in it was not written by an export, or has been changed since",
                file=folder,
                remedy="move it away, or name another folder",
            )


def zipped(files: Mapping[str, bytes]) -> bytes:
    """Return files, by their path, as a zip; the same files give the same bytes."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(files):
            entry = zipfile.ZipInfo(path, OLDEST)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, files[path])
    return buffer.getvalue()
