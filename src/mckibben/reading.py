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
    return [one for one in items(data) if isinstance(one, Path)]


def loaded(data: Data) -> list[InMemory]:
    """Return what of data is in memory."""
    return [one for one in items(data) if not isinstance(one, Path)]


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
                found = [read_files(some, needed, reading) for some in data]
            if reading.rest_length is not None:
                found = [[one.with_derived(named or [DERIVED]) for one in some] for some in found]
            channels = resolve([one for some in found for one in some])
        except DataError:
            if needed is None:
                raise
            continue
        every = [one for runs in found for one in runs]
        wanted = (*channels.sides, *(named if needed is not None else ()))
        if all(name in one for one in every for name in wanted):
            for one in caught:
                warnings.warn(one.message, one.category, stacklevel=2)
            return found, channels
    assert channels is not None
    return [read_files(some, [*channels.sides, *named], reading) for some in data], channels


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
    given, wanted = channels.pair
    return recordings, moved_by(recordings, given) if input is None else given, wanted


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
                "recording": one.name,
                "channel": name,
                "unit": one.units[name],
                "min": low,
                "max": high,
            }
            for one in self.recordings
            for name, (low, high) in one.ranges.items()
        ]
        return pd.DataFrame(rows)

    def to_dict(self) -> dict[str, Any]:
        """Return everything but the samples, for JSON."""
        from mckibben.system.atomic import plain

        recordings = [
            {
                "name": one.name,
                "n_samples": one.n_samples,
                "sample_time": one.sample_time,
                "start_time": one.start_time,
                "channels": {
                    name: {"unit": one.units[name], "min": low, "max": high, "lag": late.get(name)}
                    for name, (low, high) in one.ranges.items()
                },
                "meta": dict(one.meta),
            }
            for one in self.recordings
            for late in [{name: one.step * lag.samples for name, lag in lags(one).items()}]
        ]
        read = {"files": plain(self.columns), "recordings": recordings}
        return {**read, "data_gaps": plain(self.gaps)}


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
    for one in () if reading.join else items(data):
        if isinstance(one, Recording) or (isinstance(one, Path) and one.is_dir()):
            recordings += read(one, reading, channels=named, informative=False)
        else:
            found, seen = look(one, reading, named)
            recordings += found
            columns[str(one) if isinstance(one, Path) else found[0].name] = seen
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
