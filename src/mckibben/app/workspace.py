"""A folder that holds all that was done: recordings, models, results, and a log, as plain files.

Every file is written under a temporary name and renamed, so that whatever happens, what is there is
whole. Names come from a browser and from files: they are made safe here, and no path leaves the folder.
"""

from __future__ import annotations

import json
import re
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from mckibben.atomic import replacing, write_text
from mckibben.comparison.limits import caution
from mckibben.errors import DataError, MckibbenError

if TYPE_CHECKING:  # loaded when they are first used, so that the page is there at once
    from mckibben.blocks.base import Block
    from mckibben.recording import Recording

Role = Literal["train", "test", "unused"]

FOLDERS = ("uploads", "recordings", "models", "results", "jobs", "runs", "takeaway")

LARGEST_UPLOAD = 512 * 2**20
"""Bytes."""

LONG = 200_000
"""Samples beyond which recordings are kept as Parquet instead of CSV."""

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
    """

    name: str
    role: Role
    origin: str
    call: str
    path: Path


class Workspace:
    """A folder of plain files.

    Parameters
    ----------
    folder : str or Path
        Made where it is missing.

    Raises
    ------
    DataError
        If it cannot be made or written to.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder).expanduser().resolve()
        try:
            for name in FOLDERS:
                (self.folder / name).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise DataError(
                f"it cannot be a workspace ({error.strerror})",
                file=self.folder,
                remedy="give a folder that can be written to",
            ) from None
        self._read: dict[Path, tuple[float, Recording]] = {}

    # -- names and files ---------------------------------------------------------------------

    def path(self, kind: str, name: str) -> Path:
        """Return where a file of a kind is kept.

        Raises
        ------
        DataError
            If the name is not a plain one.
        """
        if kind not in FOLDERS or not NAME.fullmatch(name) or ".." in name:
            raise DataError(
                f"{name!r:.80} cannot be a name here",
                remedy="use letters, digits, dots, dashes and underscores",
            )
        return self.folder / kind / name

    def new_name(self, kind: str, wish: str) -> str:
        """Return a free name like the one wished for, whatever that holds."""
        plain = re.sub(r"[^A-Za-z0-9_-]+", "-", wish).strip("-_")[:40] or kind.rstrip("s")
        taken = {path.name.partition(".")[0] for path in (self.folder / kind).iterdir()}
        name, number = plain, 1
        while name in taken:
            number += 1
            name = f"{plain}-{number}"
        return name

    def write_json(self, kind: str, name: str, content: Mapping[str, Any]) -> Path:
        """Write a JSON file."""
        path = self.path(kind, f"{name}.json")
        write_text(path, json.dumps(content, indent=2) + "\n")
        return path

    def read_json(self, kind: str, name: str) -> dict[str, Any] | None:
        """Return what a JSON file holds, or None if it is missing or damaged."""
        try:
            content = json.loads(self.path(kind, f"{name}.json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        return content if isinstance(content, dict) else None

    def names(self, kind: str) -> list[str]:
        """Return the names of all JSON files of a kind."""
        found = (path.name for path in (self.folder / kind).glob("*.json"))
        return sorted(
            name.removesuffix(".json")
            for name in found
            if NAME.fullmatch(name) and not name.endswith("-metadata.json")
        )

    def log(self, what: str, call: str = "") -> None:
        """Append a line to the log of what was done."""
        line = json.dumps({"time": time.strftime("%Y-%m-%dT%H:%M:%S%z"), "did": what, "call": call})
        with (self.folder / "log.jsonl").open("a", encoding="utf-8") as file:
            file.write(line + "\n")

    def logged(self) -> list[dict[str, str]]:
        """Return the log, oldest first; a line cut short by a crash is passed over."""
        try:
            lines = (self.folder / "log.jsonl").read_text(encoding="utf-8").splitlines()
        except OSError:
            return []
        found = []
        for line in lines:
            try:
                found.append(json.loads(line))
            except ValueError:
                continue
        return found

    # -- recordings --------------------------------------------------------------------------

    def keep_upload(self, name: str, content: bytes) -> Path:
        """Keep an uploaded file as it came, under a safe name, and return where.

        Raises
        ------
        DataError
            If it is empty or too large.
        """
        if not content:
            raise DataError(f"{name!r:.80} is empty", remedy="choose another file")
        if len(content) > LARGEST_UPLOAD:
            raise DataError(
                f"{name!r:.80} has more than {LARGEST_UPLOAD // 2**20} MiB",
                remedy="put it into a folder and use the command line",
            )
        given = Path(name.replace("\\", "/")).name
        ending = "".join(re.findall(r"\.[A-Za-z0-9]{1,8}$", given)).lower()
        path = self.path("uploads", self.new_name("uploads", Path(given).stem) + ending)
        with replacing(path) as new:
            new.write_bytes(content)
        return path

    def add(
        self,
        recording: Recording,
        *,
        origin: str,
        call: str,
        role: Role = "train",
        name: str | None = None,
    ) -> Entry:
        """Keep a recording."""
        from mckibben.files import write

        chosen = self.new_name("recordings", name or recording.name)
        path = self._recording_path(chosen, len(recording))
        write(recording.with_meta(name=chosen), path)
        content = {"role": role, "origin": origin, "call": call, "file": path.name}
        self.write_json("recordings", chosen, content)
        self.log(f"added recording {chosen}", call)
        return self.entry(chosen)

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
        content = self.read_json("recordings", name)
        if content is None or content.get("role") not in ("train", "test", "unused"):
            raise DataError(
                "there is no such recording, or its description is damaged",
                file=self.path("recordings", f"{name}.json"),
                remedy="add it again",
            )
        path = self.path("recordings", str(content.get("file", "")))
        return Entry(
            name,
            content["role"],
            str(content.get("origin", "")),
            str(content.get("call", "")),
            path,
        )

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
        entry = self.entry(name)
        content = {
            "role": role,
            "origin": entry.origin,
            "call": entry.call,
            "file": entry.path.name,
        }
        self.write_json("recordings", name, content)

    def remove(self, name: str) -> None:
        """Take a recording out of the workspace; what was uploaded stays."""
        path = self.entry(name).path
        self.path("recordings", f"{name}.json").unlink(missing_ok=True)
        path.unlink(missing_ok=True)
        path.with_name(f"{path.name}-metadata.json").unlink(missing_ok=True)
        self.log(f"removed recording {name}")

    def recording(self, name: str) -> Recording:
        """Return a recording; it is read once."""
        from mckibben.files import read

        path = self.entry(name).path
        changed = path.stat().st_mtime
        kept = self._read.get(path)
        if kept is None or kept[0] != changed:
            (recording,) = read(path, informative=False)
            kept = (changed, recording.with_meta(name=name))
            self._read[path] = kept
        return kept[1]

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
        found = []
        for name in self.names("models"):
            try:
                self.model(name)
            except MckibbenError:
                continue
            found.append(name)
        return found

    def model(self, name: str) -> Block:
        """Return a model.

        Raises
        ------
        ModelError
            If it is missing or damaged.
        """
        from mckibben.blocks.saving import load

        return load(self.path("models", f"{name}.json"))

    def results(self) -> list[dict[str, Any]]:
        """Return what is known of every model fitted, in the order of the choice: not by the test."""
        found = []
        for name in self.names("results"):
            content = self.read_json("results", name)
            if content is not None and content.get("status") == "ok":
                found.append(content | {"name": name})
        return sorted(found, key=_order)


def _order(result: dict[str, Any]) -> tuple[bool, bool, float]:
    """Return what results are sorted by, as the rows of a leaderboard are."""
    validated, train = result.get("validation_rmse"), result.get("train") or {}
    cautioned = caution(str(result.get("model"))) is not None
    if validated is not None:
        return False, cautioned, float(validated)
    return True, cautioned, float(train.get("rmse", float("inf")))
