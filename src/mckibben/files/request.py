"""What the caller of `read` asked for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from mckibben.errors import DataError
from mckibben.files.channels import Channel, Described

FEWEST = 10
"""Samples; a shorter recording, or stretch of one, shows no loop."""


@dataclass(frozen=True)
class Request:
    """What the caller of `read` asked for; see there.

    Parameters
    ----------
    described : Described
        What the folder says of the file; what the caller asked for goes before.
    """

    columns: Mapping[str, str]
    units: Mapping[str, str]
    rate: float | None
    gaps: Literal["error", "split", "interpolate"]
    channels: Sequence[str] | None
    informative: bool = True
    calibration: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    constants: Mapping[str, tuple[float, str]] = field(default_factory=dict)
    described: Described = field(default_factory=Described)

    @property
    def fewest(self) -> int:
        """Fewest samples of a recording, or of a stretch of one."""
        return FEWEST if self.informative else 2

    def asks_for(self, channel: str) -> bool:
        """Tell whether a channel was named by the caller."""
        return channel in (self.channels or ()) or channel in self.columns

    def describing(self, described: Described) -> Described:
        """Return what is said of a file, with the constants that were asked for."""
        said = {
            name: Channel(value=value, unit=unit.strip() or None)
            for name, (value, unit) in self.constants.items()
        }
        return described.model_copy(update={"channels": described.channels | said})

    def needs(self, channel: str) -> bool:
        """Tell whether a channel with flaws is an error rather than left out."""
        return self.channels is None or self.asks_for(channel)

    def check(self, path: Path) -> None:
        """Refuse what cannot be done with any file."""
        if self.gaps not in ("error", "split", "interpolate"):
            raise DataError(
                f"there is no way {self.gaps!r} to treat gaps",
                file=path,
                remedy="use one of error, split, interpolate",
            )
        if self.rate is not None and not 0 < self.rate < np.inf:
            raise DataError(
                f"a rate of {self.rate:g} samples per second is impossible",
                file=path,
                remedy="give a positive number with --rate",
            )
        for channel, (value, _) in self.constants.items():
            if not np.isfinite(value) or channel in ("", "time", *self.columns):
                raise DataError(
                    f"it cannot be the constant {value:g}",
                    file=path,
                    channel=channel,
                    remedy="give a finite number, to a channel that is no column and not time",
                )
        for channel, (gain, offset) in self.calibration.items():
            if not (np.isfinite(gain) and np.isfinite(offset) and gain):
                raise DataError(
                    f"it cannot be {gain:g} times a column plus {offset:g}",
                    file=path,
                    channel=channel,
                    remedy="give finite numbers, the gain not 0",
                )
