"""Reading files to recordings: table, channels and units, time grid."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from mckibben.files import gaps as gaps_in
from mckibben.files import sources, timebase
from mckibben.files.channels import about
from mckibben.files.choosing import Seen, seen
from mckibben.files.converting import ASSUMED, Times, in_package_units
from mckibben.files.formats import MOST_BYTES
from mckibben.files.notices import noted
from mckibben.files.request import Gaps, Request, Source
from mckibben.recording import Recording

MAY_BE_HELD = frozenset(
    {"displacement", "length", "contraction", "angle", "velocity", "force", "temperature"}
)
"""Channels that may be constant in an experiment."""


def read(
    path: str | Path,
    *,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    rate: float | None = None,
    gaps: Gaps = "error",
    channels: Sequence[str] | None = None,
    informative: bool = True,
    calibration: Mapping[str, tuple[float, float]] | None = None,
    constants: Mapping[str, tuple[float, str]] | None = None,
    most: float = MOST_BYTES,
    raw: bool = False,
    rest_length: float | None = None,
    header: int = 0,
    skip: int = 0,
    encoding: str | None = None,
) -> list[Recording]:
    """Read the recordings in a file, by its ending, or in a folder.

    What ``channels.toml`` in the same folder states of the file (columns, units, calibrations,
    constants, files with one signal each; see `mckibben.files.channels`) is used where no option is.

    Parameters
    ----------
    path : path
        Ends in one of `mckibben.files.formats.READERS`; or a folder: a bag of ROS 2, files with one
        signal each, or several recordings.
    columns : mapping of str to str, optional
        Channel -> column, by its header with or without the unit; ``data[1]`` is the first column of a
        matrix ``data``. Standard channels are found by common names (``p``, ``Druck``, ...)
        without it. ``time`` is a channel here. Other columns with flaws are then left out, with a note.
    units : mapping of str to str, optional
        Channel -> unit, such as ``{"pressure": "kPa"}``; overrides what the file states.
    rate : float, optional
        Samples per second, positive, where there is no column of times. Without either, a scalar in
        the file, such as ``fs``, is used, or the recording has no time. Channels with separate
        times are resampled to this rate.
    gaps : {"error", "split", "interpolate"}
        Treatment of missing time (a step of more than three median steps) and missing samples
        (blank, NaN, infinite, or a code such as -9999): raise an error, split into several
        recordings, or interpolate linearly. Bridged samples are not fitted: ``meta["bridged"]`` has
        their first and last times.
    channels : sequence of str, optional
        Required channels, without missing samples. Others are left out, with a `DataWarning`, if
        samples are missing. By default all channels are required.
    informative : bool
        Whether recordings must be informative: at least 10 samples, and no constant pressure or
        other requested channel, except a length or a force. Otherwise two samples are enough, as
        for simulating a model.
    calibration : mapping of str to (float, float), optional
        Channel -> gain and offset: the channel is gain times the column, plus offset, in the unit that
        ``units`` or else the header states. ``{"displacement": (-1, 0)}`` reverses a sign.
    constants : mapping of str to (float, str), optional
        Channel -> value and unit of a constant quantity without a column, such as ``{"force": (200,
        "g")}``; a mass is converted to its weight. Overrides columns.
    most : float
        Largest file that is read [bytes].
    raw : bool
        Whether codes for missing samples, and counters that seem to wrap, are read as measured.
    rest_length : float, optional
        Length of the muscle at displacement 0 [mm], stored in ``meta``: contraction, displacement
        and length are then converted to each other as needed.
    header : int
        Line of a text with the names of columns, counted from 1; 0 to detect it.
    skip : int
        Lines after it that are left out.
    encoding : str, optional
        Of a text, such as ``"cp932"``; default as found.

    Returns
    -------
    list of Recording
        One; or one for each stretch with ``gaps="split"``, each group of a TDMS file, and each file of
        a folder. In the package's units: bar, mm, N, s, rad, V, mm/s, degC. A file from `write` is
        read as an equal recording. Assumptions, corrections and omissions are listed in
        ``meta["notes"]``.

    Raises
    ------
    DataError
        Naming file, channel, row and remedy: file missing, damaged or of an unknown kind; column
        or unit unknown or contradicted; impossible values; time repeated, going back or with gaps;
        samples missing or fewer than 10.

    Warns
    -----
    DataWarning
        Of units assumed, jittered time that was resampled, channels put on one clock, gaps bridged, and
        what was left out.
    """
    request = Request(
        columns or {},
        units or {},
        rate,
        gaps,
        channels,
        informative,
        calibration or {},
        constants or {},
        most,
        raw,
        rest_length,
        header,
        skip,
        encoding,
    )
    request.check(Path(path))
    return [each for one in sources.inside(Path(path)) for each in _read(one, request)[0]]


def look(path: str | Path, **options: Any) -> tuple[list[Recording], list[Seen]]:
    """Return recordings as `read` does, and columns as `columns_of` does, in one pass.

    Parameters
    ----------
    path : path
    **options
        Those of `read`; ``channels`` does not leave out any column.
    """
    request = Request(**options)
    request.check(Path(path))
    recordings, source = _read(Path(path), request)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # issued when the recordings were read
        return recordings, seen(replace(source, request=replace(source.request, channels=None)))


def columns_of(path: str | Path, **options: Any) -> list[Seen]:
    """Return the columns of a file or a folder's recording, with their channels.

    Parameters
    ----------
    path : path
    **options
        Those of `read`.

    Returns
    -------
    list of Seen
        In the order of the file; of the first recording, where there are several.

    Raises
    ------
    DataError
        If the file is missing or damaged.
    """
    path = Path(path)
    request = replace(Request(**options), described=about(path))
    (table, *_), _ = sources.tables(path, request)
    return seen(request.of(table, path))


def _read(path: Path, request: Request) -> tuple[list[Recording], Source]:
    """Return the recordings of a file, with notes after earlier ones, and their first file."""
    request = replace(request, described=about(path))
    with noted() as notes:
        tables, digest = sources.tables(path, request)
        of_each = [request.of(table, path) for table in tables]
        found = [each for source in of_each for each in _recordings(source, digest)]
    stated = bool(request.columns or request.units)  # then units that were assumed before are not
    recordings = []
    for recording in found:
        earlier = [note for note in recording.notes if not (stated and note.startswith(ASSUMED))]
        both = [*dict.fromkeys([*earlier, *notes])]
        same = both == list(recording.notes)
        recordings.append(recording if same else recording.with_meta(notes=both))
    return recordings, of_each[0]


def _recordings(source: Source, digest: str) -> list[Recording]:
    table, request, path = source.table, source.request, source.path
    found, clock, meta = in_package_units(source)
    channels = {name: signal.samples for name, signal in found.items()}
    n = next(iter(channels.values())).size
    if n < request.fewest:
        problem = f"{n} sample(s) are too few, at least {request.fewest} are needed"
        raise source.error(problem, "give a longer recording")
    step = _stated_step(clock, source)
    start = table.start_time if clock is None else clock.seconds(clock.values[0])
    times = clock if step is None else None
    if times is not None:
        times = replace(times, values=timebase.increasing(times.values, source))
    pieces = gaps_in.pieces(channels, times, step, start, source)
    if request.informative:
        _refuse_constant(pieces, source)
    signals = {name: found[name] for name in pieces[0].samples}
    units = {name: signal.unit for name, signal in signals.items()}
    now = meta.get("calibration", {})
    for key in ("calibration", "pressure_reference"):  # of channels that are not calibrated now
        if isinstance(before := table.meta.get(key), Mapping):
            meta[key] = {c: v for c, v in before.items() if c not in now} | meta.get(key, {})
    if source.rest_length is not None:
        meta["rest_length"] = source.rest_length
    meta = {**table.meta, **meta, "file": str(path), "sha256": digest}
    if table.name is not None:
        meta["name"] = f"{path.stem}[{table.name}]"
    recordings = []
    for piece in pieces:
        known = meta | ({"bridged": piece.bridged} if piece.bridged else {})
        recordings.append(Recording(piece.samples, piece.step, units, piece.start, known))
    if len(recordings) == 1:
        return recordings
    return [each.with_meta(name=f"{each.name}[{i}]") for i, each in enumerate(recordings, start=1)]


def _stated_step(times: Times | None, source: Source) -> float | None:
    """Return the sample time stated by the caller or the file, checked against the times."""
    table, request = source.table, source.request
    step = table.sample_time if request.rate is None else 1.0 / request.rate
    if step is None and times is None and not table.own:
        step = request.described.time.sample_time
        return timebase.stated_step(source) if step is None else step
    if step is None:
        return None
    if table.sample_time is not None and abs(step - table.sample_time) > 1e-3 * step:
        problem = f"the file states {1 / table.sample_time:g} samples per second"
    elif times is not None and not timebase.agrees(times.values, step / times.seconds(1.0)):
        mean = np.mean(np.diff(times.values)) * times.seconds(1.0)
        problem = f"the times are {mean:.6g} s apart on average, or not evenly"
    else:
        return step if table.sample_time is None else table.sample_time
    problem = f"{problem}, which is not the {1 / step:g} a second requested"
    raise source.error(problem, "leave `rate` out, or delete the column of times", "time")


def _refuse_constant(pieces: Sequence[gaps_in.Piece], source: Source) -> None:
    for name in source.request.channels or ():
        samples = np.concatenate([piece.samples[name] for piece in pieces])
        held = name.partition("_")[0] in MAY_BE_HELD or name in source.request.constants
        if not held and np.ptp(samples) == 0:
            remedy = (
                f"give a recording in which it changes, or another column, `columns[{name}]=COLUMN`"
            )
            raise source.error(f"it is constant, at {samples[0]:g}", remedy, name)
