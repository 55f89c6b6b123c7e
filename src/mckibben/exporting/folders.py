"""Export folders that are replaced as a whole, and reproducible zips."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from pathlib import Path

from mckibben.outputs import results_in

OLDEST = (1980, 1, 1, 0, 0, 0)
"""Date of the files in a zip, so that the same model gives the same bytes."""


def write_folder(folder: Path, files: Mapping[str, str], *, force: bool = False) -> None:
    """Write files, by their path in the folder; files of an earlier export are replaced.

    Raises
    ------
    DataError
        If a file of the user's has the name of one, without ``force``, or it cannot be written.
    """
    with results_in(folder, files, force=force, kind="export") as results:
        if results is not None:
            for name, text in files.items():
                results.write_text(name, text)
            results.commit()


def write_texts(folder: Path, texts: Mapping[str, str]) -> None:
    """Write texts by their path in a new folder."""
    for path, text in texts.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(text.encode())


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
