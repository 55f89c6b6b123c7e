"""Manifests: a digest of every file in a folder, by which a later run knows what it may replace.

Only what this program wrote, and nobody has changed since. ``sha256sum --check`` reads them, and passes
over the first line, by which a manifest is told from a list of digests that somebody else made.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from pathlib import Path

from mckibben.errors import DataError
from mckibben.system import ordinary

HEAD = "# what mckibben wrote here\n"
"""First line of a manifest."""

LARGEST_FILE = 2**34
"""Bytes of a file whose digest is taken; a larger one is not ours."""


def digest(content: bytes) -> str:
    """Return the SHA-256 of bytes, in hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


def lines(digests: Mapping[str, Iterable[str]]) -> str:
    """Return the text of a manifest of these files, each with the digests that it may have."""
    return HEAD + "".join(
        f"{one}  {name}\n" for name in sorted(digests) for one in sorted(digests[name])
    )


def is_manifest(path: Path) -> bool:
    """Tell whether a file begins as a manifest of this program does."""
    return _text(path).startswith(HEAD)


def read(path: Path) -> dict[str, set[str]]:
    """Return the digests by file that a manifest has; none of one that is absent or damaged.

    Any list of digests is read, as older exports have them without the first line; see `is_manifest`.
    """
    found: dict[str, set[str]] = {}
    for line in _text(path).splitlines():
        if not line.startswith("#"):
            found.setdefault(line[66:], set()).add(line[:64])
    return found


def _text(path: Path) -> str:
    try:
        return ordinary.read_text(path, most=ordinary.DESCRIPTION)
    except DataError:
        return ""


def holds(path: Path, digests: Iterable[str]) -> bool:
    """Tell whether a file is an ordinary one, no link, with one of these digests."""
    wanted = set(digests)
    if not wanted or path.is_symlink():
        return False
    try:
        with ordinary.opened(path, most=LARGEST_FILE) as file:
            found = hashlib.sha256()
            while chunk := file.read(2**20):
                found.update(chunk)
            return found.hexdigest() in wanted
    except DataError:
        return False
