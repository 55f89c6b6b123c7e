"""What ``channels.toml`` says of the files in its folder: columns, units, calibrations, constants."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from fnmatch import fnmatchcase
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from mckibben.errors import DataError
from mckibben.system.ordinary import DESCRIPTION, read_text

NAME = "channels.toml"

_Word = Annotated[str, Field(min_length=1, max_length=256)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)


class Time(_Strict):
    """Where times are.

    Parameters
    ----------
    column : str, optional
        By default found as ever.
    sample_time : float, optional
        Time between samples [s] of files without a column of times.
    unit : str, optional
    """

    column: _Word | None = None
    sample_time: Annotated[float, Field(ge=1e-12, lt=1e11)] | None = None
    unit: _Word | None = None

    def over(self, base: Time) -> Time:
        """Return these words, and those of another where there are none."""
        return Time(**base.model_dump(exclude_none=True) | self.model_dump(exclude_none=True))


class Channel(_Strict):
    """Where a channel is, and how its column is turned into it.

    Parameters
    ----------
    column : str, optional
        By default found as ever.
    unit : str, optional
        Of the channel: after calibration, where there is one.
    gain, offset : float, optional
        The channel is gain times the column, plus offset; a gain needs a unit.
    value : float, optional
        A constant, instead of a column.
    """

    column: _Word | None = None
    unit: _Word | None = None
    gain: float | None = None
    offset: float | None = None
    value: float | None = None

    @model_validator(mode="after")
    def _agrees(self) -> Self:
        if self.value is not None and {self.column, self.gain, self.offset} != {None}:
            raise ValueError("a value is a constant: it goes with a unit alone")
        if self.gain == 0:
            raise ValueError("a gain of 0 leaves nothing of the column; say value for a constant")
        return self

    @property
    def is_calibrated(self) -> bool:
        """Tell whether the column is to be multiplied or moved."""
        return self.gain is not None or self.offset is not None

    def over(self, base: Channel) -> Channel:
        """Return these words, and those of another where there are none that they deny."""
        if self.value is not None:
            return self.model_copy(update={"unit": self.unit or base.unit})
        kept = base.model_dump(exclude_none=True)
        if self.column is not None:
            kept.pop("value", None)
        return Channel(**kept | self.model_dump(exclude_none=True))


class Files(_Strict):
    """What is otherwise in files of some names.

    Parameters
    ----------
    match : str, optional
        Their names, with ``*`` and ``?`` for letters.
    join : list of str, optional
        Names of files that hold one signal each, and one recording together; a ``*`` in each stands
        for what is alike in the names of files that belong together.
    sheet : str, optional
        Of a spreadsheet.
    time, channels
        Go before those of the folder.
    """

    match: _Word | None = None
    join: Annotated[list[_Word], Field(min_length=2)] | None = None
    sheet: _Word | None = None
    time: Time = Time()
    channels: dict[_Word, Channel] = {}

    @model_validator(mode="after")
    def _names_files(self) -> Self:
        if (self.match is None) == (self.join is None):
            raise ValueError("say which files are meant, with one of match and join")
        if self.join is not None and {part.count("*") for part in self.join} not in ({0}, {1}):
            raise ValueError("all names in join have one *, or none has any")
        if self.join is not None and any("/" in part or "\\" in part for part in self.join):
            raise ValueError("names in join are those of files in the same folder")
        return self

    def about(self, name: str) -> bool:
        """Tell whether a file of this name is meant."""
        names = [self.match] if self.join is None else self.join
        return any(fnmatchcase(name, each or "") for each in names)


class Described(_Strict):
    """What is said of one file; nothing by default."""

    time: Time = Time()
    channels: dict[_Word, Channel] = {}
    sheet: _Word | None = None

    @model_validator(mode="after")
    def _is_whole(self) -> Self:
        for name, channel in self.channels.items():
            if name == "time":
                raise ValueError("channels.time: times are described in [time]")
            if channel.gain is not None and channel.unit is None:
                raise ValueError(f"channels.{name}: a gain needs the unit that it gives")
        return self


class Folder(Described):
    """What is said of all files in a folder.

    Parameters
    ----------
    files : list of Files
        What is otherwise in some of them; later ones go before earlier ones.
    split : dict, optional
        As it stands in the file; nothing here looks into it.
    """

    files: Annotated[list[Files], Field(max_length=1000)] = []
    split: dict[str, Any] | None = None

    def of(self, name: str) -> Described:
        """Return what is said of the file of this name."""
        time, channels, sheet = self.time, dict(self.channels), self.sheet
        for some in self.files:
            if some.about(name):
                time, sheet = some.time.over(time), some.sheet or sheet
                for each, given in some.channels.items():
                    channels[each] = given.over(channels.get(each, Channel()))
        return Described(time=time, channels=channels, sheet=sheet)

    def joined(self, name: str) -> dict[str, str]:
        """Return the files that are one recording with the one of this name, by the names of signals.

        They are called as their files, without what the ``*`` stands for; none, if it stands alone.
        """
        for some in self.files:
            for part in some.join or ():
                before, star, after = part.partition("*")
                if name == part or (
                    star
                    and len(name) >= len(part)
                    and name.startswith(before)
                    and name.endswith(after)
                ):
                    alike = name[len(before) : len(name) - len(after)] if star else ""
                    return {
                        Path(each.replace("*", "")).stem.strip("_-. "): each.replace("*", alike)
                        for each in some.join or ()
                    }
        return {}


def described(folder: str | Path) -> Folder:
    """Return what ``channels.toml`` says of the files in a folder.

    Parameters
    ----------
    folder : path

    Returns
    -------
    Folder
        One that says nothing, if there is no such file.

    Raises
    ------
    DataError
        If it is no TOML, has tables or keys that are not known (but for the table ``split``, which is
        given as it stands), or says what cannot be.
    """
    path = Path(folder) / NAME
    if os.path.lexists(path):
        return description(path)
    return dict(_elsewhere.get()).get(Path(folder).absolute(), Folder())


@contextmanager
def describing(folder: Path, what: Folder) -> Iterator[None]:
    """Take this for what is said of a folder that has no description of its own, meanwhile."""
    token = _elsewhere.set((*_elsewhere.get(), (folder.absolute(), what)))
    try:
        yield
    finally:
        _elsewhere.reset(token)


_elsewhere: ContextVar[tuple[tuple[Path, Folder], ...]] = ContextVar("elsewhere", default=())


def description(path: Path) -> Folder:
    """Return what a description says, wherever it is; see `described`."""
    try:
        return _understood(read_text(path, most=DESCRIPTION).removeprefix("\ufeff"))
    except (tomllib.TOMLDecodeError, RecursionError, ValueError) as error:
        raise DataError(
            _in_words(error),
            file=path,
            remedy="correct it; docs/files.md shows what can stand there",
        ) from None


@lru_cache(maxsize=8)  # it is asked of every file in the folder
def _understood(text: str) -> Folder:
    found = Folder.model_validate(tomllib.loads(text))
    for some in found.files:
        found.of(some.match or (some.join or [""])[0])
    return found


def about(path: Path) -> Described:
    """Return what is said of a recording: inside it, where it is a folder, or else beside it."""
    inside = path.is_dir() and os.path.lexists(path / NAME)
    return described(path if inside else path.parent).of(path.name)


def _in_words(error: Exception) -> str:
    if not isinstance(error, ValidationError):
        return f"it is no TOML ({' '.join(str(error).split())[:200] or type(error).__name__})"
    first = error.errors()[0]
    where = ".".join(str(step) for step in first["loc"])[:100]
    said = first["msg"].removeprefix("Value error, ")[:300]
    if first["type"] == "extra_forbidden":
        return f"{where} is not known"
    return f"{where}: {said}" if where else said
