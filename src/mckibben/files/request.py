"""Options of `read`, and a table to which they apply."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal, get_args

from mckibben.errors import DataError, require
from mckibben.files.channels import Channel, Described, Time
from mckibben.files.formats import MOST_BYTES
from mckibben.files.notices import warn
from mckibben.files.table import Table
from mckibben.recording import FEWEST_SAMPLES, conversion

LONGEST = 1e6
"""Largest rest length of a muscle [mm]."""

Gaps = Literal["error", "split", "interpolate"]


@dataclass(frozen=True)
class Request:
    """The options of `mckibben.read`, then the settings of ``channels.toml``."""

    columns: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    rate: float | None = None
    gaps: Gaps = "error"
    channels: Sequence[str] | None = None
    informative: bool = True
    calibration: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    constants: Mapping[str, tuple[float, str]] = field(default_factory=dict)
    most: float = MOST_BYTES
    raw: bool = False
    rest_length: float | None = None
    header: int = 0
    skip: int = 0
    encoding: str | None = None
    described: Described = field(default_factory=Described)

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
        """Return whether a flaw of a channel is an error: it is requested, or none is."""
        return not self.names_channels or channel == "time" or self.asks_for(channel)

    def of(self, table: Table, path: Path) -> Source:
        """Return a table with this request; constants are added to the description.

        What this package wrote was described when it was first read, and is not calibrated twice.
        """
        channels, time = dict(self.described.channels), self.described.time
        if table.own:
            done: Any = table.meta.get("calibration") or {}
            time, every = Time(), channels.items()
            channels = {c: one for c, one in every if one.is_calibrated and c not in done}
        for name, (value, unit) in self.constants.items():
            channels[name] = Channel(value=value, unit=unit.strip() or None)
        described = self.described.model_copy(update={"channels": channels, "time": time})
        return Source(table, replace(self, described=described), path)

    def check(self, path: Path) -> None:
        """Raise an error for options that are invalid for any file."""
        error = partial(DataError, file=path)
        ways = get_args(Gaps)
        require(self.gaps in ways, "gaps", self.gaps, f"one of {', '.join(ways)}", error)
        possible = self.rate is None or 0 < self.rate < math.inf
        require(possible, "rate", self.rate, "a positive number of samples a second", error)
        possible = self.rest_length is None or 0 < self.rest_length <= LONGEST
        require(possible, "rest_length", self.rest_length, f"a length up to {LONGEST:g} mm", error)
        for name, lines in (("header", self.header), ("skip", self.skip)):
            require(lines >= 0, name, lines, "a number of lines", error)
        for channel, (value, _) in self.constants.items():
            if not math.isfinite(value) or channel in ("", "time", *self.columns):
                remedy = "give a finite number, to a channel that is no column and not time"
                raise error(f"it cannot be the constant {value:g}", channel=channel, remedy=remedy)
        for channel, (gain, offset) in self.calibration.items():
            if not (math.isfinite(gain) and math.isfinite(offset) and gain):
                problem = f"it cannot be {gain:g} times a column plus {offset:g}"
                raise error(problem, channel=channel, remedy="give finite numbers, the gain not 0")


@dataclass(frozen=True)
class Source:
    """A table, its file, and the request for it."""

    table: Table
    request: Request
    path: Path

    @property
    def rest_length(self) -> float | None:
        """Rest length as requested, or else of the file [mm]."""
        given = self.request.rest_length or self.table.meta.get("rest_length")
        return float(given) if isinstance(given, int | float) and given > 0 else None

    def derived(self, named: Iterable[str]) -> dict[str, str]:
        """Return requested channels that can be derived by the rest length, each with its source."""
        found: dict[str, str] = {}
        for wanted in self.request.channels or ():
            others = [n for n in named if conversion(wanted, n, self.rest_length) is not None]
            if others and wanted not in others:
                found[wanted] = others[0]
        return found

    def error(
        self, problem: str, remedy: str, channel: str | None = None, sample: int | None = None
    ) -> DataError:
        """Return the error for this file; a sample, counted from 0, is given by its row."""
        row = None if sample is None else self.table.row(sample)
        return DataError(problem, remedy=remedy, file=self.path, channel=channel, row=row)

    def warn(self, text: str) -> None:
        """Issue a `DataWarning` about this file, and note it."""
        warn(self.path, text)
