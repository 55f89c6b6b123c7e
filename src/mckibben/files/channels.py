"""``channels.toml``: columns, units, calibrations and constants of the files in its folder."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from fnmatch import fnmatchcase
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from mckibben.errors import DataError
from mckibben.system.ordinary import DESCRIPTION, read_text
from mckibben.system.validation import reason

NAME = "channels.toml"

_Word = Annotated[str, Field(min_length=1, max_length=256)]
_FileName = Annotated[str, Field(max_length=256, pattern=r"^[^/\\*]*\*?[^/\\*]*$")]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)


class Time(_Strict):
    """The time column and its unit, or the sample time [s] of files without such a column."""

    column: _Word | None = None
    sample_time: Annotated[float, Field(ge=1e-12, lt=1e11)] | None = None
    unit: _Word | None = None


class Channel(_Strict):
    """A channel: gain times a column, plus offset, in a unit; or a constant.

    Without ``column``, the one whose header names the channel. ``unit`` is that of the channel: after
    calibration, where there is one.
    """

    column: _Word | None = None
    unit: _Word | None = None
    gain: float | None = None
    offset: float | None = None
    value: float | None = None

    @model_validator(mode="after")
    def _agrees(self) -> Self:
        if self.value is not None and {self.column, self.gain, self.offset} != {None}:
            raise ValueError("a value is a constant, with a unit and nothing else")
        if self.gain == 0:
            raise ValueError("a gain of 0 leaves nothing of the column; use value for a constant")
        if self.gain is not None and self.unit is None:
            raise ValueError("a gain needs the unit of its result")
        return self

    @property
    def is_calibrated(self) -> bool:
        """Whether the column is multiplied or shifted."""
        return self.gain is not None or self.offset is not None


class Files(_Strict):
    """Settings for files by name, which take precedence over those of the folder.

    ``match`` is a pattern of names, with ``*`` and ``?``. ``join`` names files with one signal each that
    are one recording; a ``*`` in each matches the text that is alike in their names.
    """

    match: _Word | None = None
    join: Annotated[list[_FileName], Field(min_length=2)] | None = None
    sheet: _Word | None = None
    time: dict[str, Any] = {}
    channels: dict[str, dict[str, Any]] = {}

    @model_validator(mode="after")
    def _names_files(self) -> Self:
        if (self.match is None) == (self.join is None):
            raise ValueError("name the files, with one of match and join")
        if len({"*" in name for name in self.join or ()}) > 1:
            raise ValueError("all names in join have one *, or none has any")
        return self

    def include(self, name: str) -> bool:
        """Return whether a file of this name is included."""
        if self.match is not None:
            return fnmatchcase(name, self.match)
        return any(_matched(part, name) for part in self.join or ())


class Described(_Strict):
    """Settings for one file; by default none."""

    time: Time = Time()
    channels: dict[_Word, Channel] = {}
    sheet: _Word | None = None

    @model_validator(mode="after")
    def _has_one_time(self) -> Self:
        if "time" in self.channels:
            raise ValueError("channels.time: times are described in [time]")
        return self


class Folder(Described):
    """Settings for all files in a folder.

    ``files`` are for some of them, later ones before earlier ones; ``split`` is not interpreted here.
    """

    files: Annotated[list[Files], Field(max_length=1000)] = []
    split: dict[str, Any] | None = None

    def merged(self, files: Iterable[Files]) -> Described:
        """Return the settings including matching entries of ``files``."""
        time, sheet = self.time.model_dump(exclude_none=True), self.sheet
        channels = {
            name: given.model_dump(exclude_none=True) for name, given in self.channels.items()
        }
        for some in files:
            time |= some.time
            sheet = some.sheet or sheet
            for name, changes in some.channels.items():
                inherited = channels.get(name, {})
                if "value" in changes:
                    inherited = {"unit": inherited.get("unit")}
                elif "column" in changes:
                    inherited.pop("value", None)
                channels[name] = inherited | changes
        return Described.model_validate({"time": time, "channels": channels, "sheet": sheet})

    def parts(self, name: str) -> dict[str, str]:
        """Return the files that form one recording with this one -> their signals' names.

        A signal is named as its file, without the text that ``*`` matches; empty for a file alone.
        """
        for join in (some.join or [] for some in self.files):
            if parts := next(filter(None, (_matched(part, name) for part in join)), None):
                signals = {part: Path(part.replace("*", "")).stem.strip("_-. ") for part in join}
                return {part.replace("*", parts[1]): signal for part, signal in signals.items()}
        return {name: ""}


def described(folder: str | Path) -> Folder:
    """Return the contents of ``channels.toml`` in a folder, or empty settings.

    Raises
    ------
    DataError
        If it is no TOML, or has unknown tables or keys (but in the table ``split``) or impossible
        values.
    """
    path = Path(folder) / NAME
    if os.path.lexists(path):
        return description(path)
    where, settings = _ELSEWHERE.get()
    return settings if where == Path(folder).absolute() else Folder()


@contextmanager
def describing(folder: Path, settings: Folder) -> Iterator[None]:
    """Use these settings within the context for a folder without ``channels.toml``."""
    token = _ELSEWHERE.set((folder.absolute(), settings))
    try:
        yield
    finally:
        _ELSEWHERE.reset(token)


_ELSEWHERE: ContextVar[tuple[Path | None, Folder]] = ContextVar(
    "elsewhere", default=(None, Folder())
)


def description(path: Path) -> Folder:
    """Return the settings in a file of any name; errors as in `described`."""
    with _refusing(path):
        return _parsed(read_text(path, most=DESCRIPTION))


def about(path: Path) -> Described:
    """Return the settings for a recording: from inside its folder, or from the folder it is in."""
    inside = path.is_dir() and os.path.lexists(path / NAME)
    folder = path if inside else path.parent
    settings = described(folder)
    with _refusing(folder / NAME):
        return settings.merged(some for some in settings.files if some.include(path.name))


def _matched(part: str, name: str) -> re.Match[str] | None:
    """Return the match of a join pattern with a file name, whose group 1 is the text of ``*``."""
    return re.fullmatch(re.escape(part).replace(r"\*", "(.*)") + "()", name)


@lru_cache(maxsize=8)  # asked for every file in the folder
def _parsed(text: str) -> Folder:
    folder = Folder.model_validate(tomllib.loads(text))
    for some in folder.files:
        folder.merged([some])
    return folder


@contextmanager
def _refusing(path: Path) -> Iterator[None]:
    try:
        yield
    except DataError:
        raise
    except (RecursionError, ValueError) as error:
        remedy = "correct it; docs/channels.md shows what it can hold"
        raise DataError(reason(error), file=path, remedy=remedy) from None
