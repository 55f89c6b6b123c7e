"""What commands may replace: never an input, nor a file of others.

What it wrote is known by what is in it: a model and a rig by how they begin, a recording by its
description and the digest there, a figure by the digest in its seal, and what is in a folder of results
by the folder's manifest. Functions of the library that are given a path, such as `mckibben.write` and
`Block.save`, write what their caller asks for; the command line asks here first, before any work.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path

from mckibben.errors import DataError
from mckibben.system import manifest, ordinary
from mckibben.system.atomic import demand_room, write_text, written
from mckibben.system.seals import is_sealed

MANIFEST = "results.sha256"
"""Of a folder of results."""

RESULTS = re.compile(
    r"(leaderboard|characterization|inverse|tables)\.json|leaderboard\.csv|report\.html"
    r"|models/[\w.-]+\.json"
)
"""Names in such a folder that commands give, and that a later run may remove."""

BEGINNING = 256
"""Bytes in which models and rigs say what they are."""

LARGEST_FIGURE = 256 * 2**20
"""Bytes; a larger one is not ours."""


def is_model(path: Path) -> bool:
    """Tell whether a file is a model, inverse or controller that this program saved.

    One that was edited by hand since still counts as that.
    """
    from mckibben.blocks.saving import FORMAT

    start = b"".join(_beginning(path).split())
    return start.startswith(f'{{"format":"{FORMAT}",'.encode())


def is_recording(path: Path) -> bool:
    """Tell whether a file is a recording that this program wrote, unchanged since."""
    from mckibben.files.own import is_own

    return is_own(path)


def is_figure(path: Path) -> bool:
    """Tell whether a file is a figure that this program drew, unchanged since."""
    try:
        return is_sealed(ordinary.read_bytes(path, most=LARGEST_FIGURE))
    except DataError:
        return False


def never(path: Path) -> bool:
    """Tell that a file is its user's, whoever wrote it."""
    del path
    return False


def _beginning(path: Path) -> bytes:
    try:
        with ordinary.opened(path, most=manifest.LARGEST_FILE) as file:
            return file.read(BEGINNING)
    except DataError:
        return b""


def claim(
    path: Path,
    ours: Callable[[Path], bool],
    *,
    inputs: Iterable[Path] = (),
    force: bool = False,
) -> None:
    """Refuse an output that would take the place of what is not to be lost.

    Parameters
    ----------
    path : Path
        File that will be written.
    ours : callable
        Tells of a file whether it is what is written again and again: `is_model`, `is_recording`,
        `is_figure`, or `never`.
    inputs : iterable of Path
        What is read for it; these are never replaced.
    force : bool
        Whether a file that is not ours may be replaced.

    Raises
    ------
    DataError
        If it is an input, by whatever name or link; or a file with something in it that is not ours,
        or a link, without ``force``; or nothing that a file can replace, or its folder cannot be
        written to.
    """
    refuse_inputs(path, inputs)
    with written(path):
        if path.is_dir():
            raise DataError("there is a folder of that name", file=path, remedy="name a file")
        if not path.parent.is_dir():
            raise DataError(
                "its folder does not exist", file=path, remedy="create the folder first"
            )
        link = path.is_symlink()
        if not link and path.exists() and not path.is_file():
            raise DataError(
                "there is a device or a pipe of that name", file=path, remedy="name a file"
            )
        demand_room(path)
        if force or not (link or (path.exists() and path.stat().st_size)):
            return
    if link or not ours(path):
        raise _strange(path, changed=ours is not is_model)


def _strange(path: Path, *, changed: bool) -> DataError:
    what = "a link" if path.is_symlink() else "a file"
    since = ", or that was changed since" if changed else ""  # an edited model is ours
    return DataError(
        f"there is {what} of that name that this program did not write{since}",
        file=path,
        remedy="give another name, or replace it with --force",
    )


def claim_model(path: Path, *, inputs: Iterable[Path], force: bool) -> None:
    """Refuse to write a model over an input or a stranger's file; see `claim`."""
    claim(path, is_model, inputs=inputs, force=force)


def claim_figure(path: Path, *, inputs: Iterable[Path], force: bool) -> None:
    """Refuse to draw over an input or a stranger's file, likewise."""
    claim(path, is_figure, inputs=inputs, force=force)


def claim_recording(path: Path, *, inputs: Iterable[Path], force: bool) -> None:
    """Refuse to write a recording, and its description beside it, likewise."""
    from mckibben.files.formats import writer
    from mckibben.files.own import describes, description

    writer(path)  # another ending is refused now
    inputs = list(inputs)
    claim(path, is_recording, inputs=inputs, force=force)
    beside = description(path)
    if beside is not None:
        claim(beside, describes, inputs=inputs, force=force)


def refuse_inputs(path: Path, inputs: Iterable[Path]) -> None:
    """Refuse an output that is an input, part of one, or the description beside one.

    Raises
    ------
    DataError
        Whatever name it goes by: another spelling, a link, or a second name of the same file.
    """
    from mckibben.files.sources import read_with

    for given in inputs:
        for read in read_with(given):
            if _same(path, read):
                raise DataError(
                    f"it is read from {read}, so it is not written to",
                    file=path,
                    remedy="give another name with -o",
                )


def _same(one: Path, other: Path) -> bool:
    try:
        return one.samefile(other)
    except (OSError, ValueError):
        return os.path.normcase(os.path.realpath(one)) == os.path.normcase(os.path.realpath(other))


class Results:
    """A folder of results, whose manifest tells them from what else is there.

    Parameters
    ----------
    folder : Path
        Exists.
    inputs : iterable of Path
        What is read for the results; never replaced.
    force : bool
        Whether a file that is not ours may be replaced.
    """

    def __init__(self, folder: Path, *, inputs: Iterable[Path] = (), force: bool = False) -> None:
        self.folder = folder
        self._inputs, self._force = list(inputs), force
        listed = folder / MANIFEST
        # a list of digests that the user made says nothing of who wrote the files
        self._digests = manifest.read(listed) if manifest.is_manifest(listed) else {}
        self._claimed: set[str] = set()

    def claim(self, names: Iterable[str]) -> None:
        """Refuse now what could not be written later.

        Parameters
        ----------
        names : iterable of str
            Of files that will be written, by their path in the folder.

        Raises
        ------
        DataError
            As `mckibben.outputs.claim` does.
        """
        listed = self.folder / MANIFEST
        claim(listed, manifest.is_manifest, inputs=self._inputs, force=self._force)
        for name in names:
            path = self._path(name)
            if path.parent.is_dir():
                own = partial(self._own, name=name)
                claim(path, own, inputs=self._inputs, force=self._force)
            self._claimed.add(name)

    def clear(self) -> None:
        """Remove the results of an earlier run, but what was changed since; nothing else is touched."""
        for name in self._digests:
            path = self.folder / name
            if RESULTS.fullmatch(name) and self._inside(path) and self._own(path, name):
                refuse_inputs(path, self._inputs)
                with written(path):
                    path.unlink()
        self._digests = {}

    def write_text(self, name: str, text: str) -> None:
        """Write a file in UTF-8, by its path in the folder.

        Raises
        ------
        DataError
            If it cannot be written, or is not to be replaced.
        """
        if name not in self._claimed:
            self.claim([name])
        digest = manifest.digest(text.encode())
        before = self._digests.get(name, set())
        # noted first, so that whenever this is stopped, nothing is left that the manifest does not know
        self._note(name, before | {digest})
        path = self._path(name)
        with written(path):
            path.parent.mkdir(exist_ok=True)
        write_text(path, text)
        if before - {digest}:
            self._note(name, {digest})

    def _note(self, name: str, digests: set[str]) -> None:
        self._digests[name] = digests
        write_text(self.folder / MANIFEST, manifest.lines(self._digests))

    def _own(self, path: Path, name: str) -> bool:
        return manifest.holds(path, self._digests.get(name, ()))

    def _path(self, name: str) -> Path:
        path = self.folder / name
        if not self._inside(path):
            raise DataError(
                "its folder is a link that leads elsewhere", file=path, remedy="remove the link"
            )
        return path

    def _inside(self, path: Path) -> bool:
        """Tell whether a file is in the folder, whatever links and names a manifest may have."""
        return path.parent.resolve().is_relative_to(self.folder.resolve())
