"""A folder of plain files for one user: who may write, names that cannot lead elsewhere, and a log.

Every file is written under a temporary name and renamed, so that whatever happens, what is there is
whole. Names come from a browser and from files: they are made safe here, and no path leaves the folder.
"""

from __future__ import annotations

import json
import os
import re
import stat
import sys
import time
import unicodedata
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path
from typing import Any

from mckibben.app import kept
from mckibben.errors import DataError
from mckibben.system.atomic import PART, write_text, written
from mckibben.system.ordinary import DESCRIPTION, opened, read_bytes

FOLDERS = (
    *("uploads", "recordings", "history", "models", "banded", "results", "jobs", "runs"),
    *("takeaway", "reviews", "forces"),
)

END_OF_LOG = 2**18
"""Bytes of the log that are read, from its end."""

PATIENCE = 5.0
"""For the jobs of a workbench that was killed to end [s]."""

NAME = re.compile(r"[^\W_][\w.-]{0,79}")
"""Letters and digits of any script; a person's own are no mistake."""

DEVICES = re.compile(r"con|prn|aux|nul|(com|lpt)[0-9¹²³]", re.IGNORECASE)
"""Names that no file may have on Windows, whatever its ending."""

TAKEN = ".json"
"""Ending of empty files that stand for a name, and can be nothing else: none is JSON."""


class Folder:
    """A folder of plain files, for nobody else on this machine.

    What a process writes here is for nobody else where it sets `os.umask`.

    Parameters
    ----------
    folder : str or Path
        Made where it is missing.

    Raises
    ------
    DataError
        If it cannot be made or written to, or is another user's, or a folder in it is that or a link to
        another place.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder).expanduser().resolve()
        self.read_only = ""
        """Why nothing may be written; empty where it may."""
        try:
            self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            for name in FOLDERS:
                inner = self.folder / name
                inner.mkdir(mode=0o700, exist_ok=True)
                if inner.is_symlink():
                    raise DataError(
                        "this is a link, and files would be written where it leads",
                        file=inner,
                        remedy="remove the link, or give another folder",
                    )
        except OSError as error:
            raise DataError(
                f"it cannot be a workspace ({error.strerror})",
                file=self.folder,
                remedy="give a folder that can be written to",
            ) from None
        for path, found in self._rights():
            if found.st_uid != os.getuid():
                raise DataError(
                    "this folder is another user's, who could read and change all that is done here",
                    file=path,
                    remedy="give a folder of your own",
                )

    def claim(self) -> bool:
        """Become the one that writes here until this process ends; tell whether that went well.

        Where another workbench is, or jobs of one that was killed have not ended yet, nothing is
        written from here on.

        Raises
        ------
        DataError
            If the disk cannot lock files, or cannot keep others out.
        """
        from filelock import FileLock, Timeout

        self._owner = FileLock(self.folder / ".owner", timeout=0, mode=0o600)
        with written(self.folder):
            try:
                self._owner.acquire()
                for path in self.folder.glob(".working-*"):
                    with FileLock(path, timeout=PATIENCE):
                        path.unlink(missing_ok=True)
            except Timeout:
                self.read_only = (
                    "jobs of a workbench that was killed have not ended yet"
                    if self._owner.is_locked
                    else "another workbench has this folder open"
                )
            else:
                self._tidy()
        for path, found in self._rights():
            if found.st_mode & 0o077:
                raise DataError(
                    "other users can get into this folder, and it cannot be closed to them",
                    file=path,
                    remedy="chmod it to 0700, or give a folder on a disk that knows rights of users",
                )
        return not self.read_only

    @contextmanager
    def work(self) -> Iterator[None]:
        """Let a job write here: whoever claims the folder after this process was killed waits for it."""
        from filelock import FileLock

        path = self.folder / f".working-{os.getpid()}"
        with written(path), FileLock(path, mode=0o600):
            yield
            path.unlink(missing_ok=True)

    def _tidy(self) -> None:
        """Take rights from others, and give names back that nothing came to bear.

        The folder may have been a person's before: what has no name of ours stays as it is, and so does
        all that is in folders further down.
        """
        folders = [self.folder / name for name in FOLDERS]
        inside = [path for folder in folders for path in folder.iterdir() if not path.is_dir()]
        for path in (self.folder, self.folder / "log.jsonl", *folders, *inside):
            with suppress(OSError):  # of a disk without rights, or of another user
                found = path.lstat()
                if stat.S_ISLNK(found.st_mode):
                    continue
                if stat.S_ISREG(found.st_mode) and path.parent in folders and _left(path, found):
                    path.unlink()
                elif found.st_mode & 0o077:
                    path.chmod(stat.S_IMODE(found.st_mode) & ~0o077)

        for door in self.folder.glob(".open-*.html"):  # of one that was killed: it holds a token
            with suppress(OSError):
                door.unlink()

    def _rights(self) -> Iterator[tuple[Path, os.stat_result]]:
        """Look up whose its folders are and who may enter; nothing where the system tells otherwise."""
        if os.name == "posix":
            for path in (self.folder, *(self.folder / name for name in FOLDERS)):
                with written(path):
                    found = path.lstat()
                yield path, found

    def demand(self) -> None:
        """Refuse where nothing may be written.

        Raises
        ------
        DataError
            Saying why.
        """
        if self.read_only:
            raise DataError(
                f"nothing can be changed here: {self.read_only}",
                file=self.folder,
                remedy="close the other workbench, then start this one again",
            )

    # -- names and files ---------------------------------------------------------------------

    def path(self, kind: str, name: str) -> Path:
        """Return where a file of a kind is kept.

        Raises
        ------
        DataError
            If the name is not a plain one, or stands for a link to another place.
        """
        if kind not in FOLDERS or not NAME.fullmatch(name) or ".." in name:
            raise DataError(
                f"{name!r:.80} cannot be a name here",
                remedy="use letters, digits, dots, dashes and underscores",
            )
        path = self.folder / kind / name
        if path.is_symlink():
            raise DataError("this is a link", file=path, remedy="put the file itself there")
        return path

    def new_path(self, kind: str, name: str) -> Path:
        """Return where a file is to be written; errors are those of `path` and `demand`."""
        self.demand()
        return self.path(kind, name)

    def new_name(self, kind: str, wish: str, ending: str = ".json") -> str:
        """Return a free name like the one wished for, whatever that holds, and take it.

        An empty file stands for a name that is taken until something is written; see `give_back`.
        Samples that no recording has, but undoing may bring back, take no name of a recording.

        Raises
        ------
        DataError
            If nothing can be written here.
        """
        self.demand()
        folder = self.folder / kind
        plain = _plain(kind, wish)
        if kind == "recordings":
            taken = set(self.names(kind))
        else:
            taken = {path.name.partition(".")[0] for path in folder.iterdir()}
        for number in count(1):
            name = plain if number == 1 else f"{plain}-{number}"
            if name in taken:
                continue
            path = folder / f"{name}{ending}"
            with written(path), suppress(FileExistsError):
                os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, mode=0o600))
                return name
        raise AssertionError

    def give_back(self, kind: str, name: str, ending: str = ".json") -> None:
        """Free a name that nothing was written under."""
        with suppress(OSError, DataError):
            path = self.path(kind, f"{name}{ending}")
            if not path.stat().st_size:
                path.unlink()

    def write_json(self, kind: str, name: str, content: Mapping[str, Any]) -> Path:
        """Write a JSON file."""
        path = self.new_path(kind, f"{name}.json")
        write_text(path, json.dumps(content, indent=2) + "\n")
        return path

    def read_json(self, kind: str, name: str) -> dict[str, Any] | None:
        """Return what a JSON file holds, or None if it is missing or damaged."""
        try:
            content = kept.parsed(read_bytes(self.path(kind, f"{name}.json"), most=DESCRIPTION))
        except DataError:
            return None
        return content if isinstance(content, dict) else None

    def names(self, kind: str) -> list[str]:
        """Return the names of all JSON files of a kind; those that are only taken are none yet."""
        found = (path.name for path in (self.folder / kind).glob("*.json") if _written(path))
        return sorted(
            name.removesuffix(".json")
            for name in found
            if NAME.fullmatch(name) and not name.endswith("-metadata.json")
        )

    def log(self, what: str, call: str = "") -> None:
        """Append a line to the log of what was done, where it may be written.

        Raises
        ------
        DataError
            If the disk is full, or the like.
        """
        if self.read_only:
            return
        now = time.strftime("%Y-%m-%dT%H:%M:%S%z")
        line = json.dumps({"time": now, "did": short(what), "call": short(call)})
        path = self.folder / "log.jsonl"
        flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND | getattr(os, "O_NOFOLLOW", 0)
        flags |= getattr(os, "O_NONBLOCK", 0)
        with written(path), os.fdopen(os.open(path, flags, 0o600), "ab") as file:
            file.write(line.encode() + b"\n")

    def logged(self) -> list[dict[str, str]]:
        """Return the end of the log, oldest first; damaged lines are passed over."""
        path = self.folder / "log.jsonl"
        try:
            with opened(path, most=sys.maxsize) as file:
                size = file.seek(0, os.SEEK_END)
                file.seek(max(size - END_OF_LOG, 0))
                content = file.read(END_OF_LOG)
        except DataError:
            return []
        if size > END_OF_LOG:
            content = content.partition(b"\n")[2]
        return [line.model_dump() for line in kept.lines(content)]


def _plain(kind: str, wish: str) -> str:
    """Return the name most like the one wished for, of those that every disk takes."""
    composed = unicodedata.normalize("NFC", wish)
    plain = re.sub(r"[^\w-]+", "-", composed).strip("-_")[:40] or kind.rstrip("s")
    return f"{kind.rstrip('s')}-{plain}" if DEVICES.fullmatch(plain) else plain


def _left(path: Path, found: os.stat_result) -> bool:
    """Tell whether a file is a temporary one, or but stands for a name: both of a process that ended."""
    if path.name.startswith(PART):
        return path.suffix == ".part"
    return not found.st_size and path.suffix == TAKEN and NAME.fullmatch(path.name) is not None


def _written(path: Path) -> bool:
    try:
        return path.lstat().st_size > 0
    except OSError:
        return False


def short(text: str) -> str:
    """Return a text as it can be kept: of no more than so many characters, all of them such."""
    return text[: kept.LONGEST].encode("utf-8", "replace").decode()
