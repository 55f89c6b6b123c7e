"""Folders of recordings, each with the description beside its files, or one that is known here."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path

from mckibben.blocks.free_run import PERIODIC
from mckibben.comparison.splits import FEWEST
from mckibben.errors import DataError
from mckibben.files import read
from mckibben.files.channels import NAME, Folder, describing, description
from mckibben.files.sources import inside
from mckibben.measured.splits import Split, Task, matches, split_of
from mckibben.recording import Recording
from mckibben.signals import resample

KNOWN = Path(str(resources.files("mckibben.measured"))) / "known"
"""Descriptions of public recordings, by the name of their folder: ``NAME.toml``."""


@dataclass(frozen=True)
class Set:
    """A folder of recordings.

    Parameters
    ----------
    name : str
        The folder's.
    folder : Path
    description : Folder
        Of its files.
    split : Split
    """

    name: str
    folder: Path
    description: Folder
    split: Split

    @property
    def title(self) -> str:
        """What the page calls it."""
        return self.split.title or self.name

    def recordings(self) -> list[Recording]:
        """Return all recordings, even in time, each named as its file.

        Raises
        ------
        DataError
            Naming the file that cannot be read, and why.
        """
        found = []
        with describing(self.folder, self.description):
            for path in inside(self.folder):
                read_in = read(path, gaps=self.split.gaps, informative=False)
                step = self.split.resample
                found += read_in if step is None else [resample(one, step) for one in read_in]
        if self.split.period is None:
            return found
        cut = [one for one in found if matches(one.name, self.split.periodic)]
        return [*_periods(cut, self.split.period), *(one for one in found if one not in cut)]

    def tasks(self) -> Iterator[tuple[str, Task]]:
        """Give every task with what is left out, if it leaves out in turn: then it is several."""
        names = [path.stem for path in self.folder.iterdir()]
        for task in self.split.tasks:
            if not task.optional or any(map(task.tests, names)):
                yield from task.parts()


def sets_in(folder: Path) -> list[Set]:
    """Return the sets of a folder: each folder in it with recordings, or itself.

    Raises
    ------
    DataError
        If there are no recordings, or a description is wrong.
    """
    if not folder.is_dir():
        raise DataError(
            "there is no such folder", file=folder, remedy="name a folder of recordings"
        )
    places = sorted(one for one in folder.iterdir() if one.is_dir() and _has_recordings(one))
    places = places or ([folder] if _has_recordings(folder) else [])
    if not places:
        raise DataError(
            "there are no recordings in it, nor in the folders in it",
            file=folder,
            remedy="give a folder for every set, with its files and, if needed, a channels.toml",
        )
    return [_set(place) for place in places]


def _set(place: Path) -> Set:
    beside, known = place / NAME, KNOWN / f"{place.name}.toml"
    file = next((one for one in (beside, known) if one.is_file()), None)
    said = Folder() if file is None else description(file)
    return Set(place.name, place, said, split_of(said.split, str(file)))


def _periods(recordings: list[Recording], length: int) -> list[Recording]:
    """Return whole periods as recordings of their own, none of which goes on from another."""
    found = []
    for one in recordings:
        if len(one) % length:
            raise DataError(
                f"{len(one)} samples are not a whole number of periods of {length}",
                file=one.source,
                remedy="correct period in [split]",
            )
        for start in range(0, len(one), length):
            part = replace(one.slice(start, start + length), start_time=0.0)
            found.append(part.with_meta(**{PERIODIC: True}))
    return found


def _has_recordings(place: Path) -> bool:
    try:
        return bool(inside(place))
    except DataError:
        return False


def parted(
    task: Task, recordings: list[Recording], where: Path
) -> tuple[list[Recording], list[Recording]]:
    """Return what a task fits, and what it tests on; nothing to test leaves the split to the comparison.

    Raises
    ------
    DataError
        If a side would be empty.
    """
    called = sorted({one.name for one in recordings})
    for pattern in (*task.files, *task.test):
        if not any(matches(name, [pattern]) for name in called):
            raise DataError(
                f"no recording is called {pattern}: there are {', '.join(called)}",
                file=where,
                remedy="correct the patterns in [split]",
            )
    taking = [one for one in recordings if task.about(one.name)]
    if task.cut is not None:
        cuts = [round(task.cut * len(one)) for one in taking]
        if not taking or any(
            min(cut, len(one) - cut) < FEWEST for one, cut in zip(taking, cuts, strict=True)
        ):
            raise DataError(
                f"cutting at {task.cut:g} leaves too little", file=where, remedy="change cut"
            )
        return (
            [one.slice(0, cut) for one, cut in zip(taking, cuts, strict=True)],
            [one.slice(cut, len(one)) for one, cut in zip(taking, cuts, strict=True)],
        )
    train = [one for one in taking if not task.tests(one.name)]
    test = [one for one in taking if task.tests(one.name)]
    if not train or (task.test and not test):
        side = "fitted" if not train else "tested on"
        raise DataError(
            f"no recording is to be {side}: there are {', '.join(called)}",
            file=where,
            remedy="correct the patterns in [split]",
        )
    return train, test
