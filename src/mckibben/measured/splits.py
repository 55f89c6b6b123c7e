"""What a folder of recordings is split into: the table ``split`` of its ``channels.toml``, checked."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fnmatch import fnmatchcase
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from mckibben.comparison.planning import N_FOLDS
from mckibben.comparison.splits import FEWEST
from mckibben.errors import DataError

WHERE = "channels.toml"


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, frozen=True)


class Published(_Strict):
    """A figure that others printed for the same test.

    Parameters
    ----------
    what : str
        The model, and whose.
    rmse : float
        In the unit of the task's output.
    """

    what: str
    rmse: float


class Task(_Strict):
    """What is fitted and what is tested.

    Parameters
    ----------
    name : str
        Heading of the page's section; default the folder's title.
    optional : bool
        Whether it is left out where none of the files that it is tested on is there.
    files : list of str
        Names of the recordings that take part, with ``*`` and ``?`` for letters; default all.
    test : list of str
        Those that are tested on, whole.
    leave_out : list of str
        Instead: each in turn is tested on, with all others fitted.
    cut : float
        Instead: share of every recording, from its start, that is fitted; the rest is tested.
    inputs, outputs, load, models, settings, folds
        As of `mckibben.compare`.
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
    folds: Annotated[int, Field(ge=0)] = N_FOLDS
    published: list[Published] = []

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        if sum([bool(self.test), bool(self.leave_out), self.cut is not None]) > 1:
            raise ValueError("say one of test, leave_out and cut")
        return self

    def parts(self) -> Iterator[tuple[str, Task]]:
        """Give the task; one that leaves out in turn is as many, each with what it leaves out."""
        if not self.leave_out:
            yield "", self
        for left in self.leave_out:
            yield left, self.model_copy(update={"test": [left], "leave_out": []})

    def about(self, name: str) -> bool:
        """Tell whether a recording of this name takes part."""
        return matches(name, self.files)

    def tests(self, name: str) -> bool:
        """Tell whether a recording of this name is tested on."""
        return matches(name, self.test)


class Split(_Strict):
    """A folder's tasks, and how its recordings are made even.

    Parameters
    ----------
    title : str
        Default the folder's name.
    about : str
        What the page says of the recordings: whose they are, and what moves.
    resample : float, optional
        Sample time to bring all to [s].
    gaps : {"error", "split", "interpolate"}
        What is done about gaps in time.
    period : int, optional
        Samples after which the motion repeats itself: recordings are cut into periods, of each of which
        no start counts.
    periodic : list of str
        Names of the recordings that do, with ``*`` and ``?`` for letters; default all.
    tasks : list of Task
        Default one, with the last quarter to test on.
    """

    title: str = ""
    about: str = ""
    resample: Annotated[float, Field(gt=0)] | None = None
    gaps: Literal["error", "split", "interpolate"] = "interpolate"
    period: Annotated[int, Field(ge=FEWEST)] | None = None
    periodic: list[str] = ["*"]
    tasks: Annotated[list[Task], Field(min_length=1)] = [Task()]

    @field_validator("tasks")
    @classmethod
    def _told_apart(cls, tasks: list[Task]) -> list[Task]:
        if len({task.name for task in tasks}) < len(tasks):
            raise ValueError("two tasks have the same name: give each its own")
        return tasks


def split_of(given: dict[str, Any] | None, file: str = WHERE) -> Split:
    """Return a table ``split``, checked; one task with compare's own split where there is none.

    Raises
    ------
    DataError
        If something in it is not known, or cannot be.
    """
    try:
        return Split.model_validate(given or {})
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(step) for step in ("split", *first["loc"]))[:100]
        said = ": " + first["msg"].removeprefix("Value error, ")[:300]
        if first["type"] == "extra_forbidden":
            said = " is not known"
        raise DataError(
            f"{where}{said}",
            file=file,
            remedy="correct it; docs/files.md shows what can stand there",
        ) from None


def matches(name: str, patterns: Sequence[str]) -> bool:
    """Tell whether a name is one of some, in which ``*`` and ``?`` stand for letters."""
    return any(fnmatchcase(name, pattern) for pattern in patterns)
