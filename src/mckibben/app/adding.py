"""Recordings of uploaded files: added as they are read, or read otherwise later."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from mckibben.app import scripts
from mckibben.app.desk import LONGEST, Desk
from mckibben.app.fields import GAPS, said
from mckibben.app.kept import Reading
from mckibben.app.reading import AS_FOUND, options, read_upload
from mckibben.app.recordings import Entry
from mckibben.app.workspace import Workspace
from mckibben.errors import DataError, MckibbenError
from mckibben.recording import Recording

MANY = 20
"""Stretches of a file beyond which it is asked whether they are meant."""


@dataclass
class Problem:
    """A file that was not read: why, and where it is kept, if it can be asked how it is read."""

    shown: str
    error: MckibbenError
    held: str = ""

    def __str__(self) -> str:
        text = said(self.error)
        return text if self.shown in text else f"{self.shown}: {text}"


def add(
    desk: Desk, held: str, shown: str, reading: Reading, *, many: bool = True
) -> list[Recording]:
    """Read an uploaded file and add its recordings, which can be undone.

    Raises
    ------
    DataError
        If it cannot be read; or is cut into more than `MANY` stretches, unless many are meant.
    """
    path = desk.workspace.path("uploads", held)
    found = read_upload(path, reading)
    if len(found) > MANY and not many:
        longest = max(len(one) for one in found)
        raise DataError(
            f"that would make {len(found)} recordings, of {longest} samples at most",
            remedy=f"“{GAPS['interpolate']}”, or press again for so many",
        )
    call = scripts.read_call(str(path), options(reading))
    with desk.workspace.adding(f"add {shown}") as added:
        for part, one in enumerate(found):
            entry = desk.workspace.add(
                one.with_meta(name=one.name.replace(path.stem, Path(shown).stem, 1)),
                origin=f"file {shown}",
                call=call,
                upload=held,
                part=part,
                reading=reading,
            )
            added.append(entry.name)
    desk.workspace.log(f"read {shown}", call)
    return found


def pairs(workspace: Workspace) -> list[tuple[str, ...]]:
    """Return recordings in use that may be channels of one: as long, at one rate, no channel twice.

    They are paired in the order of their names, where each has its other.
    """
    sizes: dict[tuple[int, float | None], dict[tuple[str, ...], list[str]]] = {}
    for name, run in sorted(workspace.used().items()):
        kinds = sizes.setdefault((len(run), run.sample_time), {})
        kinds.setdefault(tuple(run.channels), []).append(name)
    found: list[tuple[str, ...]] = []
    for kinds in sizes.values():
        channels = [channel for kind in kinds for channel in kind]
        as_many = len({len(names) for names in kinds.values()}) == 1
        if len(kinds) > 1 and as_many and len(set(channels)) == len(channels):
            found += zip(*kinds.values(), strict=True)
    return found


def join(desk: Desk, names: Sequence[str]) -> None:
    """Make one recording of several that hold its channels; it is kept as a file of its own.

    Raises
    ------
    DataError
        If nothing can be written.
    """
    from mckibben.files import write

    workspace = desk.workspace
    whole, *others = (workspace.recording(name) for name in names)
    for other in others:
        whole = whole.with_channels(other.units, **other.channels)
    path = workspace.path(
        "uploads", f"{workspace.new_name('uploads', '-'.join(names), '.csv')}.csv"
    )
    write(whole.with_meta(name=path.stem), path)
    role = workspace.entry(names[0]).role
    add(desk, path.name, path.name, AS_FOUND)
    workspace.set_role(path.stem, role)
    workspace.remove(*names)


def understood(recording: Recording) -> str:
    """Return what was understood of a file: channels, time, and columns that were left out."""
    said = ", ".join(f"{c} in {recording.units[c] or 'no unit'}" for c in recording.channels)
    said += "; no time column" if recording.sample_time is None else ""
    if converted := recording.meta.get("converted_units"):
        said += f"; converted: {', '.join(map(str, converted))}"
    ignored = recording.meta.get("ignored_columns") or ()
    if ignored:
        said += f"; left out: {', '.join(map(str, ignored))}"
    return said[:LONGEST]


def source(workspace: Workspace, entry: Entry) -> Path:
    """Return the file that a recording is read from: as it came, or else its samples as they came."""
    if entry.upload:
        return workspace.path("uploads", entry.upload)
    return entry.base or entry.path


def replaced(desk: Desk, names: Sequence[str], reading: Reading) -> list[Recording]:
    """Read the files of recordings otherwise, all or none, and return what came of the first."""
    return replaced_each(desk, dict.fromkeys(names, reading))


def replaced_each(desk: Desk, readings: Mapping[str, Reading]) -> list[Recording]:
    """Do as `replaced`, each in its own way, as one change."""
    workspace = desk.workspace
    read: dict[tuple[Path, str], list[Recording]] = {}
    made, uploads = {}, {}
    for name, reading in readings.items():
        entry = workspace.entry(name)
        path = source(workspace, entry)
        key = path, reading.model_dump_json()
        if key not in read:
            read[key] = read_upload(path, reading)
        if not entry.upload:  # its samples become a file, to be read otherwise again
            path = _as_upload(workspace, entry)
        uploads[name] = path.name
        made[name] = read[key], scripts.read_call(str(path), options(reading))
    workspace.read_again(made, readings, uploads)
    return next(iter(made.values()))[0]


def _as_upload(workspace: Workspace, entry: Entry) -> Path:
    """Keep the samples of a recording as they came, as a file of its own, and return where."""
    from mckibben.files import write

    before = entry.base or entry.path
    chosen = workspace.new_name("uploads", entry.name, before.suffix)
    path = workspace.path("uploads", f"{chosen}{before.suffix}")
    (samples,) = read_upload(before)
    write(samples, path)
    return path


def alike(desk: Desk, name: str) -> list[str]:
    """Return other recordings with the same channels, read in the same way."""
    workspace, found = desk.workspace, list[str]()
    for entry in workspace.entries():
        if entry.name == name or entry.reading != workspace.entry(name).reading:
            continue
        try:
            same = list(workspace.recording(entry.name).channels)
        except MckibbenError:
            continue
        if same == list(workspace.recording(name).channels):
            found.append(entry.name)
    return found
