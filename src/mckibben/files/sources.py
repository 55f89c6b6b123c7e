"""What a path stands for: a file, files with one signal each, a bag's folder, or several recordings."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from io import BufferedReader
from pathlib import Path

from mckibben.errors import DataError
from mckibben.files import formats, signals
from mckibben.files.channels import NAME, described
from mckibben.files.own import description
from mckibben.files.request import Request
from mckibben.files.table import Table
from mckibben.system.ordinary import DESCRIPTION, opened, read_text

BAG = "metadata.yaml"
"""In the folder of a bag of ROS 2."""

PACKED = ".zstd"
"""Ending of the files of a bag that were packed as a whole."""

PROTOCOL = "protocol.json"
"""Tells in a folder what each recording in it is for."""


def is_bag(path: Path) -> bool:
    """Tell whether a folder is a bag of ROS 2."""
    return path.is_dir() and (path / BAG).is_file()


def inside(path: Path) -> list[Path]:
    """Return what to read the recordings of a path from: itself, unless it is a folder of several.

    Of files that are one recording, as ``channels.toml`` has it, the first stands for all.

    Raises
    ------
    DataError
        If it is a folder without recordings, or of files with one signal each that cannot be told.
    """
    if not path.is_dir() or is_bag(path):
        return [path]
    found = _files(path) + [each for each in _listed(path) if is_bag(each)]
    if not found:
        raise DataError("there is no recording in the folder", file=path, remedy="name files")
    if os.path.lexists(path / PROTOCOL):
        return found
    said = described(path)
    firsts: dict[Path, None] = {}
    for each in found:
        together = said.joined(each.name)
        firsts[path / next(iter(together.values())) if together else each] = None
    if len(firsts) == len(found) and not any(map(is_bag, found)) and signals.are_one(found, said):
        return [path]
    return list(firsts)


def roles(folder: Path) -> dict[str, list[Path]]:
    """Return the recordings of a folder by role, as its protocol.json has them, or all to train.

    A folder that is one recording itself, as of files with one signal each, stands for that.

    Raises
    ------
    DataError
        If there are none, or it cannot be told which files are one.
    """
    protocol = folder / PROTOCOL
    found = inside(folder)
    if not os.path.lexists(protocol):
        return {"train": found}
    text = read_text(protocol, most=DESCRIPTION)
    try:
        given = {str(run["name"]): str(run["role"]) for run in json.loads(text)["runs"]}
    except (ValueError, KeyError, TypeError, RecursionError):
        raise DataError(
            "its protocol.json is not readable", file=folder, remedy="repair or remove it"
        ) from None
    by_role: dict[str, list[Path]] = {}
    for path in found:
        by_role.setdefault(given.get(path.stem, "train"), []).append(path)
    return by_role


def expanded(
    files: Sequence[Path], test: Sequence[Path]
) -> tuple[list[Path], list[Path], list[Path]]:
    """Return files to train, to validate and to test on, folders replaced by what is in them.

    Parameters
    ----------
    files : sequence of Path
        Files to train on; of folders, each recording has its own role.
    test : sequence of Path
        Files to test on; of folders, everything.

    Raises
    ------
    DataError
        On a folder without recordings.
    """
    found: dict[str, list[Path]] = {"train": [], "validation": [], "test": []}
    for file in files:
        for role, paths in (roles(file) if file.is_dir() else {"train": [file]}).items():
            found.setdefault(role, []).extend(paths)
    for file in test:
        several = roles(file).values() if file.is_dir() else [[file]]
        found["test"] += [path for paths in several for path in paths]
    return found["train"], found["validation"], found["test"]


def tables(path: Path, request: Request) -> tuple[list[Table], str]:
    """Return what is in a recording as it stands there, and the SHA-256 of its files.

    Errors are those of `mckibben.files.formats.read` and `mckibben.files.signals.joined`.
    """
    if is_bag(path):
        return _bag(path, request.most)
    if path.is_dir():
        parts = {each.stem: each for each in _files(path)}
    else:
        together = described(path.parent).joined(path.name)
        parts = {name: path.with_name(file) for name, file in together.items()} or {"": path}
    found: dict[Path, list[Table]] = {}
    digests: dict[Path, str] = {}
    for each in parts.values():
        with _unchanged(each, digests, request.most) as file:
            found[each] = formats.read(file, each)
    if len(found) == 1:
        return next(iter(found.values())), _one(digests.values())
    for each, several in found.items():
        if len(several) > 1:
            raise DataError(
                f"it holds {len(several)} recordings, where one signal is expected",
                file=each,
                remedy=f"leave it out of join in {NAME}",
            )
    one = signals.joined(
        {each: several[0] for each, several in found.items()}, list(parts), request
    )
    return [one], _one(digests.values())


def _bag(folder: Path, most: float) -> tuple[list[Table], str]:
    parts = _files(folder)
    if not parts:
        raise DataError(
            "there is no .db3 or .mcap file in it", file=folder, remedy="copy all of it"
        )
    digests: dict[Path, str] = {}
    with ExitStack() as stack:
        for each in parts:
            stack.enter_context(_unchanged(each, digests, most))
        found = formats.bag(folder)
    return found, _one(digests[each] for each in parts)


@contextmanager
def _unchanged(path: Path, digests: dict[Path, str], most: float) -> Iterator[BufferedReader]:
    """Open a file, note its SHA-256 at the end, and refuse it if it changed in between."""
    with opened(path, most=int(most)) as file:
        before = os.fstat(file.fileno())
        yield file
        file.seek(0)
        digests[path] = hashlib.file_digest(file, "sha256").hexdigest()
        after = os.fstat(file.fileno())
    if (before.st_mtime_ns, before.st_size) != (after.st_mtime_ns, after.st_size):
        raise DataError(
            "it changed while it was read",
            file=path,
            remedy="wait until whatever writes it is done, then read it again",
        )


def _one(digests: Iterable[str]) -> str:
    """Return the digest of a recording of those of its files."""
    several = list(digests)
    if len(several) == 1:
        return several[0]
    return hashlib.sha256("".join(several).encode()).hexdigest()


def read_with(path: Path) -> list[Path]:
    """Return all files that are read where this one is, or this folder; some may be missing.

    They are the parts of recordings and what describes them; a file of another kind stands alone.
    """
    if path.is_dir():
        bags = (each for each in _listed(path) if is_bag(each))
        parts = [*_files(path), *(file for bag in bags for file in _files(bag))]
        about = [path / NAME, path / PROTOCOL, path / BAG]
    elif path.suffix.casefold() in formats.READERS:
        together = described(path.parent).joined(path.name)
        parts = [path, *(path.with_name(name) for name in together.values())]
        about = [path.with_name(NAME)]
    else:
        return [path]
    return [*parts, *filter(None, map(description, parts)), *about]


def _files(folder: Path) -> list[Path]:
    endings = {*formats.SOUGHT, *([PACKED] if is_bag(folder) else ())}
    found = (each for each in _listed(folder) if each.suffix.casefold() in endings)
    return [each for each in found if each.is_file()]


def _listed(folder: Path) -> list[Path]:
    try:
        return sorted(folder.iterdir())
    except OSError as error:
        raise DataError(
            f"it cannot be read ({(error.strerror or str(error)).lower()})",
            file=folder,
            remedy="check the folder and its rights",
        ) from None
