"""What the caller of `read` asked for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np

from mckibben.errors import DataError
from mckibben.files.channels import Channel, Described
from mckibben.files.table import Table

FEWEST = 10
"""Fewest samples of a recording, or of a stretch of one, that can show a loop."""

Gaps = Literal["error", "split", "interpolate"]


@dataclass(frozen=True)
class Request:
    """The options of `mckibben.read`, and what the folder states of the file.

    Parameters
    ----------
    described : Described
        Goes behind what the caller asked for.
    """

    columns: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    rate: float | None = None
    gaps: Gaps = "error"
    channels: Sequence[str] | None = None
    informative: bool = True
    calibration: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    constants: Mapping[str, tuple[float, str]] = field(default_factory=dict)
    most: float = 2.0**31
    described: Described = field(default_factory=Described)

    @property
    def fewest(self) -> int:
        """Fewest samples of a recording."""
        return FEWEST if self.informative else 2

    def asks_for(self, channel: str) -> bool:
        """Tell whether the caller named a channel."""
        return channel in (self.channels or ()) or channel in self.columns

    @property
    def names_channels(self) -> bool:
        """Whether the caller named the channels to read."""
        return bool(self.columns.keys() - {"time"}) or self.channels is not None

    def needs(self, channel: str) -> bool:
        """Tell whether a channel with flaws is an error rather than left out.

        Those that the caller named are needed, or all where none is named.
        """
        return not self.names_channels or channel == "time" or self.asks_for(channel)

    def describing(self, table: Table) -> Request:
        """Return the request for a table: constants among what is described, calibrations once.

        What this package wrote was described when it was first read; it stands in its ``meta``.
        """
        channels = dict(self.described.channels)
        if table.own:
            done = table.meta.get("calibration")
            known = {column.header for column in table.columns}
            channels = {
                name: given
                for name, given in channels.items()
                if name not in (done if isinstance(done, Mapping) else {})
                and given.is_calibrated
                and (given.column or name) in known
            }
        for name, (value, unit) in self.constants.items():
            channels[name] = Channel(value=value, unit=unit.strip() or None)
        time = Described().time if table.own else self.described.time
        said = self.described.model_copy(update={"channels": channels, "time": time})
        return replace(self, described=said)

    def check(self, path: Path) -> None:
        """Refuse what cannot be done with any file."""

        def refuse(problem: str, remedy: str, channel: str | None = None) -> DataError:
            return DataError(problem, file=path, channel=channel, remedy=remedy)

        if self.gaps not in ("error", "split", "interpolate"):
            raise refuse(
                f"there is no way {self.gaps!r} to treat gaps",
                "use one of error, split, interpolate",
            )
        if self.rate is not None and not 0 < self.rate < np.inf:
            raise refuse(
                f"a rate of {self.rate:g} samples per second is impossible",
                "give a positive number with --rate",
            )
        for channel, (value, _) in self.constants.items():
            if not np.isfinite(value) or channel in ("", "time", *self.columns):
                raise refuse(
                    f"it cannot be the constant {value:g}",
                    "give a finite number, to a channel that is no column and not time",
                    channel,
                )
        for channel, (gain, offset) in self.calibration.items():
            if not (np.isfinite(gain) and np.isfinite(offset) and gain):
                raise refuse(
                    f"it cannot be {gain:g} times a column plus {offset:g}",
                    "give finite numbers, the gain not 0",
                    channel,
                )
