"""Recordings from files, read and prepared for an operation."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mckibben.errors import DataError
from mckibben.options import ReadOptions
from mckibben.recording import Recording, is_frame
from mckibben.recording import listed as recordings_of

if TYPE_CHECKING:
    from mckibben.channels import Channels, Names
    from mckibben.diagnosis.data_gaps import Gap
    from mckibben.files.choosing import Seen

Data = Recording | str | Path | Sequence[Recording | str | Path]
"""Recordings, or files or folders with some."""


def prepared(recordings: list[Recording], reading: ReadOptions) -> list[Recording]:
    """Return recordings cut, resampled and zeroed."""
    from mckibben.channels import by_name
    from mckibben.signals import cut, resample, zeroed

    if reading.between is not None:
        recordings = [cut(one, *reading.between) for one in recordings]
    if reading.resample is not None:
        recordings = [resample(one, reading.resample) for one in recordings]
    if reading.zero:
        drives = [(*by_name([one])[0], "pressure")[0] for one in recordings]
        pairs = zip(recordings, drives, strict=True)
        recordings = [zeroed(one, list(reading.zero), over) for one, over in pairs]
    return recordings


def items(data: Any) -> list[Recording | Path]:
    """Return data as a list of recordings and files; data frames are converted to recordings.

    Raises
    ------
    DataError
        If there is anything else.
    """
    single = is_frame(data) or isinstance(data, Recording | str | Path | np.ndarray)
    listed = [data] if single or not isinstance(data, Iterable) else list(data)
    found: list[Recording | Path] = []
    for one in listed:
        if isinstance(one, str | Path):
            found.append(Path(one))
        else:
            found += recordings_of(one)
    return found


def files_of(data: Data) -> list[Path]:
    """Return the files among data."""
    return [one for one in items(data) if isinstance(one, Path)]


def loaded(data: Data) -> list[Recording]:
    """Return the recordings among data."""
    return [one for one in items(data) if isinstance(one, Recording)]


def read_files(
    data: Data,
    channels: Sequence[str] | None,
    reading: ReadOptions | None = None,
) -> list[Recording]:
    """Return recordings, and those in files and folders, which must have some channels."""
    from mckibben.files import read

    reading = reading or ReadOptions()
    found: list[Recording] = []
    for one in items(data):
        if isinstance(one, Recording):
            found.append(one)
        else:
            found += read(one, channels=channels, informative=False, **reading.arguments())
    return prepared(found, reading)


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
    named = [n for names in words for n in ([names] if isinstance(names, str) else names or ())]
    with warnings.catch_warnings(record=True) as caught:
        found = [read_files(some, named, reading) for some in data]
    if reading.rest_length is not None and not named:
        found = [[one.with_derived(["displacement"]) for one in some] for some in found]
    channels = resolve([one for some in found for one in some])
    if any(name not in one for runs in found for one in runs for name in channels.sides):
        needed = [*channels.sides, *named]
        return [read_files(some, needed, reading) for some in data], channels  # or raises
    for one in caught:
        warnings.warn(one.message, one.category, stacklevel=2)
    return found, channels


def read_loop(
    data: Data,
    input: str | None = None,  # noqa: A002
    output: str | None = None,
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


@dataclass(frozen=True)
class Contents:
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
                    name: {
                        "unit": one.units[name],
                        "min": float(samples.min()),
                        "max": float(samples.max()),
                    }
                    for name, samples in one.channels.items()
                },
                "meta": dict(one.meta),
            }
            for one in self.recordings
        ]
        read = {"files": plain(self.columns), "recordings": recordings}
        return {**read, "data_gaps": plain(self.gaps)}


def look(
    files: Sequence[Path],
    reading: ReadOptions,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> Contents:
    """Return the contents of files, and the data gaps of the recordings in them.

    Raises
    ------
    DataError
        If a file cannot be read, or a channel that is named is not there.
    """
    from mckibben.diagnosis.data_gaps import data_gaps
    from mckibben.files import read
    from mckibben.files.reading import look as look_into

    named = [*(inputs or ()), *(outputs or ())] or None
    arguments = {"channels": named, "informative": False, **reading.arguments()}
    recordings: list[Recording] = []
    columns: dict[str, list[Seen]] = {}
    for file in files:
        if file.is_dir():
            recordings += read(file, **arguments)
        else:
            found, columns[str(file)] = look_into(file, **arguments)
            recordings += found
    recordings = prepared(recordings, reading)
    gaps: tuple[Gap, ...] | str
    try:
        gaps = data_gaps(recordings, inputs, outputs)
    except DataError as error:
        if named:
            raise
        gaps = str(error)
    return Contents(columns, recordings, gaps)
