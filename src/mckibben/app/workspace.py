"""The folder of a workbench: plain files that any editor opens, and nothing else.

``uploads`` has raw files as they came, ``recordings`` how each is read, its role and steps, ``history``
those removed; ``models`` and ``results`` what was fitted; ``runs`` and
``reviews`` closed loops; ``jobs`` how jobs went, and ``takeaway`` what they write for the user.

Files are written whole or not at all, names from a browser are made safe, and no path leaves the folder.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import threading
import unicodedata
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from mckibben.app.steps import (
    LARGEST_UPLOAD,
    UNTOUCHED,
    Entry,
    Reading,
    Role,
    Step,
    apply_steps,
    understand,
)
from mckibben.errors import DataError, MckibbenError
from mckibben.system.atomic import PART, replacing, write_json, written
from mckibben.system.ordinary import DESCRIPTION, read_bytes

if TYPE_CHECKING:  # loaded when first used, so that the page is there at once
    from mckibben.blocks.base import Block
    from mckibben.recording import Recording

KINDS = (
    *("uploads", "recordings", "history", "models", "results", "jobs", "runs"),
    *("takeaway", "reviews"),
)

NAME = re.compile(r"[^\W_][\w.-]{0,79}")
"""Letters and digits of any script, dots, dashes and underscores."""

DEVICES = re.compile(r"con|prn|aux|nul|(com|lpt)[0-9]", re.IGNORECASE)
"""Names that no file may have on Windows."""

MOST_CACHED = 1000
"""Recordings and models in memory."""


class Workspace:
    """Recordings, models and results of a folder, which is made where it is missing.

    `DataError` if it cannot be written to, or a folder in it is a link.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder).expanduser().resolve()
        with written(self.folder):
            for path in (self.folder, *(self.folder / kind for kind in KINDS)):
                if path != self.folder and path.is_symlink():
                    raise DataError("this is a link", file=path, remedy="remove it")
                path.mkdir(mode=0o700, parents=True, exist_ok=True)
        self._cache: dict[Any, Any] = {}
        self._lock = threading.RLock()

    def claim(self) -> None:
        """Become the one server of this folder until this process ends; `DataError` if it cannot."""
        from filelock import FileLock, Timeout

        if os.name == "posix" and self.folder.stat().st_uid != os.getuid():
            problem = "this folder is another user's"
            raise DataError(problem, file=self.folder, remedy="give one of your own")
        self._owner = FileLock(self.folder / ".owner", timeout=0, mode=0o600)
        with written(self.folder):
            self.folder.chmod(0o700)
            try:
                self._owner.acquire()
            except Timeout:
                problem = "another workbench has this folder open"
                raise DataError(problem, file=self.folder, remedy="use or close that") from None
        for path in self.folder.glob(f"*/{PART}*.part"):  # of a process that was killed
            path.unlink(missing_ok=True)

    # -- names and files ---------------------------------------------------------------------

    def path(self, kind: str, name: str) -> Path:
        """Return where a file of a kind is; `DataError` on a name that could lead elsewhere."""
        if kind not in KINDS or not NAME.fullmatch(name) or ".." in name:
            remedy = "use letters, digits, dots, dashes and underscores"
            raise DataError(f"{name!r:.80} cannot be a name here", remedy=remedy)
        path = self.folder / kind / name
        if path.is_symlink():
            raise DataError("this is a link", file=path, remedy="put the file itself there")
        return path

    def new_name(self, kind: str, wish: str, ending: str = ".json") -> str:
        """Return a free name like the one wished for, and reserve it with an empty file."""
        plain = unicodedata.normalize("NFC", wish)
        plain = re.sub(r"[^\w-]+", "-", plain).strip("-_")[:40] or kind.rstrip("s")
        plain = f"{kind.rstrip('s')}-{plain}" if DEVICES.fullmatch(plain) else plain
        for number in range(1, 100_000):
            name = plain if number == 1 else f"{plain}-{number}"
            path = self.folder / kind / f"{name}{ending}"
            with written(path), suppress(FileExistsError):
                os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, mode=0o600))
                return name
        raise DataError("there are too many of that name", remedy="give another")

    def write(self, kind: str, name: str, content: Mapping[str, Any]) -> None:
        """Write a JSON file."""
        write_json(self.path(kind, f"{name}.json"), content)

    def read(self, kind: str, name: str) -> dict[str, Any] | None:
        """Return the content of a JSON file; None if it is missing or damaged."""
        try:
            content = json.loads(read_bytes(self.path(kind, f"{name}.json"), most=DESCRIPTION))
        except (DataError, ValueError, RecursionError):
            return None
        return content if isinstance(content, dict) else None

    def names(self, kind: str) -> list[str]:
        """Return the names of the JSON files of a kind; empty files only reserve one."""
        paths = [path for path in (self.folder / kind).glob("*.json") if not path.is_symlink()]
        usable = [path.stem for path in paths if NAME.fullmatch(path.stem) and path.stat().st_size]
        return sorted(name for name in usable if not name.endswith("-metadata"))

    def delete(self, kind: str, name: str) -> None:
        """Delete a JSON file."""
        self.path(kind, f"{name}.json").unlink(missing_ok=True)

    @contextmanager
    def receiving(self, name: str, size: int) -> Iterator[tuple[Path, Path]]:
        """Give where to write an uploaded file to, and where it then is, under a safe name.

        `DataError` if it is empty or too large.
        """
        uploaded = Path(name.replace("\\", "/"))
        ending = re.sub(r"[^.\w]", "", uploaded.suffix.casefold())[:10]
        if not 0 < size <= LARGEST_UPLOAD:
            problem = (
                f"{uploaded.name!r:.80} is empty, or has more than {LARGEST_UPLOAD // 2**20} MiB"
            )
            raise DataError(problem, remedy="give another file")
        path = self.path("uploads", self.new_name("uploads", uploaded.stem, ending) + ending)
        try:
            with replacing(path) as new:
                yield new, path
        except BaseException:
            path.unlink(missing_ok=True)
            raise

    # -- recordings --------------------------------------------------------------------------

    def entry(self, name: str) -> Entry:
        """Return a recording's description; `DataError` if it is missing or damaged."""
        content = self.read("recordings", name) or {}
        try:
            return Entry.model_validate(content | {"name": name})
        except ValidationError:
            problem = "its description is missing or damaged"
            file = self.folder / "recordings" / f"{name}.json"
            raise DataError(problem, file=file, remedy="import it again") from None

    def entries(self) -> list[Entry]:
        """Return all recordings whose descriptions can be read, by name."""
        entries = []
        for name in self.names("recordings"):
            with suppress(DataError):
                entries.append(self.entry(name))
        return entries

    def put(self, entry: Entry) -> None:
        """Write a recording's description."""
        content = entry.model_dump(mode="json", exclude={"name"}, exclude_defaults=True)
        self.write("recordings", entry.name, content)

    def raw_path(self, entry: Entry) -> Path:
        """Return the raw file of a recording."""
        return self.path("uploads", entry.upload)

    def _parts(self, path: Path, reading: Reading) -> list[Recording]:
        return self.cached(path, repr(reading), lambda: understand(path, reading)[0])

    def _apply_steps(self, entry: Entry) -> Recording:
        def make() -> Recording:
            path = self.raw_path(entry)
            if entry.part >= len(parts := self._parts(path, entry.reading)):
                problem = f"it has {len(parts)} recordings, and this is number {entry.part + 1}"
                raise DataError(problem, file=path, remedy="remove this recording")
            return apply_steps(parts[entry.part], entry.steps).with_meta(name=entry.name)

        recording: Recording = self._derived(entry, "", make)
        return recording

    def _derived(self, entry: Entry, what: str, make: Callable[[], Any]) -> Any:
        """Return what is made of a recording, until its raw file or description change."""
        key = what + entry.model_dump_json(exclude={"role"})
        return self.cached(self.raw_path(entry), key, make)

    def recording(self, name: str) -> Recording:
        """Return a recording after its steps; it is read once. Errors are those of reading."""
        return self._apply_steps(self.entry(name))

    def add(
        self, upload: str, *, name: str = "", role: Role = "train", reading: Reading | None = None
    ) -> list[str]:
        """Add the recordings of an uploaded file, and return their names."""
        path, names, settings = self.path("uploads", upload), [], reading or UNTOUCHED
        for part, recording in enumerate(self._parts(path, settings)):
            free_name = self.new_name("recordings", name or recording.name or path.stem)
            self.put(Entry(name=free_name, role=role, upload=upload, part=part, reading=settings))
            names.append(free_name)
        return names

    def join(self, uploads: Sequence[str]) -> str:
        """Add the recording that uploaded files are pieces or channels of, and return its name.

        Each is read as its recordings are, those of it that are used give way to it.
        """
        from mckibben.files import read

        readings = {entry.upload: entry.reading for entry in self.entries()}
        parts = [
            part
            for upload in uploads
            for part in self._parts(self.path("uploads", upload), readings.get(upload, UNTOUCHED))
        ]
        (joint,) = read(parts, join=True)
        name = self.add_recording(joint, name=f"{Path(uploads[0]).stem}-joined")
        for entry in self.entries():
            if entry.upload in uploads:
                self.change(entry.name, role="unused")
        return name

    def add_recording(self, recording: Recording, *, name: str, role: Role = "train") -> str:
        """Add a recording that is in no file, such as of a virtual rig; it becomes a raw file."""
        from mckibben.files import write

        upload = f"{self.new_name('uploads', name, '.csv')}.csv"
        write(recording.with_meta(name=name), self.path("uploads", upload))
        return self.add(upload, name=name, role=role)[0]

    def change(self, name: str, **fields: Any) -> None:
        """Change fields of a recording; if it cannot be read so, all stays as it was."""
        with self._lock:
            after = self.entry(name).model_copy(update=fields)
            if fields.keys() != {"role"}:
                self._apply_steps(after)
            self.put(after)

    def do(self, name: str, step: Step) -> None:
        """Do one more step to a recording; errors are those of the step."""
        self.change(name, steps=[*self.entry(name).steps, step])

    def undo(self, name: str) -> Step | None:
        """Take a recording's last step back, and return it."""
        steps = self.entry(name).steps
        if steps:
            self.change(name, steps=steps[:-1])
        return steps[-1] if steps else None

    def split(self, name: str, at: int) -> str:
        """Split a recording before a sample, and return the name of the new second part, for testing."""
        entry, end = self.entry(name), len(self.recording(name))
        second = [*entry.steps, Step(do="slice", start=at, stop=end)]
        self._apply_steps(entry.model_copy(update={"steps": second}))
        self.do(name, Step(do="slice", start=0, stop=at))
        new_name = self.new_name("recordings", name)
        self.put(entry.model_copy(update={"name": new_name, "role": "test", "steps": second}))
        return new_name

    def rename(self, name: str, wish: str) -> str:
        """Give a recording a name like the one wished for, and return that."""
        entry = self.entry(name)
        new_name = self.new_name("recordings", wish)
        self.put(entry.model_copy(update={"name": new_name}))
        self.delete("recordings", name)
        return new_name

    def remove(self, name: str) -> None:
        """Take a recording out; its raw file stays, and so does its description, in the history."""
        where = self.path("history", f"recording-{name}.json")
        self.path("recordings", f"{name}.json").replace(where)

    def restore(self, name: str) -> None:
        """Bring a removed recording back."""
        where = self.path("history", f"recording-{name}.json")
        where.replace(self.path("recordings", f"{self.new_name('recordings', name)}.json"))

    def with_role(self, role: Role) -> list[Recording]:
        """Return the recordings of a role."""
        return [self.recording(entry.name) for entry in self.entries() if entry.role == role]

    def train_and_test(self) -> tuple[list[Recording], list[Recording]]:
        """Return the recordings to fit to, and those to test on."""
        return self.with_role("train"), self.with_role("test")

    def used(self) -> dict[str, Recording]:
        """Return the recordings in use that can be read, by name."""
        recordings = {}
        for entry in self.entries():
            with suppress(MckibbenError):
                if entry.role != "unused":
                    recordings[entry.name] = self.recording(entry.name)
        return recordings

    def channels(self) -> list[str]:
        """Return the channels that all recordings in use have."""
        recordings = list(self.used().values())
        names = recordings[0].channels if recordings else ()
        return [name for name in names if all(name in recording for recording in recordings)]

    def digest(self) -> str:
        """Return what changes whenever what is trained or tested on does; see `results`."""
        recordings, digests = self.used(), []
        for entry in self.entries():
            if run := recordings.get(entry.name):
                digest = self._derived(entry, "digest", partial(_digest, run))
                digests.append(f"{entry.role} {digest}")
        return hashlib.sha256("\n".join(sorted(digests)).encode()).hexdigest()[:16]

    # -- models and what came of them ------------------------------------------------------------

    def model(self, name: str) -> Block:
        """Return a model. `ModelError` if it is damaged."""
        from mckibben.blocks.saving import load

        path = self.path("models", f"{name}.json")
        return self.cached(path, "", lambda: load(path))

    def models(self) -> list[str]:
        """Return the models in the order of the leaderboard, then those that were not fitted here."""
        ranked = [row["name"] for row in self.results()]
        return [*ranked, *(name for name in self.names("models") if name not in ranked)]

    def save_model(self, name: str, model: Block, result: Mapping[str, Any]) -> None:
        """Write a model with what came of its fit: a row of a leaderboard, its channels and `digest`."""
        model.save(self.path("models", f"{name}.json"))
        self.write("results", name, result)

    def results(self) -> list[dict[str, Any]]:
        """Return what came of every fit, best validation first; those on other data come last.

        Each has ``name``, and ``current``: whether the recordings are still those of the fit.
        """
        from mckibben.comparison.leaderboard import order

        def rank(row: dict[str, Any]) -> tuple[Any, ...]:
            errors = row.get("validation_rmse"), (row.get("train") or {}).get("rmse")
            doubted = bool(row.get("doubted"))
            ranked = order(row["model"], *errors, row.get("skill_least"), doubted=doubted)
            return not row["current"], *ranked

        digest, rows, ranked = self.digest(), [], self.names("models")
        for name in self.names("results"):
            row = {"model": ""} | (self.read("results", name) or {})
            if row.get("status") == "ok" and name in ranked:
                rows.append(row | {"name": name, "current": row.get("data", "") in ("", digest)})
        return sorted(rows, key=rank)

    def on_other_data(self) -> set[str]:
        """Return the models that were fitted to recordings that are no longer these."""
        return {row["name"] for row in self.results() if not row["current"]}

    def cached(self, path: Path, key: str, make: Callable[[], Any]) -> Any:
        """Return what is made of a file, made again only when that has changed."""
        try:
            stat = path.stat()
        except OSError as error:
            problem = f"it cannot be read ({error.strerror})"
            raise DataError(problem, file=path, remedy="import it again") from None
        file_key = path, key, stat.st_mtime_ns, stat.st_size
        value = self._cache[file_key] if file_key in self._cache else make()
        with self._lock:  # not for the making, which takes seconds
            self._cache[file_key] = self._cache.pop(file_key, value)  # the last used goes last
            while len(self._cache) > MOST_CACHED:
                del self._cache[next(iter(self._cache))]
        return value


def _digest(recording: Recording) -> str:
    grid = [recording.sample_time, recording.start_time, *sorted(recording.units.items())]
    digest = hashlib.sha256(json.dumps(grid).encode())
    for name in sorted(recording.channels):
        digest.update(recording[name].data)
    return digest.hexdigest()
