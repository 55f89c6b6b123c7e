"""The folder that holds all that was done: recordings, models, and what came of them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from mckibben.app import kept
from mckibben.app.caching import Cache
from mckibben.app.folder import Folder, short
from mckibben.app.forms import inverse_of
from mckibben.app.guard import LARGEST_UPLOAD
from mckibben.comparison.recommending import order
from mckibben.errors import DataError, MckibbenError
from mckibben.system.atomic import replacing

if TYPE_CHECKING:  # loaded when they are first used, so that the page is there at once
    from mckibben.blocks.core.block import Block
    from mckibben.control import Twin
    from mckibben.recording import Recording

Role = Literal["train", "test", "unused"]

ARCHIVES = (".zip", ".gz", ".tgz", ".tar", ".7z", ".rar", ".bz2", ".xz")

LONG = 200_000
"""Samples beyond which recordings are kept as Parquet instead of CSV, where that is installed."""

MOST_CELLS = 40_000_000
"""Samples times channels of the recordings that are held in memory, the one in use aside."""

MOST_MODELS = 500
"""Models held in memory."""


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


class Workspace(Folder):
    """Recordings, models, and what came of fits and closed loops, as plain files in a folder.

    Parameters, and errors, are those of `Folder`.
    """

    def __init__(self, folder: str | Path) -> None:
        super().__init__(folder)
        self._recordings: Cache[Recording] = Cache(MOST_CELLS)
        self._models: Cache[Block] = Cache(MOST_MODELS)
        self._inverses: Cache[bool] = Cache(MOST_MODELS)
        self._rigs: Cache[list[str]] = Cache(MOST_MODELS)

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
                Entry(chosen, role, short(origin), short(call), path, tuple(map(short, notes)))
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
        quick = find_spec("pyarrow") is not None
        ending = "parquet" if quick and n_samples > LONG else "csv"
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

    def readable(self) -> list[Recording]:
        """Return the recordings in use that are not damaged."""
        used = []
        for entry in self.entries():
            if entry.role != "unused":
                with suppress(MckibbenError):
                    used.append(self.recording(entry.name))
        return used

    def channels(self) -> list[str]:
        """Return the channels that all recordings in use have; damaged ones are passed over."""
        used = self.readable()
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

    def model(self, name: str, folder: str = "models") -> Block:
        """Return a model, or one with its band from ``banded``; it is loaded once.

        Raises
        ------
        ModelError
            If it is missing or damaged.
        """
        from mckibben.blocks.core.saving import load

        path = self.path(folder, f"{name}.json")

        def make() -> tuple[Block, int]:
            block = load(path)
            _demand_text(*(c.name + c.unit for c in (*block.inputs, *block.outputs)))
            return block, 1

        return self._models.get(path, make)

    def invertible(self, name: str) -> bool:
        """Tell whether a model has a compensator, and is none itself."""

        def make() -> tuple[bool, int]:
            inverse_of(self.model(name))
            return True, 1

        with suppress(MckibbenError):
            return self._inverses.get(self.path("models", f"{name}.json"), make)
        return False

    def ranked(self) -> list[str]:
        """Return the models in the order of the choice; those that were not fitted here come last."""
        known = self.models()
        first = [row["name"] for row in self.results() if row["name"] in known]
        return [*first, *(name for name in known if name not in first)]

    def twin(self, name: str) -> Twin:
        """Return a model as a plant, with its band where it has one.

        Where it does not know its limits, they are those recorded.

        Raises
        ------
        MckibbenError
            If it cannot be one.
        """
        from mckibben.control import Twin
        from mckibben.control.identified import known_ranges

        banded = self.path("banded", f"{name}.json").exists()
        model, limits = self.model(name, "banded" if banded else "models"), {}
        for channel in model.inputs:
            runs = [run[channel.name] for run in self.readable() if channel.name in run]
            if runs and channel.name not in known_ranges(model):
                ends = min(float(u.min()) for u in runs), max(float(u.max()) for u in runs)
                if ends[0] < ends[1]:
                    limits[channel.name] = ends
        return Twin(model, limits=limits, name=name)

    def plants(self, inverted: str) -> list[str]:
        """Return the models that a model's compensator can be tried on, in the order of the choice.

        Others first, for on its own model a compensator proves nothing.
        """
        undone = self.model(inverted)
        inputs, outputs = ({c.name for c in ends} for ends in (undone.inputs, undone.outputs))
        found = []
        for place, name in enumerate(self.ranked()):
            with suppress(MckibbenError):
                twin = self.twin(name)
                if set(twin.inputs) == inputs and set(twin.outputs) == outputs:
                    for each in inputs.difference(undone.scheduling):
                        twin.limits(each)
                    found.append((twin.forward == undone, place, name))
        return [name for _, _, name in sorted(found)]

    def same(self, inverted: str, plant: str) -> bool:
        """Tell whether a plant is the very model that a compensator undoes."""
        from mckibben.control.suiting import of_itself

        return of_itself(self.model(inverted), self.twin(plant))

    def cached_rigs(self, model: str, look: Callable[[], list[str]]) -> list[str]:
        """Return the virtual rigs of a model's size; they are looked for once, as that takes seconds."""
        return self._rigs.get(self.path("models", f"{model}.json"), lambda: (look(), 1))

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
        return sorted(found, key=_as_in_a_leaderboard)

    def runs(self, model: str) -> dict[str, kept.Followed]:
        """Return what is known of the closed loops with a model, by their names."""
        found = {
            name: kept.checked(kept.Followed, self.read_json("runs", name))
            for name in self.names("runs")
        }
        return {name: run for name, run in found.items() if run is not None and run.model == model}

    def reviews(self) -> dict[str, kept.Reviewed]:
        """Return what logs of the real rig said, by their names, newest last."""
        return self._all("reviews", kept.Reviewed)

    def estimates(self) -> dict[str, kept.Estimated]:
        """Return estimates of force, by their names, newest last."""
        return self._all("forces", kept.Estimated)

    def _all(self, kind: str, of: type[kept.Any_]) -> dict[str, kept.Any_]:
        paths = {name: self.path(kind, f"{name}.json") for name in self.names(kind)}
        order = sorted(paths, key=lambda name: paths[name].stat().st_mtime_ns)
        found = {name: kept.checked(of, self.read_json(kind, name)) for name in order}
        return {name: one for name, one in found.items() if one is not None}


def _demand_text(*names: str) -> None:
    """Refuse names that no page can show."""
    try:
        "".join(names).encode()
    except UnicodeEncodeError:
        raise DataError("a channel's name is no text", remedy="add it again") from None


def _as_in_a_leaderboard(result: dict[str, Any]) -> tuple[bool, bool, float, str]:
    fitted = (result["train"] or {}).get("rmse")
    return order(result["model"], result["validation_rmse"], fitted)
