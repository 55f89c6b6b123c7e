"""What a run writes: beside the earlier results, swapped in when complete, and never over the user's.

In a folder of results, ``run.json`` lists the files of the last complete run with their digests. A run
writes into ``unfinished/new``; when it is complete, a journal of what goes where is written, the files
are renamed, and ``run.json`` follows. Whoever finds a journal finishes what it says, so that a folder
holds one run wholly, whenever a process is killed.
"""

from __future__ import annotations

import hashlib
import json
import os
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from mckibben.errors import DataError
from mckibben.system import ordinary
from mckibben.system.atomic import demand_room, write_json, write_text, written

RUN = "run.json"
"""Lists the files of the last complete run of a folder."""

UNFINISHED = "unfinished"
"""In a folder of results: files of a run that is not complete, and its checkpoints."""

FORMAT = "mckibben-run"

MAKER = "drawn by mckibben"
"""In the metadata of figures."""

LARGEST = 2**34
"""Bytes of a file that is looked at; a larger one is not ours."""

FIGURES = (".png", ".svg", ".pdf")


def digest(content: bytes) -> str:
    """Return the SHA-256 of bytes, in hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


def claim(path: str | Path, *, inputs: Iterable[str | Path] = (), force: bool = False) -> None:
    """Refuse, before any work, an output that would replace what is not to be lost.

    Parameters
    ----------
    path : path
        File that will be written.
    inputs : iterable of path
        What is read for it; these are never replaced.
    force : bool
        Whether a file of the user's may be replaced: one that this package did not write, or that was
        changed since. A saved model that was edited counts as the package's.

    Raises
    ------
    DataError
        If it may not be replaced, or cannot be written.
    """
    from mckibben.files.own import description

    path = Path(path)
    refuse_inputs(path, inputs)
    beside = description(path)
    for one in [path] if beside is None else [path, beside]:
        with written(one):
            _claim(one, force)


def _claim(path: Path, force: bool) -> None:
    if path.is_dir():
        raise DataError("there is a folder of that name", file=path, remedy="name a file")
    if not path.parent.is_dir():
        raise DataError("its folder does not exist", file=path, remedy="create the folder first")
    link = path.is_symlink()
    if not link and path.exists() and not path.is_file():
        problem = "there is a device or a pipe of that name"
        raise DataError(problem, file=path, remedy="name a file")
    demand_room(path)
    if not force and (link or (path.exists() and path.stat().st_size)) and not is_ours(path):
        raise DataError(
            f"there is a {'link' if link else 'file'} of that name that this program did not write, "
            "or that was changed since",
            file=path,
            remedy="give another name, or replace it with `force`",
        )


def is_ours(path: Path) -> bool:
    """Return whether a file was written by this package, and is as it was; models may be edited."""
    from mckibben.blocks.saving import FORMAT as MODEL
    from mckibben.files.own import describes, is_own

    if path.is_symlink():
        return False
    if path.name in (listed := _listed(path.parent)):
        return _digest_of(path) == listed[path.name]
    if path.suffix == ".fmu" and zipfile.is_zipfile(path):
        with zipfile.ZipFile(path) as archive:
            return "sources/unit_model.h" in archive.namelist()
    try:
        with ordinary.opened(path, most=LARGEST) as file:
            start = file.read(256)
            if path.suffix in FIGURES:
                return MAKER.encode() in start + file.read()
    except DataError:
        return False
    if b"".join(start.split()).startswith(f'{{"format":"{MODEL}",'.encode()):
        return True
    return is_own(path) or describes(path)


def refuse_inputs(path: str | Path, inputs: Iterable[str | Path]) -> None:
    """Refuse an output that is an input, part of one, or the description beside one, by any name.

    Raises
    ------
    DataError
        If it is.
    """
    from mckibben.files.sources import read_with

    for given in inputs:
        for read in read_with(Path(given)):
            if _same(Path(path), read):
                raise DataError(
                    f"it is read from {read}, so it is not written to",
                    file=path,
                    remedy="give another name",
                )


def _same(one: Path, other: Path) -> bool:
    try:
        return one.samefile(other)
    except (OSError, ValueError):
        return os.path.normcase(os.path.realpath(one)) == os.path.normcase(os.path.realpath(other))


class Results:
    """The files of a run, in a folder that this process alone writes to; see `results_in`.

    Parameters
    ----------
    folder : Path
        Exists.
    inputs : iterable of Path
        What is read for the results; never replaced.
    force : bool
        Whether files of the user's may be replaced.
    """

    def __init__(self, folder: Path, *, inputs: Iterable[Path] = (), force: bool = False) -> None:
        self.folder, self.new = folder, folder / UNFINISHED / "new"
        self._inputs, self._force = list(inputs), force
        _finish(folder)
        for path in sorted(self.new.rglob("*"), reverse=True):  # of a run that was stopped
            path.rmdir() if path.is_dir() and not path.is_symlink() else path.unlink()
        self._digests: dict[str, str] = {}

    def claim(self, names: Iterable[str]) -> None:
        """Refuse now what could not be written later: files by their path in the folder."""
        for name in (RUN, *names):
            path = _inside(self.folder, name)
            if path.parent.is_dir():
                old = _listed(self.folder).get(name)
                own = old is not None and not path.is_symlink() and old == _digest_of(path)
                own = own or (name == RUN and bool(_listed(self.folder)))
                claim(path, inputs=self._inputs, force=self._force or own)

    def write_text(self, name: str, text: str) -> None:
        """Write a file in UTF-8, beside the earlier ones, by its path in the folder."""
        path = self.new / name
        with written(path):
            path.parent.mkdir(parents=True, exist_ok=True)
        write_text(path, text)
        self._digests[name] = digest(text.encode())

    def commit(self) -> None:
        """Put the files in their places, and remove those of the earlier run that were not changed."""
        earlier = _listed(self.folder)
        removed = {name: old for name, old in earlier.items() if name not in self._digests}
        journal = {"files": self._digests, "removed": removed}
        write_json(self.folder / UNFINISHED / "journal.json", journal)
        _finish(self.folder)
        self._digests = {}


@contextmanager
def results_in(
    folder: str | Path | None,
    names: Iterable[str],
    *,
    inputs: Iterable[Path] = (),
    force: bool = False,
) -> Iterator[Results | None]:
    """Give the results of a folder, made where it is missing; None where none are written.

    Parameters
    ----------
    folder : path or None
    names : iterable of str
        Files that will be written, by their path in the folder; claimed now.
    inputs, force
        As for `claim`.

    Raises
    ------
    DataError
        If another process writes there, or something may not be replaced.
    """
    if folder is None:
        yield None
        return
    from filelock import FileLock, Timeout

    folder = Path(folder)
    lock = folder / UNFINISHED / "lock"
    try:
        lock.parent.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        problem = "there is a file of that name"
        raise DataError(problem, file=folder, remedy="give a folder") from None
    except OSError as error:
        problem = f"it cannot be written ({error.strerror})"
        raise DataError(problem, file=folder, remedy="give a folder that can be") from None
    held = FileLock(lock, timeout=0)
    try:
        held.acquire()
    except Timeout:
        raise DataError(
            "another process is writing its results there",
            file=folder,
            remedy="wait until it has ended, or give another folder",
        ) from None
    try:
        found = Results(folder, inputs=inputs, force=force)
        found.claim(names)
        yield found
    finally:
        held.release()
        with suppress(OSError):
            lock.unlink()
        for place in (lock.parent / "new", lock.parent, folder):
            with suppress(OSError):  # not empty
                place.rmdir()


def _finish(folder: Path) -> None:
    """Finish what a journal says, if there is one: whoever was at it may have been killed."""
    place = folder / UNFINISHED / "journal.json"
    try:
        journal = json.loads(ordinary.read_text(place, most=ordinary.DESCRIPTION))
        files, removed = dict(journal["files"]), dict(journal["removed"])
    except (DataError, ValueError, TypeError, KeyError):
        return
    for name in files:
        new, path = folder / UNFINISHED / "new" / name, _inside(folder, name)
        if new.is_file():
            path.parent.mkdir(parents=True, exist_ok=True)
            new.replace(path)
    for name, old in removed.items():
        path = _inside(folder, name)
        if not path.is_symlink() and _digest_of(path) == old:
            path.unlink()
            with suppress(OSError):
                path.parent.rmdir()
    write_json(folder / RUN, {"format": FORMAT, "version": 1, "files": files})
    place.unlink()


def _listed(folder: Path) -> Mapping[str, str]:
    """Return the digests by file that the last run noted; none where it is absent or damaged."""
    try:
        found = json.loads(ordinary.read_text(folder / RUN, most=ordinary.DESCRIPTION))
        return dict(found["files"]) if found["format"] == FORMAT else {}
    except (DataError, ValueError, TypeError, KeyError):
        return {}


def _digest_of(path: Path) -> str | None:
    try:
        return digest(ordinary.read_bytes(path, most=LARGEST))
    except DataError:
        return None


def _inside(folder: Path, name: str) -> Path:
    """Return a file of a folder, whatever links and names a list may have."""
    path = folder / name
    if not path.parent.resolve().is_relative_to(folder.resolve()):
        problem = "its folder is a link that leads elsewhere"
        raise DataError(problem, file=path, remedy="remove the link")
    return path
