"""A folder that holds all that was done: recordings, models, results, and a log, as plain files.

Every file is written under a temporary name and renamed, so that whatever happens, what is there is
whole. Names come from a browser and from files: they are made safe here, and no path leaves the folder.
"""

from __future__ import annotations

import json
import os
import re
import stat
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, Literal, TypeVar

from mckibben.app import kept
from mckibben.app.claim import Lock
from mckibben.app.guard import LARGEST_UPLOAD
from mckibben.atomic import replacing, write_text, written
from mckibben.comparison.limits import caution
from mckibben.errors import DataError, MckibbenError, ModelError
from mckibben.ordinary import DESCRIPTION, opened, read_bytes

if TYPE_CHECKING:  # loaded when they are first used, so that the page is there at once
    from mckibben.blocks.base import Block
    from mckibben.recording import Recording

Role = Literal["train", "test", "unused"]
Stamp = tuple[int, int, int]

FOLDERS = ("uploads", "recordings", "models", "results", "jobs", "runs", "takeaway")

ARCHIVES = (".zip", ".gz", ".tgz", ".tar", ".7z", ".rar", ".bz2", ".xz")

LONG = 200_000
"""Samples beyond which recordings are kept as Parquet instead of CSV."""

MOST_CELLS = 40_000_000
"""Samples times channels of the recordings that are held in memory, the one in use aside."""

MOST_MODELS = 500
"""Models held in memory."""

END_OF_LOG = 2**18
"""Bytes of the log that are read, from its end."""

PATIENCE = 5.0
"""For the jobs of a workbench that was killed to end [s]."""

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,79}")


@dataclass(frozen=True)
class Entry:
    """A recording of the workspace.

    Parameters
    ----------
    name : str
        Its name here.
    role : {"train", "test", "unused"}
        What it is used for.
    origin : str
        Where it came from, in words.
    call : str
        The Python that gives the same recording.
    path : Path
        Its file.
    notes : tuple of str
        What was said when it was read.
    """

    name: str
    role: Role
    origin: str
    call: str
    path: Path
    notes: tuple[str, ...] = ()


Value = TypeVar("Value")


class Cache(Generic[Value]):
    """What files hold, read again only when they have changed, wherever the clock stands.

    Parameters
    ----------
    most : int
        Of the sizes of all that is kept together.
    """

    def __init__(self, most: int) -> None:
        self.most = most
        self._kept: dict[Path, tuple[Stamp, Value | MckibbenError, int]] = {}
        self._lock = threading.Lock()

    def get(self, path: Path, make: Callable[[], tuple[Value, int]]) -> Value:
        """Return what a file holds; ``make`` reads it, and tells its size.

        Raises
        ------
        MckibbenError
            If it is missing, or ``make`` says that it is damaged; that is remembered likewise.
        """
        try:
            found = path.stat()
        except OSError as error:
            raise DataError(
                f"it cannot be read ({error.strerror})", file=path, remedy="add it again"
            ) from None
        if not stat.S_ISREG(found.st_mode):
            raise DataError("this is no ordinary file", file=path, remedy="remove it")
        stamp = found.st_mtime_ns, found.st_size, found.st_ino
        known = self._kept.get(path)
        if known is None or known[0] != stamp:
            try:
                known = (stamp, *make())
            except MckibbenError as error:
                known = stamp, error, 1
            except Exception as error:  # of a file made to raise anything at all
                text = f"{path}: damaged ({type(error).__name__}: {error}). Remedy: remove it."
                known = stamp, ModelError(text), 1
        with self._lock:
            self._kept.pop(path, None)
            self._kept[path] = known  # the last used is the last to go
            while len(self._kept) > 1 and sum(size for *_, size in self._kept.values()) > self.most:
                del self._kept[next(iter(self._kept))]
        value = known[1]
        if isinstance(value, MckibbenError):
            raise value.with_traceback(None)
        return value


class Workspace:
    """A folder of plain files, for nobody else on this machine.

    The process is left with a mask of rights that keeps all that it writes to its user.

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
        os.umask(0o077)
        try:
            for name in FOLDERS:
                inner = self.folder / name
                inner.mkdir(parents=True, exist_ok=True)
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
        self._recordings: Cache[Recording] = Cache(MOST_CELLS)
        self._models: Cache[Block] = Cache(MOST_MODELS)
        self._inverses: Cache[bool] = Cache(MOST_MODELS)

    def claim(self) -> bool:
        """Become the one that writes here until this process ends; tell whether that went well.

        Where another workbench is, or jobs of one that was killed have not ended yet, nothing is
        written from here on.

        Raises
        ------
        DataError
            If the disk cannot lock files, or cannot keep others out.
        """
        self._owner = Lock(self.folder / ".owner")
        jobs = Lock(self.folder / ".working")
        if not self._owner.take():
            self.read_only = "another workbench has this folder open"
        elif not jobs.take(patience=PATIENCE):
            self.read_only = "jobs of a workbench that was killed have not ended yet"
        else:
            self._tidy()
        jobs.leave()
        for path, found in self._rights():
            if found.st_mode & 0o077:
                raise DataError(
                    "other users can get into this folder, and it cannot be closed to them",
                    file=path,
                    remedy="chmod it to 0700, or give a folder on a disk that knows rights of users",
                )
        return not self.read_only

    def work(self) -> Lock:
        """Let a job write here for as long as it holds what is returned, and lives.

        Raises
        ------
        DataError
            If a workbench is just taking the folder over.
        """
        held = Lock(self.folder / ".working")
        if not held.take(shared=True, patience=PATIENCE):
            raise DataError(
                "another workbench took it over", file=self.folder, remedy="start again"
            )
        return held

    def _tidy(self) -> None:
        """Take rights from others, and give names back that nothing came to bear."""
        folders = [self.folder / name for name in FOLDERS]
        inside = [path for folder in folders for path in folder.rglob("*")]
        for path in (self.folder, self.folder / "log.jsonl", *folders, *inside):
            with suppress(OSError):  # of a disk without rights, or of another user
                found = path.lstat()
                left = path.suffix == ".part" or not found.st_size
                if stat.S_ISLNK(found.st_mode):
                    continue
                if stat.S_ISREG(found.st_mode) and path.parent in folders and left:
                    path.unlink()
                elif found.st_mode & 0o077:
                    path.chmod(stat.S_IMODE(found.st_mode) & ~0o077)

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

        Raises
        ------
        DataError
            If nothing can be written here.
        """
        self.demand()
        folder = self.folder / kind
        plain = re.sub(r"[^A-Za-z0-9_-]+", "-", wish).strip("-_")[:40] or kind.rstrip("s")
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
        line = json.dumps({"time": now, "did": _short(what), "call": _short(call)})
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

    # -- recordings --------------------------------------------------------------------------

    def keep_upload(self, name: str, content: bytes) -> Path:
        """Keep an uploaded file as it came, and return where; errors are those of `receiving`."""
        with self.receiving(name, len(content)) as (new, path):
            new.write_bytes(content)
        return path

    @contextmanager
    def receiving(self, name: str, size: int) -> Iterator[tuple[Path, Path]]:
        """Give the place to save an uploaded file to, and where it is then kept, under a safe name.

        Raises
        ------
        DataError
            If it is empty or too large, or no file of recordings by its name; or nothing can be
            written.
        """
        from mckibben.files.formats import READERS

        given = Path(name.replace("\\", "/")).name
        ending = "".join(re.findall(r"\.[A-Za-z0-9]{1,8}$", given)).lower()
        if not size:
            raise DataError(f"{name!r:.80} is empty", remedy="choose another file")
        if size > LARGEST_UPLOAD:
            raise DataError(
                f"{name!r:.80} has more than {LARGEST_UPLOAD // 2**20} MiB",
                remedy="put it into a folder and use the command line",
            )
        if ending not in READERS:
            remedy = "unpack it and drop the files in it" if ending in ARCHIVES else "export as CSV"
            raise DataError(
                f"{name!r:.80} is no file of recordings ({', '.join(READERS)})", remedy=remedy
            )
        path = self.path("uploads", self.new_name("uploads", Path(given).stem, ending) + ending)
        try:
            with replacing(path) as new:
                yield new, path
        except BaseException:
            self.give_back("uploads", path.stem, ending)
            raise

    def add(
        self,
        recording: Recording,
        *,
        origin: str,
        call: str,
        role: Role = "train",
        name: str | None = None,
        notes: Iterable[str] = (),
    ) -> Entry:
        """Keep a recording, with what was said when it was read."""
        from mckibben.files import write

        chosen = self.new_name("recordings", name or recording.name)
        path = self._recording_path(chosen, len(recording))
        notes = dict.fromkeys([*recording.notes, *notes])
        try:
            write(recording.with_meta(name=chosen), path)
            self._describe(
                Entry(chosen, role, _short(origin), _short(call), path, tuple(map(_short, notes)))
            )
        except BaseException:
            self.give_back("recordings", chosen)
            raise
        self.log(f"added recording {chosen}", call)
        return self.entry(chosen)

    def _describe(self, entry: Entry) -> None:
        self.write_json(
            "recordings",
            entry.name,
            {"role": entry.role, "origin": entry.origin, "call": entry.call}
            | {"file": entry.path.name, "notes": list(entry.notes)},
        )

    def _recording_path(self, name: str, n_samples: int) -> Path:
        ending = "parquet" if n_samples > LONG else "csv"
        return self.path("recordings", f"{name}.{ending}")

    def entry(self, name: str) -> Entry:
        """Return what is known of a recording.

        Raises
        ------
        DataError
            If there is none of that name, or what is kept of it is damaged.
        """
        content = kept.checked(kept.Described, self.read_json("recordings", name))
        if content is None:
            raise DataError(
                "there is no such recording, or its description is damaged",
                file=self.path("recordings", f"{name}.json"),
                remedy="add it again",
            )
        path = self.path("recordings", content.file)
        return Entry(name, content.role, content.origin, content.call, path, tuple(content.notes))

    def entries(self) -> list[Entry]:
        """Return all recordings that are described; their files may still be damaged."""
        found = []
        for name in self.names("recordings"):
            try:
                entry = self.entry(name)
            except DataError:
                continue
            if entry.path.is_file():
                found.append(entry)
        return found

    def set_role(self, name: str, role: Role) -> None:
        """Say what a recording is used for."""
        self._describe(replace(self.entry(name), role=role))

    def remove(self, name: str) -> None:
        """Take a recording out of the workspace; what was uploaded stays."""
        path = self.entry(name).path
        for each in (
            self.new_path("recordings", f"{name}.json"),
            path,
            path.with_name(f"{path.name}-metadata.json"),
        ):
            each.unlink(missing_ok=True)
        self.log(f"removed recording {name}")

    def recording(self, name: str) -> Recording:
        """Return a recording; it is read once.

        Raises
        ------
        DataError
            If there is none of that name, or it is damaged.
        """
        from mckibben.files import read

        path = self.entry(name).path

        def make() -> tuple[Recording, int]:
            found = read(path, informative=False)
            if len(found) != 1:
                raise DataError("it holds several recordings", file=path, remedy="add it again")
            recording = found[0].with_meta(name=name)
            _demand_text(*recording.channels, *recording.units.values())
            return recording, len(recording) * len(recording.channels)

        return self._recordings.get(path, make)

    def with_role(self, role: Role) -> list[Recording]:
        """Return the recordings of a role."""
        return [self.recording(entry.name) for entry in self.entries() if entry.role == role]

    def channels(self) -> list[str]:
        """Return the channels that all recordings in use have; damaged ones are passed over."""
        used = []
        for entry in self.entries():
            if entry.role != "unused":
                with suppress(MckibbenError):
                    used.append(self.recording(entry.name))
        if not used:
            return []
        return [name for name in used[0].channels if all(name in one for one in used[1:])]

    # -- models ------------------------------------------------------------------------------

    def models(self) -> list[str]:
        """Return the names of the models that can be loaded."""
        return [name for name in self.names("models") if self._is_model(name)]

    def _is_model(self, name: str) -> bool:
        with suppress(MckibbenError):
            self.model(name)
            return True
        return False

    def model(self, name: str) -> Block:
        """Return a model; it is loaded once.

        Raises
        ------
        ModelError
            If it is missing or damaged.
        """
        from mckibben.blocks.saving import load

        path = self.path("models", f"{name}.json")

        def make() -> tuple[Block, int]:
            block = load(path)
            _demand_text(*(c.name + c.unit for c in (*block.inputs, *block.outputs)))
            return block, 1

        return self._models.get(path, make)

    def invertible(self, name: str) -> bool:
        """Tell whether a model has an inverse, and is none itself."""

        def make() -> tuple[bool, int]:
            block = self.model(name)
            block.inverse()
            one = len(block.inputs) == len(block.outputs) == 1
            return one and not block.kind.endswith("-inverse"), 1

        with suppress(MckibbenError):
            return self._inverses.get(self.path("models", f"{name}.json"), make)
        return False

    def warm(self) -> None:
        """Read what has changed; what is read is then at hand, for pages that must not wait."""
        for entry in self.entries():
            with suppress(MckibbenError):
                self.recording(entry.name)
        for name in self.names("models"):
            self.invertible(name)

    def results(self) -> list[dict[str, Any]]:
        """Return what is known of every model fitted, in the order of the choice: not by the test."""
        found = []
        for name in self.names("results"):
            result = kept.checked(kept.Fitted, self.read_json("results", name))
            if result is not None:
                found.append(result.model_dump() | {"name": name})
        return sorted(found, key=_order)

    def runs(self, model: str) -> dict[str, kept.Followed]:
        """Return what is known of the closed loops with a model, by their names."""
        found = {
            name: kept.checked(kept.Followed, self.read_json("runs", name))
            for name in self.names("runs")
        }
        return {name: run for name, run in found.items() if run is not None and run.model == model}


def _order(result: dict[str, Any]) -> tuple[bool, bool, float]:
    """Return what results are sorted by, as the rows of a leaderboard are."""
    validated, train = result.get("validation_rmse"), result.get("train") or {}
    cautioned = caution(str(result.get("model"))) is not None
    if validated is not None:
        return False, cautioned, float(validated)
    rmse = train.get("rmse")
    return True, cautioned, float("inf") if rmse is None else float(rmse)


def _written(path: Path) -> bool:
    try:
        return path.lstat().st_size > 0
    except OSError:
        return False


def _short(text: str) -> str:
    """Return a text as it can be kept: of no more than so many characters, all of them such."""
    return text[: kept.LONGEST].encode("utf-8", "replace").decode()


def _demand_text(*names: str) -> None:
    """Refuse names that no page can show."""
    try:
        "".join(names).encode()
    except UnicodeEncodeError:
        raise DataError("a channel's name is no text", remedy="add it again") from None
