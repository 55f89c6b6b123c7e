"""Recordings from files, read and prepared for an operation."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from mckibben.errors import DataError
from mckibben.files.memory import Data, InMemory, items
from mckibben.options import ReadOptions
from mckibben.recording import Recording
from mckibben.signals.lags import lags
from mckibben.system.showing import Result

if TYPE_CHECKING:
    from mckibben.channels import Channels, Names
    from mckibben.diagnosis.data_gaps import Gap
    from mckibben.files.choosing import Seen

DERIVED = "displacement"
"""Channel that the rest length makes of another where none is named."""


def files_of(data: Data) -> list[Path]:
    """Return the files among data."""
    return [item for item in items(data) if isinstance(item, Path)]


def loaded(data: Data) -> list[InMemory]:
    """Return what of data is in memory."""
    return [item for item in items(data) if not isinstance(item, Path)]


def read_files(
    data: Data, channels: Sequence[str] | None, reading: ReadOptions | None = None
) -> list[Recording]:
    """Return the recordings in data, which must have some channels, however short they are."""
    from mckibben.files import read

    return read(data, reading, channels=channels, informative=False)


def only(recordings: list[Recording]) -> Recording:
    """Return the only one of recordings.

    Raises
    ------
    DataError
        If there is none, or there are several.
    """
    if not recordings:
        raise DataError("there is no recording", remedy="give one")
    if len(recordings) > 1:
        raise DataError(
            f"there are {len(recordings)} recordings, or parts between gaps",
            file=recordings[0].source,
            remedy="give one, cut it first, or give `gaps=interpolate`",
        )
    return recordings[0]


def read_sides(
    data: Sequence[Data],
    resolve: Callable[[Sequence[Recording]], Channels],
    words: Sequence[Names] = (),
    reading: ReadOptions | None = None,
) -> tuple[list[list[Recording]], Channels]:
    """Return the recordings of several lists of files, and the channels of models of them.

    What is wrong with a column that no model needs is a note.

    Parameters
    ----------
    resolve : callable
        Of recordings, such as `mckibben.channels.channels_of`.
    words : sequence of str, sequence of str, or None
        Channels that have to be there, as the user named them.

    Raises
    ------
    DataError
        As `mckibben.read`, of the channels that are needed.
    """
    reading = reading or ReadOptions()
    named = [name for names in words for name in _listed(names)]
    channels: Channels | None = None
    for needed in ((), None):  # flaws of columns matter where what is left of others does not do
        try:
            with warnings.catch_warnings(record=True) as caught:
                runs = [read_files(side, needed, reading) for side in data]
            if reading.rest_length is not None:
                runs = [[run.with_derived(named or [DERIVED]) for run in side] for side in runs]
            channels = resolve([run for side in runs for run in side])
        except DataError:
            if needed is None:
                raise
            continue
        every_run = [run for side in runs for run in side]
        needed_channels = (*channels.sides, *(named if needed is not None else ()))
        if all(name in run for run in every_run for name in needed_channels):
            for warning in caught:
                warnings.warn(warning.message, warning.category, stacklevel=2)
            return runs, channels
    assert channels is not None
    return [read_files(side, [*channels.sides, *named], reading) for side in data], channels


def read_loop(
    data: Data,
    input: Names = None,  # noqa: A002
    output: Names = None,
    reading: ReadOptions | None = None,
    others: Sequence[str] = (),
) -> tuple[list[Recording], str, str]:
    """Return recordings, and the input and output of their loop; see `mckibben.channels.loop_of`.

    Raises
    ------
    DataError
        If a channel is missing, or is that of several muscles.
    """
    from mckibben.channels import channels_of, moved_by

    (recordings,), channels = read_sides(
        [data], lambda runs: channels_of(runs, input, output), (input, output, others), reading
    )
    driving, driven = channels.pair
    return recordings, moved_by(recordings, driving) if input is None else driving, driven


@dataclass(frozen=True, repr=False)
class Contents(Result):
    """Contents of files.

    Parameters
    ----------
    columns : mapping of str to list of Seen
        File -> its columns, and what they are read as; not of folders.
    recordings : list of Recording
    gaps : tuple of Gap, or str
        What the recordings cannot identify, or why that is unknown.
    """

    columns: Mapping[str, list[Seen]]
    recordings: list[Recording]
    gaps: tuple[Gap, ...] | str

    face: ClassVar[str] = "contents"

    @property
    def drawn(self) -> list[Recording]:
        """What a plot of it draws."""
        return self.recordings

    def to_frame(self) -> Any:
        """Return the channels as a data frame: recording, channel, unit, lowest and highest."""
        import pandas as pd

        rows = [
            {
                "recording": run.name,
                "channel": name,
                "unit": run.units[name],
                "min": low,
                "max": high,
            }
            for run in self.recordings
            for name, (low, high) in run.ranges.items()
        ]
        return pd.DataFrame(rows)

    def to_dict(self) -> dict[str, Any]:
        """Return everything but the samples, for JSON."""
        from mckibben.system.atomic import plain

        recordings = [
            {
                "name": run.name,
                "n_samples": run.n_samples,
                "sample_time": run.sample_time,
                "start_time": run.start_time,
                "channels": {
                    name: {
                        "unit": run.units[name],
                        "min": low,
                        "max": high,
                        "lag": lag_of.get(name),
                    }
                    for name, (low, high) in run.ranges.items()
                },
                "meta": dict(run.meta),
            }
            for run in self.recordings
            for lag_of in [{name: run.step * lag.samples for name, lag in lags(run).items()}]
        ]
        content = {"files": plain(self.columns), "recordings": recordings}
        return {**content, "data_gaps": plain(self.gaps)}


def contents(
    data: Data, reading: ReadOptions, inputs: Names = None, outputs: Names = None
) -> Contents:
    """Return the contents of data, and the data gaps of the recordings in them.

    Raises
    ------
    DataError
        If a file cannot be read, or a channel that is named is not there.
    """
    from mckibben.diagnosis.data_gaps import data_gaps
    from mckibben.files import read
    from mckibben.files.reading import look

    named = [*_listed(inputs), *_listed(outputs)] or None
    recordings: list[Recording] = []
    columns: dict[str, list[Seen]] = {}
    if reading.join:
        recordings = read(data, reading, channels=named, informative=False)
    for item in () if reading.join else items(data):
        if isinstance(item, Recording) or (isinstance(item, Path) and item.is_dir()):
            recordings += read(item, reading, channels=named, informative=False)
        else:
            runs, seen = look(item, reading, named)
            recordings += runs
            columns[str(item) if isinstance(item, Path) else runs[0].name] = seen
    gaps: tuple[Gap, ...] | str
    try:
        gaps = data_gaps(recordings, inputs, outputs)
    except DataError as error:
        if named:
            raise
        gaps = str(error)
    return Contents(columns, recordings, gaps)


def _listed(names: Names) -> tuple[str, ...]:
    return (names,) if isinstance(names, str) else tuple(names or ())
