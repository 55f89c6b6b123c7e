"""Output files of a run: replaced together when complete, and never overwriting the user's.

In a folder of results, ``run.json`` lists the files of the last complete run with their digests. A run
writes into ``unfinished/new``, and moves the files to their places when it is complete.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from mckibben.errors import DataError
from mckibben.printing import encoded
from mckibben.system import ordinary
from mckibben.system.atomic import demand_room, digest, write_json, write_text, written

RUN = "run.json"
"""File that lists the files of the last complete run in a folder."""

UNFINISHED = "unfinished"
"""Folder, in a folder of results, with the files and checkpoints of an incomplete run."""

FORMAT = "mckibben-run"

MAKER = "drawn by mckibben"
"""Creator in the metadata of figures."""

FIGURES = (".png", ".svg", ".pdf")

LARGEST_INSPECTED = 2**28
"""Largest file that is inspected [bytes]; a larger one counts as the user's."""


def unfinished(folder: Path) -> Path:
    """Return the folder of a run's files until it is complete."""
    return folder / UNFINISHED / "new"


def claim(path: str | Path, *, inputs: Iterable[str | Path] = (), force: bool = False) -> None:
    """Raise an error, before any work, for an output that would overwrite a user's file or an input.

    Parameters
    ----------
    path : path
        File that will be written; of a text file with a recording, also the description beside it.
    inputs : iterable of path
        What is read for it; these are never replaced.
    force : bool
        Whether a file of the user's may be replaced: one that this package did not write, or that was
        changed since. A saved model or a figure that was edited counts as the package's.

    Raises
    ------
    DataError
        If it may not be replaced, or cannot be written.
    """
    from mckibben.files.own import description

    path, inputs = Path(path), list(inputs)
    for output in filter(None, (path, description(path))):
        _claim(output, inputs, force, is_ours(output))


def _claim(path: Path, inputs: Iterable[str | Path], force: bool, ours: bool) -> None:
    refuse_inputs(path, inputs)
    demand_room(path)
    with written(path):
        link = path.is_symlink()
        in_the_way = link or (path.exists() and path.stat().st_size)
    if in_the_way and not force and (link or not ours):
        raise DataError(
            f"there is a {'link' if link else 'file'} of that name that this program did not write, "
            "or that was changed since",
            file=path,
            remedy="give another name, or replace it with `force`",
        )


def is_ours(path: Path) -> bool:
    """Return whether a file was written by this package and is unchanged; models may be edited."""
    from mckibben.files.own import is_own

    listed = _listed_digests(path.parent)
    if path.name in listed:
        return _has_digest(path, listed[path.name])
    with (
        suppress(DataError, zipfile.BadZipFile),
        ordinary.opened(path, most=LARGEST_INSPECTED) as file,
    ):
        if path.suffix == ".fmu":
            return "sources/unit_model.h" in zipfile.ZipFile(file).namelist()
        if path.suffix == ".xml":
            first, _, rest = file.read().partition(b"\n")
            return first == marked(rest).partition(b"\n")[0]
        start = file.read(256)
        if path.suffix.lower() in FIGURES:
            return MAKER.encode() in start + file.read()
        if b"".join(start.split()).startswith(b'{"format":"mckibben-'):
            return True
    return is_own(path)


def marked(text: bytes) -> bytes:
    """Return an XML file with its digest in a leading comment."""
    return b"<!-- mckibben %s -->\n" % hashlib.sha256(text).hexdigest().encode() + text


def claim_recording(
    path: str | Path, *, inputs: Iterable[str | Path] = (), force: bool = False
) -> None:
    """Raise an error for an output recording likewise, or if it is no CSV."""
    from mckibben.files.own import require_csv

    require_csv(Path(path))
    claim(path, inputs=inputs, force=force)


def refuse_inputs(path: str | Path, inputs: Iterable[str | Path]) -> None:
    """Raise an error for an output that is an input, part of one, or its description.

    Raises
    ------
    DataError
        If it is.
    """
    from mckibben.files.sources import read_with

    for given in inputs:
        for source in read_with(Path(given)):
            if _same(Path(path), source):
                problem = f"it is read from {source}, so it is not written to"
                raise DataError(problem, file=path, remedy="give another name")


def _same(first: Path, second: Path) -> bool:
    try:
        return first.samefile(second)
    except (OSError, ValueError):
        return os.path.normcase(os.path.realpath(first)) == os.path.normcase(
            os.path.realpath(second)
        )


class Results:
    """The files of a run, in a locked folder; see `results_in`.

    Parameters
    ----------
    folder : Path
        Exists.
    inputs : iterable of path
        What is read for the results; never replaced.
    force : bool
        Whether files of the user's, and results of another kind, may be replaced.
    kind : str
        What operation writes.
    """

    def __init__(
        self,
        folder: Path,
        *,
        inputs: Iterable[str | Path] = (),
        force: bool = False,
        kind: str = "",
    ) -> None:
        self.folder, self.new = folder, unfinished(folder)
        self._inputs, self._force, self._kind = list(inputs), force, kind
        self._digests: dict[str, str] = {}
        _path_inside(folder, f"{UNFINISHED}/new/{RUN}")
        with written(self.new):
            if self.new.exists():  # of a run that was stopped
                shutil.rmtree(self.new)

    def claim(self, names: Iterable[str]) -> None:
        """Raise an error now for files that could not be written later, by path in the folder.

        Only what is listed in ``run.json``, and was not changed since, is replaced without ``force``.
        """
        listed, earlier = _listed_digests(self.folder), _record(self.folder).get("kind", self._kind)
        if earlier != self._kind and not self._force:  # whose files this run would remove
            problem = f"it has results of {earlier}"
            remedy = "give another folder, or replace all of them with `force`"
            raise DataError(problem, file=self.folder, remedy=remedy)
        for name in (RUN, *names):
            path = _path_inside(self.folder, name)
            nearest = next(each for each in path.parents if os.path.lexists(each))
            if not nearest.is_dir():
                problem = "the output folder has the name of a file"
                raise DataError(
                    problem, file=nearest, remedy="move it away, or give another folder"
                )
            if nearest == path.parent:
                is_package_file = (
                    bool(listed) if name == RUN else _has_digest(path, listed.get(name))
                )
                _claim(path, self._inputs, self._force, is_package_file)

    def write_text(self, name: str, text: str) -> None:
        """Write a file in UTF-8 for the run, by its path in the folder."""
        path = _path_inside(self.new, name)
        with written(path):
            path.parent.mkdir(parents=True, exist_ok=True)
        write_text(path, text)
        self._digests[name] = digest(encoded(text))

    def commit(self) -> None:
        """Move the files to their places, and remove unchanged files of the earlier run.

        Raises
        ------
        DataError
            If a file in their places was changed while the run went.
        """
        self.claim(self._digests)
        for name, digest_before in _listed_digests(self.folder).items():
            if name not in self._digests and self._removable(name, digest_before):
                path = self.folder / name
                with written(path):
                    path.unlink()
                with suppress(OSError):  # not empty
                    path.parent.rmdir()
        run = {"format": FORMAT, "version": 1, "kind": self._kind, "files": self._digests}
        write_json(self.new / RUN, run)
        for name in (*self._digests, RUN):
            path = self.folder / name
            with written(path):
                path.parent.mkdir(parents=True, exist_ok=True)
                (self.new / name).replace(path)
        _prune(self.new)
        self._digests = {}

    def _removable(self, name: str, old: str) -> bool:
        """Return whether a listed file is in the folder and unchanged, and is not an input."""
        with suppress(DataError):
            path = _path_inside(self.folder, name)
            refuse_inputs(path, self._inputs)
            return _has_digest(path, old)
        return False


@contextmanager
def results_in(
    folder: str | Path | None,
    names: Iterable[str],
    *,
    inputs: Iterable[str | Path] = (),
    force: bool = False,
    kind: str = "",
) -> Iterator[Results | None]:
    """Open a folder of results, created if missing, locked for this process.

    Parameters
    ----------
    folder : path or None
        None where no results are written.
    names : iterable of str
        Files that will be written, by their path in the folder; claimed now.
    inputs, force
        As for `claim`.
    kind : str
        What operation writes. A folder has results of one.

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
    run_folder, new_files = folder / UNFINISHED, unfinished(folder)
    lock, existed = run_folder / "lock", folder.exists()
    with written(folder):
        if new_files.exists() and not lock.exists():
            problem = "it blocks unfinished results, and was not written by mckibben"
            raise DataError(problem, file=new_files, remedy="move it away, or give another folder")
        run_folder.mkdir(parents=True, exist_ok=True)
        file_lock = FileLock(lock, timeout=0)
        try:
            file_lock.acquire()
        except Timeout:
            problem = "another process is writing its results there"
            remedy = "wait until it has ended, or give another folder"
            raise DataError(problem, file=folder, remedy=remedy) from None
    try:
        results = Results(folder, inputs=inputs, force=force, kind=kind)
        results.claim(names)
        yield results
    finally:
        _prune(new_files)
        if not new_files.exists():
            lock.unlink(missing_ok=True)
        file_lock.release()
        for unused in (run_folder, folder) if not existed else (run_folder,):
            with suppress(OSError):  # not empty
                unused.rmdir()


def _prune(folder: Path) -> None:
    """Remove folders that are empty."""
    for place, _, _ in os.walk(folder, topdown=False):
        with suppress(OSError):
            Path(place).rmdir()


def _listed_digests(folder: Path) -> Mapping[str, str]:
    """Return the digests by file of the last run; empty if missing or damaged."""
    files = _record(folder).get("files")
    return files if isinstance(files, dict) else {}


def _record(folder: Path) -> Mapping[str, Any]:
    """Return the record of the last run; empty if missing or damaged."""
    try:
        record = json.loads(ordinary.read_text(folder / RUN, most=ordinary.DESCRIPTION))
        return dict(record) if record["format"] == FORMAT else {}
    except (DataError, ValueError, TypeError, KeyError):
        return {}


def _has_digest(path: Path, expected: str | None) -> bool:
    """Return whether a file, not a link, has this digest."""
    if path.is_symlink():
        return False
    try:
        return digest(ordinary.read_bytes(path, most=LARGEST_INSPECTED)) == expected
    except DataError:
        return False


def _path_inside(folder: Path, name: str) -> Path:
    """Return a file of a folder; raise an error if links or the name lead outside."""
    path = folder / name
    if not path.parent.resolve().is_relative_to(folder.resolve()):
        problem = "its folder is a link that leads elsewhere"
        raise DataError(problem, file=path, remedy="remove the link")
    return path
