"""Folders of recordings, and their fit and test data: ``split`` in their ``channels.toml``.

A folder without that file, and of a name in ``known``, is read by the description there.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from mckibben.errors import DataError
from mckibben.files import read
from mckibben.files.channels import NAME, Folder, describing, description
from mckibben.files.formats import SOUGHT
from mckibben.files.sources import inside, is_bag
from mckibben.recording import FEWEST_SAMPLES, PERIODIC, Recording
from mckibben.signals import resample
from mckibben.system.validation import reason

KNOWN = Path(str(resources.files("mckibben.measured"))) / "known"
"""Descriptions of public data sets, by the name of their folder: ``NAME.toml``."""


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, frozen=True)


class Published(_Strict):
    """A printed figure for the same test: its RMSE in the unit of the output, and where it stands."""

    what: str
    rmse: float
    link: str = ""


class Task(_Strict):
    """Fit and test data.

    Parameters
    ----------
    name : str
        Heading of the page's section; default the folder's title.
    optional : bool
        Whether it is skipped where none of the files that it is tested on exists.
    files : list of str
        Patterns of names, with ``*`` and ``?``, of the recordings that take part; default all.
    test, leave_out : list of str
        Patterns of those that are tested on, whole: all at once, or one pattern in turn.
    cut : float
        Instead: share of every recording, from its start, that is fitted; the rest is tested.
    inputs, outputs, load, models, settings
        As of `mckibben.compare`.
    published : list of Published
    """

    name: str = ""
    optional: bool = False
    files: list[str] = ["*"]
    test: list[str] = []
    leave_out: list[str] = []
    cut: Annotated[float, Field(gt=0, lt=1)] | None = None
    inputs: list[str] | None = None
    outputs: list[str] | None = None
    load: str | None = None
    models: Literal["all", "quick"] | list[str] = "all"
    settings: dict[str, dict[str, Any]] = {}
    published: list[Published] = []

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        if sum([bool(self.test), bool(self.leave_out), self.cut is not None]) > 1:
            raise ValueError("give one of test, leave_out and cut")
        return self

    @property
    def tested(self) -> list[str]:
        """Patterns of the recordings that are tested on whole."""
        return [*self.test, *self.leave_out]

    def parts(self) -> list[Task]:
        """Return the task, or one for every pattern of a leave-one-out task."""
        single_tasks = [
            self.model_copy(update={"leave_out": [pattern]}) for pattern in self.leave_out
        ]
        return single_tasks or [self]


class Split(_Strict):
    """A folder's tasks, and how its recordings are resampled.

    Parameters
    ----------
    title : str
        Default the folder's name.
    about : str
        Whose recordings these are, and what moves; for the page.
    resample : float, optional
        Sample time of all [s].
    gaps : {"error", "split", "interpolate"}
        As of `mckibben.read`.
    period : int, optional
        Samples after which the motion repeats itself: recordings are cut into periods, in which no
        start counts.
    periodic : list of str
        Patterns of the names of recordings that do; default all.
    tasks : list of Task
        Default one, with the last quarter to test on.
    """

    title: str = ""
    about: str = ""
    resample: Annotated[float, Field(gt=0)] | None = None
    gaps: Literal["error", "split", "interpolate"] = "interpolate"
    period: Annotated[int, Field(ge=FEWEST_SAMPLES)] | None = None
    periodic: list[str] = ["*"]
    tasks: Annotated[list[Task], Field(min_length=1)] = [Task()]

    @field_validator("tasks")
    @classmethod
    def _distinct(cls, tasks: list[Task]) -> list[Task]:
        if len({task.name for task in tasks}) < len(tasks):
            raise ValueError("two tasks have the same name")
        return tasks


def split_of(table: dict[str, Any] | None, file: str | Path = NAME) -> Split:
    """Return a table ``split``, checked; without one, a single task with the default split."""
    try:
        return Split.model_validate(table or {})
    except ValidationError as error:
        remedy = "correct it; docs/channels.md shows what it can hold"
        raise DataError(f"split.{reason(error)}", file=file, remedy=remedy) from None


@dataclass(frozen=True)
class Set:
    """A folder of recordings, with the description of its files."""

    folder: Path
    description: Folder
    split: Split

    @property
    def name(self) -> str:
        """The folder's name."""
        return self.folder.name

    @property
    def title(self) -> str:
        """The heading of its section."""
        return self.split.title or self.name

    def recordings(self) -> list[Recording]:
        """Return all recordings, resampled, each named as its file."""
        split, runs = self.split, list[Recording]()
        with describing(self.folder, self.description):
            for path in inside(self.folder):
                for run in read(path, gaps=split.gaps, informative=False):
                    resampled = run if split.resample is None else resample(run, split.resample)
                    periodic = split.period is not None and matches(run.name, split.periodic)
                    runs += _periods(resampled, split.period or 0) if periodic else [resampled]
        return runs

    def tasks(self) -> Iterator[Task]:
        """Yield every task; a leave-one-out task is several."""
        names = [path.stem for path in self.folder.iterdir()]
        for task in self.split.tasks:
            if not task.optional or any(matches(name, task.tested) for name in names):
                yield from task.parts()


def matches(name: str, patterns: Sequence[str]) -> bool:
    """Return whether a name matches one of some patterns."""
    return any(fnmatchcase(name, pattern) for pattern in patterns)


def _periods(run: Recording, length: int) -> list[Recording]:
    if len(run) % length:
        problem = f"{len(run)} samples are not a whole number of periods of {length}"
        raise DataError(problem, file=run.source, remedy="correct period in [split]")
    parts = (run.slice(start, start + length) for start in range(0, len(run), length))
    return [replace(part, start_time=0.0).with_meta(**{PERIODIC: True}) for part in parts]


def sets_in(folder: Path) -> list[Set]:
    """Return the sets of a folder: its subfolders with recordings, or itself.

    Raises
    ------
    DataError
        If there are no recordings, or a description is wrong.
    """
    if not folder.is_dir():
        remedy = "name a folder of recordings"
        raise DataError("there is no such folder", file=folder, remedy=remedy)
    places = [
        place for place in sorted(folder.iterdir()) if place.is_dir() and _has_recordings(place)
    ]
    if not places and not _has_recordings(folder):
        raise DataError(
            "there are no recordings in it, nor in the folders in it",
            file=folder,
            remedy=f"give a folder for every set, with its files and, if needed, a {NAME}",
        )
    return [_set(place) for place in places or [folder]]


def chosen_in(folder: Path, only: Sequence[str] = ()) -> list[Set]:
    """Return the sets of a folder with these names; without names all."""
    sets = sets_in(folder)
    if unknown := sorted({*only} - {data_set.name for data_set in sets}):
        names = ", ".join(data_set.name for data_set in sets)
        problem = f"there is no set {unknown[0]!r} in it"
        raise DataError(problem, file=folder, remedy=f"use one of {names}")
    return [data_set for data_set in sets if not only or data_set.name in only]


def _has_recordings(place: Path) -> bool:
    places = (place, *place.iterdir())
    return any(is_bag(path) or path.suffix.casefold() in SOUGHT for path in places)


def _set(place: Path) -> Set:
    files = (place / NAME, KNOWN / f"{place.name}.toml")
    file = next((path for path in files if path.is_file()), None)
    content = Folder() if file is None else description(file)
    return Set(place, content, split_of(content.split, file or NAME))


def fit_and_test_data(
    task: Task, recordings: Sequence[Recording], folder: Path
) -> tuple[list[Recording], list[Recording]]:
    """Return the fit and test data of a task; no test data for the default split.

    Raises
    ------
    DataError
        If a pattern matches nothing, or a side would be empty.
    """
    names = sorted({run.name for run in recordings})

    def wrong(problem: str) -> DataError:
        problem += f": the recordings are {', '.join(names)}"
        return DataError(problem, file=folder, remedy="correct [split]")

    for pattern in (*task.files, *task.tested):
        if not any(fnmatchcase(name, pattern) for name in names):
            raise wrong(f"no recording is called {pattern}")
    used = [run for run in recordings if matches(run.name, task.files)]
    if task.cut is None:
        train = [run for run in used if not matches(run.name, task.tested)]
        test = [run for run in used if matches(run.name, task.tested)]
    else:
        cuts = [round(task.cut * len(run)) for run in used]
        train = [run.slice(0, cut) for run, cut in zip(used, cuts, strict=True)]
        test = [run.slice(cut, len(run)) for run, cut in zip(used, cuts, strict=True)]
        if any(len(run) < FEWEST_SAMPLES for run in (*train, *test)):
            raise wrong(f"cutting at {task.cut:g} leaves too little")
    if not train or (task.tested and not test):
        raise wrong(f"no recording is to be {'tested on' if train else 'fitted'}")
    return train, test
