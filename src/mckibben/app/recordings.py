"""The recordings of a workspace: files as they came, and what was read of them."""

from __future__ import annotations

import hashlib
import json
import re
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from mckibben.app import kept
from mckibben.app.caching import Cache
from mckibben.app.folder import Folder, short
from mckibben.app.guard import LARGEST_UPLOAD
from mckibben.errors import DataError, MckibbenError
from mckibben.system.atomic import replacing

if TYPE_CHECKING:  # loaded when they are first used, so that the page is there at once
    from mckibben.recording import Recording

Role = Literal["train", "test", "unused"]

DESCRIBING = "-metadata.json"
"""How the names of files end that this package puts beside recordings."""

ARCHIVES = (".zip", ".gz", ".tgz", ".tar", ".7z", ".rar", ".bz2", ".xz")

LONG = 200_000
"""Samples beyond which recordings are kept as Parquet instead of CSV, where that is installed."""

MOST_CELLS = 40_000_000
"""Samples times channels of the recordings that are held in memory, the one in use aside."""

MOST_DIGESTS = 10_000
"""Recordings of which it is remembered what differs whenever their samples do."""

EXAMPLE = "the example"
"""Origin of the bundled recordings."""


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
        The Python that gives what was read.
    path : Path
        Its file.
    notes : tuple of str
        What was said when it was read.
    base : Path, optional
        The file of what was read, before the steps; default its file.
    upload : str
        Name of the file that it was read from, among the uploads.
    part : int
        Which of the recordings in that file it is.
    reading : Reading
        How that was read.
    steps : tuple of Step
        What was done to it since.
    """

    name: str
    role: Role
    origin: str
    call: str
    path: Path
    notes: tuple[str, ...] = ()
    base: Path | None = None
    upload: str = ""
    part: int = 0
    reading: kept.Reading = field(default_factory=kept.Reading)
    steps: tuple[kept.Step, ...] = ()

    def content(self) -> dict[str, Any]:
        """Return what is written of it."""
        return {
            "role": self.role,
            "origin": short(self.origin),
            "call": short(self.call),
            "file": self.path.name,
            "notes": [short(note) for note in self.notes],
            "base": (self.base or self.path).name,
            "upload": self.upload,
            "part": self.part,
            "reading": self.reading.model_dump(mode="json", exclude_defaults=True),
            "steps": [step.model_dump(mode="json", exclude_defaults=True) for step in self.steps],
        }


class Recordings(Folder):
    """Recordings as plain files in a folder, as they were read.

    Parameters, and errors, are those of `Folder`.
    """

    def __init__(self, folder: str | Path) -> None:
        super().__init__(folder)
        self._recordings: Cache[Recording] = Cache(MOST_CELLS)
        self._digests: Cache[str] = Cache(MOST_DIGESTS)
        self._changing = threading.RLock()

    def beside(self) -> list[Path]:
        """Return what looks like recordings in the folder itself, which nobody has dropped."""
        from mckibben.files.formats import SOUGHT

        found = (path for path in self.folder.iterdir() if path.suffix.casefold() in SOUGHT)
        return sorted(path for path in found if path.is_file())

    # -- files as they came --------------------------------------------------------------------

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
        from mckibben.files.formats import SOUGHT

        given = Path(unescaped(name).replace("\\", "/")).name
        ending = "".join(re.findall(r"\.[A-Za-z0-9]{1,8}$", given)).lower()
        if given.endswith(DESCRIBING):
            raise DataError(
                f"{name!r:.80} describes a recording and holds none",
                remedy="drop the file beside it alone: its units are asked by “How it was read”",
            )
        if ending not in SOUGHT:
            remedy = "unpack it and drop the files in it" if ending in ARCHIVES else "export as CSV"
            raise DataError(
                f"{name!r:.80} is no file of recordings ({', '.join(SOUGHT)})", remedy=remedy
            )
        if not size:
            raise DataError(f"{name!r:.80} is empty", remedy="choose another file")
        if size > LARGEST_UPLOAD:
            raise DataError(
                f"{name!r:.80} has more than {LARGEST_UPLOAD // 2**20} MiB",
                remedy="put it into a folder and use the command line",
            )
        path = self.path("uploads", self.new_name("uploads", Path(given).stem, ending) + ending)
        try:
            with replacing(path) as new:
                yield new, path
        except BaseException:
            self.give_back("uploads", path.stem, ending)
            raise

    # -- recordings ----------------------------------------------------------------------------

    def add(
        self,
        recording: Recording,
        *,
        origin: str,
        call: str,
        role: Role = "train",
        name: str | None = None,
        notes: Iterable[str] = (),
        upload: str = "",
        part: int = 0,
        reading: kept.Reading | None = None,
    ) -> Entry:
        """Keep a recording, with what was said when it was read."""
        chosen = self.new_name("recordings", name or recording.name)
        try:
            path = self._written(chosen, recording)
            said = tuple(dict.fromkeys([*recording.notes, *notes]))
            way = {"upload": upload, "part": part, "reading": reading or kept.Reading()}
            entry = Entry(chosen, role, origin, call, path, said, **way)  # type: ignore[arg-type]
            self.write_json("recordings", chosen, entry.content())
        except BaseException:
            self.give_back("recordings", chosen)
            raise
        with suppress(DataError):  # what is done is done, where the log has no room
            self.log(f"added recording {chosen}", call)
        return self.entry(chosen)

    def _written(self, name: str, recording: Recording) -> Path:
        """Write samples to a file of their own: what was there before stays, for undoing."""
        from mckibben.files import write

        quick = find_spec("pyarrow") is not None
        ending = "parquet" if quick and len(recording) > LONG else "csv"
        names = (
            f"{name}{number}.{ending}" for number in ("", *(f".{k}" for k in range(2, 10_000)))
        )
        path = next(p for each in names if not (p := self.new_path("recordings", each)).exists())
        write(recording.with_meta(name=name), path)
        return path

    def entry(self, name: str) -> Entry:
        """Return what is known of a recording.

        Raises
        ------
        DataError
            If there is none of that name, or what is kept of it is damaged.
        """
        return self._described(name, self.read_json("recordings", name))

    def _described(self, name: str, described: dict[str, Any] | None) -> Entry:
        """Return what a description says of a recording; errors are those of `entry`."""
        content = kept.checked(kept.Described, described)
        if content is None:
            raise DataError(
                "there is no such recording, or its description is damaged",
                file=self.path("recordings", f"{name}.json"),
                remedy="add it again",
            )
        path = self.path("recordings", content.file)
        return Entry(
            name,
            content.role,
            content.origin,
            content.call,
            path,
            tuple(content.notes),
            base=self.path("recordings", content.base) if content.base else path,
            upload=content.upload,
            part=content.part,
            reading=content.reading or kept.Reading(),
            steps=tuple(content.steps),
        )

    def entries(self) -> list[Entry]:
        """Return all recordings that are described; their samples may be damaged, or missing."""
        found = []
        for name in self.names("recordings"):
            with suppress(DataError):
                found.append(self.entry(name))
        return found

    def recording(self, name: str) -> Recording:
        """Return a recording; it is read once.

        Raises
        ------
        DataError
            If there is none of that name, or it is damaged.
        """
        return self._read(self.entry(name).path)

    def _read(self, path: Path) -> Recording:
        from mckibben.files import read

        def make() -> tuple[Recording, int]:
            found = read(path, informative=False)
            if len(found) != 1:
                raise DataError("it holds several recordings", file=path, remedy="add it again")
            recording = found[0]
            demand_text(*recording.channels, *recording.units.values())
            return recording, len(recording) * len(recording.channels)

        return self._recordings.get(path, make)

    def with_role(self, role: Role, entries: Iterable[Entry] | None = None) -> list[Recording]:
        """Return the recordings of a role, of all or of some entries."""
        entries = self.entries() if entries is None else entries
        return [self._read(entry.path) for entry in entries if entry.role == role]

    def data(self, entries: Iterable[Entry] | None = None) -> str:
        """Return what differs whenever what is trained or tested on does, of all or of some entries.

        It is of the samples as they are on disk, whatever they are called and wherever they came from.
        """
        entries = self.entries() if entries is None else entries
        told = sorted(
            f"{each.role} {self._digest(each)}" for each in entries if each.role != "unused"
        )
        return hashlib.sha256("\n".join(told).encode()).hexdigest()[:16]

    def _digest(self, entry: Entry) -> str:
        """Return what differs whenever samples do; they are looked at once for each time on the disk."""

        def make() -> tuple[str, int]:
            one = self._read(entry.path)
            grid = [one.sample_time, one.start_time, *sorted(one.units.items())]
            digest = hashlib.sha256(json.dumps(grid).encode())
            for name in sorted(one.channels):
                digest.update(one[name].data)
            return digest.hexdigest(), 1

        try:
            return self._digests.get(entry.path, make)
        except MckibbenError:
            return entry.path.name

    def readable(self) -> list[Recording]:
        """Return the recordings in use that are not damaged."""
        return list(self.used().values())

    def used(self) -> dict[str, Recording]:
        """Return the recordings in use that are not damaged, by their names."""
        used = {}
        for entry in self.entries():
            if entry.role != "unused":
                with suppress(MckibbenError):
                    used[entry.name] = self.recording(entry.name)
        return used

    def channels(self) -> list[str]:
        """Return the channels that all recordings in use have; damaged ones are passed over."""
        used = self.readable()
        if not used:
            return []
        return [name for name in used[0].channels if all(name in one for one in used[1:])]

    def stamp(self) -> int:
        """Return what differs whenever recordings were added or changed, by whomever."""
        return (self.folder / "recordings").stat().st_mtime_ns


def unescaped(name: str) -> str:
    """Return the name of an uploaded file; browsers escape these signs of it, and nothing else."""
    for sign in '"\r\n':
        name = name.replace(f"%{ord(sign):02X}", sign)
    return name


def demand_text(*names: str) -> None:
    """Refuse names that no page can show."""
    try:
        "".join(names).encode()
    except UnicodeEncodeError:
        raise DataError("a channel's name is no text", remedy="add it again") from None
