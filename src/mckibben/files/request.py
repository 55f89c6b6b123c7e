"""Options of `read`, and a table to which they apply."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

from mckibben.errors import DataError, require
from mckibben.files.channels import Channel, Described, Time
from mckibben.files.formats import MOST_BYTES
from mckibben.files.notices import warn
from mckibben.files.table import Table
from mckibben.options import ReadOptions
from mckibben.recording import FEWEST_SAMPLES, SAME_TIME, conversion

GAPS_BRIDGED = ({"gaps": "interpolate"}, {"gaps": "split"})
"""Remedies of missing samples and of gaps."""

LARGEST_REST_LENGTH = 1e6
"""Largest rest length of a muscle [mm]."""


@dataclass(frozen=True)
class Request(ReadOptions):
    """The options of reading, what is to be read, and the settings of ``channels.toml``."""

    channels: Sequence[str] | None = None
    informative: bool = True
    most: float = MOST_BYTES
    described: Described = field(default_factory=Described)

    @property
    def step(self) -> float | None:
        """Sample time as requested [s]."""
        return self.sample_time if self.rate is None else 1.0 / self.rate

    @property
    def layout(self) -> tuple[object, ...]:
        """What determines the tables of a file, without what is read of them."""
        return self.header, self.skip, self.encoding, self.sheet

    @property
    def fewest(self) -> int:
        """Smallest number of samples of a recording."""
        return FEWEST_SAMPLES if self.informative else 2

    @property
    def names_channels(self) -> bool:
        """Whether the caller named the channels to read."""
        return bool(self.columns.keys() - {"time"}) or self.channels is not None

    def asks_for(self, channel: str) -> bool:
        """Return whether the caller requested a channel."""
        return channel in (self.channels or ()) or channel in self.columns

    def needs(self, channel: str) -> bool:
        """Return whether a flaw of a channel is an error: it is requested, has a unit, or none is."""
        stated = channel == "time" or channel in self.units
        return not self.names_channels or stated or self.asks_for(channel)

    def of(self, table: Table, path: Path, *, in_memory: bool = False) -> Source:
        """Return a table with this request; constants are added to the description.

        What this package wrote was described when it was first read, and is not calibrated twice.
        """
        channels, time = dict(self.described.channels), self.described.time
        if table.own:
            self._check_units(table, path)
            done: Any = table.meta.get("calibration") or {}
            time, items = Time(), channels.items()
            channels = {
                c: channel for c, channel in items if channel.is_calibrated and c not in done
            }
        for name, (value, unit) in self.constants.items():
            channels[name] = Channel(value=value, unit=unit.strip() or None)
        described = self.described.model_copy(update={"channels": channels, "time": time})
        return Source(table, replace(self, described=described), path, in_memory)

    def _check_units(self, table: Table, path: Path) -> None:
        """Raise an error for a unit in which a channel of a recording is not."""
        for column in table.columns:
            stated = self.units.get(column.header, column.unit)
            if stated != column.unit and column.header not in self.calibration:
                problem = f"it is in {column.unit or 'no unit'}, and not in {stated}"
                remedy = "leave the unit out, or state a gain with `calibration`"
                raise DataError(
                    problem, file=path, parameter="units", channel=column.header, remedy=remedy
                )

    @property
    def interprets(self) -> bool:
        """Whether an option of reading, and not of what is done then, is given."""
        plain, done = ReadOptions(), ("join", "between", "resample", "zero")
        names = [field_.name for field_ in fields(plain) if field_.name not in done]
        return any(getattr(self, name) != getattr(plain, name) for name in names)

    def check(self, path: Path, *, text: bool = True) -> None:
        """Raise an error for options that are invalid for any file, or for what is no ``text``."""
        error = partial(DataError, file=path)
        for name in () if text else ("header", "skip", "encoding", "sheet"):
            if getattr(self, name):
                raise error("it is of files", parameter=name, remedy="leave it out")
        possible = self.rate is None or 0 < self.rate < math.inf
        require(possible, "rate", self.rate, "a positive number of samples a second", error)
        possible = self.sample_time is None or 0 < self.sample_time < math.inf
        require(possible, "sample_time", self.sample_time, "a positive time in seconds", error)
        if self.rate and self.sample_time and abs(self.rate * self.sample_time - 1.0) > SAME_TIME:
            problem = f"it is {self.sample_time:g} s, but `rate` is {self.rate:g} Hz"
            raise error(problem, parameter="sample_time", remedy="give one of both")
        possible = self.rest_length is None or 0 < self.rest_length <= LARGEST_REST_LENGTH
        require(
            possible,
            "rest_length",
            self.rest_length,
            f"a length up to {LARGEST_REST_LENGTH:g} mm",
            error,
        )
        for name, lines in (("header", self.header), ("skip", self.skip)):
            require(lines >= 0, name, lines, "a number of lines", error)
        for channel, (value, _) in self.constants.items():
            if not math.isfinite(value) or channel in ("", "time", *self.columns):
                remedy = "give a finite number, to a channel that is no column and not time"
                raise error(f"it cannot be the constant {value:g}", channel=channel, remedy=remedy)
        for channel, (gain, offset) in self.lines.items():
            if not (math.isfinite(gain) and math.isfinite(offset) and gain):
                problem = f"it cannot be {gain:g} times a column plus {offset:g}"
                raise error(problem, channel=channel, remedy="give finite numbers, the gain not 0")


@dataclass(frozen=True)
class Source:
    """A table, its file, and the request for it."""

    table: Table
    request: Request
    path: Path
    in_memory: bool = False

    @property
    def rest_length(self) -> float | None:
        """Rest length as requested, or else of the file [mm]."""
        length = self.request.rest_length or self.table.meta.get("rest_length")
        return float(length) if isinstance(length, int | float) and length > 0 else None

    def derived(self, named: Iterable[str]) -> dict[str, str]:
        """Return requested channels that can be derived by the rest length, each with its source."""
        result: dict[str, str] = {}
        for channel in self.request.channels or ():
            sources = [n for n in named if conversion(channel, n, self.rest_length) is not None]
            if sources and channel not in sources:
                result[channel] = sources[0]
        return result

    def error(
        self,
        problem: str,
        remedy: str = "",
        channel: str | None = None,
        sample: int | None = None,
        options: Sequence[Mapping[str, Any]] = (),
    ) -> DataError:
        """Return the error for this file; a sample, counted from 0, is given by its row."""
        row = None if sample is None else self.table.row(sample)
        return DataError(
            problem, remedy=remedy, options=options, file=self.path, channel=channel, row=row
        )

    def warn(self, text: str, *, quiet: bool = False) -> None:
        """Issue a `DataWarning` about this file, unless ``quiet``, and note it."""
        warn(self.path, text, quiet=quiet)
