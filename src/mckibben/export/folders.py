"""Folders are written whole: under a temporary name, then renamed.

Each holds a manifest with a digest of every file, by which a later export knows what it may replace:
only what an export wrote, and nobody has changed since.
"""

from __future__ import annotations

import io
import shutil
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path

from mckibben.errors import DataError
from mckibben.system import manifest
from mckibben.system.atomic import PART, written

MANIFEST = "manifest.sha256"

OLDEST = (1980, 1, 1, 0, 0, 0)
"""Date of the files in a zip, so that the same model gives the same bytes."""


def refuse_folder(folder: Path, *, overwrite: bool = False) -> None:
    """Refuse to write a folder where there is something that is not to be replaced.

    Raises
    ------
    DataError
        If its parent is missing, or there is anything of that name but an empty folder or, with
        ``overwrite``, what an export wrote and nobody has changed since.
    """
    folder = folder.absolute()
    if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
        raise DataError(
            "there is a file of that name", file=folder, remedy="name a folder of its own"
        )
    with written(folder):
        full = folder.is_dir() and any(folder.iterdir())
    if full:
        if not overwrite:
            raise DataError(
                "the folder exists and is not empty",
                file=folder,
                remedy="name another, or --overwrite",
            )
        _check_own(folder)
    if not folder.parent.is_dir():
        raise DataError("its folder does not exist", file=folder, remedy="create the folder first")


def write_folder(folder: Path, files: Mapping[str, str], *, overwrite: bool = False) -> None:
    """Write files, by their path in the folder; what was there before stays until all is written.

    Parameters
    ----------
    folder : Path
        Where; its parent must exist.
    files : mapping of str to str
        Texts by relative path.
    overwrite : bool
        Whether what an export wrote there before may be replaced.

    Raises
    ------
    DataError
        As `refuse_folder` does, or if it cannot be written.
    """
    folder = folder.absolute()
    refuse_folder(folder, overwrite=overwrite)
    digests = {path: [manifest.digest(text.encode())] for path, text in files.items()}
    with written(folder):
        place = Path(tempfile.mkdtemp(prefix=PART, suffix=".part", dir=folder.parent))
        new, old = place / "new", place / "old"
        try:
            write_texts(new, {**files, MANIFEST: manifest.lines(digests)})
            if folder.exists():
                folder.rename(old)
            new.rename(folder)
        finally:
            # whatever happened in between, one of the two is there
            if old.exists() and not folder.exists():
                old.rename(folder)
            shutil.rmtree(place, ignore_errors=True)


def write_texts(folder: Path, texts: Mapping[str, str]) -> None:
    """Write texts by their path in a folder of one's own."""
    for path, text in texts.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(text.encode())


def _check_own(folder: Path) -> None:
    """Refuse to replace a folder that holds anything but what an export wrote."""
    digests = manifest.read(folder / MANIFEST)
    found = [path for path in folder.rglob("*") if path.is_symlink() or not path.is_dir()]
    for path in sorted(found):
        name = path.relative_to(folder).as_posix()
        if name != MANIFEST and not manifest.holds(path, digests.get(name, ())):
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
