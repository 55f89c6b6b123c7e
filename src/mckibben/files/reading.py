"""Reading files to recordings: table, channels and units, time grid."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from mckibben.channels import by_name
from mckibben.errors import DataError
from mckibben.files import gaps as gaps_in
from mckibben.files import sources, timebase
from mckibben.files.channels import about
from mckibben.files.choosing import Seen, named_in, seen
from mckibben.files.converting import ASSUMED, in_package_units
from mckibben.files.formats import MOST_BYTES
from mckibben.files.joining import continued, joined
from mckibben.files.memory import Data, InMemory, items, table_of
from mckibben.files.notices import noted, observe, warn
from mckibben.files.remedies import offering
from mckibben.files.request import Request, Source
from mckibben.files.table import Table
from mckibben.files.timebase import Times
from mckibben.keywords import ReadKeywords
from mckibben.options import ReadOptions, given_options
from mckibben.recording import Recording, base_name
from mckibben.signals import resample, zeroed
from mckibben.signals.lags import comes_first, lags

MAY_BE_HELD = frozenset(
    {"displacement", "length", "contraction", "angle", "velocity", "force", "temperature"}
)
"""Channels that may be constant in an experiment."""


def read(
    data: Data,
    options: ReadOptions | None = None,
    *,
    channels: Sequence[str] | None = None,
    informative: bool = True,
    most: float = MOST_BYTES,
    **keywords: Unpack[ReadKeywords],
) -> list[Recording]:
    """Read recordings from files, by their endings, from folders, or from memory.

    What ``channels.toml`` in the same folder states of a file (columns, units, calibrations,
    constants, files with one signal each; see `mckibben.files.channels`) is used where no option is.

    Parameters
    ----------
    data : path, data frame, mapping of str to array_like, Recording, or sequence of these
        A path ends in one of `mckibben.files.formats.READERS`; or is a folder: a bag of ROS 2, files
        with one signal each, or several recordings. Headers of a frame, and names of arrays, are
        understood as those of a file; options apply to a recording as to the file that `write` makes.
    options : ReadOptions, optional
        Its fields may also be given by name; see `mckibben.options.ReadOptions`.
    channels : sequence of str, optional
        Required channels, without missing samples. Others are left out, with a `DataWarning`, if
        samples are missing. By default all channels are required.
    informative : bool
        Whether recordings must be informative: at least 10 samples, and no constant pressure or
        other requested channel, except a length or a force. Otherwise two samples are enough, as
        for simulating a model.
    most : float
        Largest file that is read [bytes].

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
        samples missing or fewer than 10; an option that does not apply.

    Warns
    -----
    DataWarning
        Of units assumed, jittered time that was resampled, channels put on one clock, gaps bridged, and
        what was left out.

    Examples
    --------
    >>> import numpy as np
    >>> time = np.arange(100) / 50
    >>> (run,) = read({"p [kPa]": 100 + 50 * np.sin(time), "x": time**2}, rate=50, units={"x": "cm"})
    >>> run.units["pressure"], float(run["pressure"][0]), run.sample_time
    ('bar', 1.0, 0.02)
    """
    stated = given_options(ReadOptions, options, keywords)
    request = _request(stated, channels=channels, informative=informative, most=most)
    recordings: list[Recording] = []
    part = replace(request, channels=None) if stated.join else request
    for item in items(data):
        if isinstance(item, Path):
            recordings += [
                recording for inner in sources.inside(item) for recording in _read(inner, part)[0]
            ]
        elif isinstance(item, Recording) and not request.interprets:
            recordings.append(item)
        else:
            recordings += _read(item, part)[0]
    recordings = _one_run(recordings, request)
    for item, text in continued(recordings):
        warn(Path(item.source or item.name), text)
    return observe(_prepared(recordings, stated))


def _request(options: ReadOptions, **more: Any) -> Request:
    stated = {option.name: getattr(options, option.name) for option in fields(ReadOptions)}
    return Request(**stated, **more)


def _early(recording: Recording) -> list[str]:
    """Return notes on channels that move before what should drive them."""
    unit = "samples" if recording.sample_time is None else "s"
    return [
        f"channel {name!r} moves {-late.samples * recording.step:.3g} {unit} before the input: if that "
        "drives it, columns are swapped, or clocks differ"
        for name, late in lags(recording).items()
        if comes_first(late)
    ]


def _one_run(recordings: list[Recording], request: Request) -> list[Recording]:
    """Return recordings as one where that is an option, else as they are."""
    if not request.join or not recordings:
        return recordings
    if request.resample is not None:
        recordings = [resample(run, request.resample) for run in recordings]
    with noted() as notes:
        joint = joined(recordings, request)
    return [_with_notes(joint, [*joint.notes, *notes, *_early(joint)])]


def _prepared(recordings: list[Recording], options: ReadOptions) -> list[Recording]:
    """Return recordings cut, resampled and zeroed."""
    if options.between is not None:
        recordings = [run.between(*options.between) for run in recordings]
    if options.resample is not None:
        recordings = [resample(run, options.resample) for run in recordings]
    if options.zero:
        drives = [(*by_name([run])[0], "pressure")[0] for run in recordings]
        pairs = zip(recordings, drives, strict=True)
        recordings = [zeroed(run, list(options.zero), over) for run, over in pairs]
    return recordings


def look(
    data: Path | InMemory,
    options: ReadOptions,
    channels: Sequence[str] | None = None,
    most: float = MOST_BYTES,
) -> tuple[list[Recording], list[Seen]]:
    """Return recordings as `read` does, and columns as `columns_of` does, in one pass.

    ``channels`` must be there; no column is left out for them.
    """
    request = _request(options, channels=channels, informative=False, most=most)
    recordings, source = _read(data, replace(request, channels=None) if request.join else request)
    recordings = _one_run(recordings, request)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # issued when the recordings were read
        columns = seen(replace(source, request=replace(source.request, channels=None)))
    return _prepared(recordings, options), columns


def columns_of(path: str | Path, options: ReadOptions | None = None) -> list[Seen]:
    """Return the columns of a file or a folder's recording, with their channels.

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
    request = replace(_request(options or ReadOptions()), described=about(path))
    (table, *_), _ = sources.tables(path, request)
    return seen(request.of(table, path))


@dataclass(frozen=True)
class _Loaded:
    """The tables of data, where they are from, and what was noted on the way."""

    tables: list[Table]
    path: Path
    meta: Mapping[str, Any]
    notes: list[str]


def _read(data: Path | InMemory, request: Request) -> tuple[list[Recording], Source]:
    """Return the recordings of a file, with notes after earlier ones, and their first table.

    Raises
    ------
    DataError
        With the options that read it, tried here.
    """
    if isinstance(data, Path):
        request.check(data)
        request = replace(request, described=about(data))
    loaded = _loaded(data, request)

    def attempt(changed: Request) -> dict[str, str]:
        same = changed.layout == request.layout
        recordings, sources_used = _interpreted(loaded if same else _loaded(data, changed), changed)
        channels = named_in(sources_used[0])
        return {
            header: name for header, name in channels.items() if name in (*recordings[0], "time")
        }

    try:
        recordings, sources_used = _interpreted(loaded, request)
    except DataError as error:
        before = named_in(request.of(loaded.tables[0], loaded.path))
        raise offering(error, request, before, attempt) from None
    return recordings, sources_used[0]


def _loaded(data: Path | InMemory, request: Request) -> _Loaded:
    with noted() as notes:
        if isinstance(data, Path):
            tables, digest = sources.tables(data, request)
            return _Loaded(tables, data, {"file": str(data), "sha256": digest}, notes)
        table, path = table_of(data)
        request.check(path, text=False)
        return _Loaded([table], path, {}, notes)


def _interpreted(loaded: _Loaded, request: Request) -> tuple[list[Recording], list[Source]]:
    """Return the recordings of tables, and each table with the request."""
    in_memory = "file" not in loaded.meta
    with noted() as notes:
        of_each = [request.of(table, loaded.path, in_memory=in_memory) for table in loaded.tables]
        result = [run for source in of_each for run in _recordings(source, loaded.meta)]
    stated = bool(request.columns or request.units)  # then units that were assumed before are not
    recordings = []
    for recording in result:
        earlier = [note for note in recording.notes if not (stated and note.startswith(ASSUMED))]
        early = [] if of_each[0].table.own else _early(recording)
        for text in early:
            of_each[0].warn(text)
        recordings.append(_with_notes(recording, [*earlier, *loaded.notes, *notes, *early]))
    return recordings, of_each


def _with_notes(recording: Recording, notes: Sequence[str]) -> Recording:
    """Return a recording with these notes, once each; itself if it has them."""
    unique = [*dict.fromkeys(notes)]
    return recording if unique == list(recording.notes) else recording.with_meta(notes=unique)


def _recordings(source: Source, origin: Mapping[str, Any]) -> list[Recording]:
    table, request, path = source.table, source.request, source.path
    in_units, clock, meta = in_package_units(source)
    channels = {name: signal.samples for name, signal in in_units.items()}
    n = next(iter(channels.values())).size
    if n < request.fewest:
        problem = f"{n} sample(s) are too few, at least {request.fewest} are needed"
        raise source.error(problem, "give a longer recording")
    if clock is not None:
        usable = timebase.usable(clock, channels, source)
        channels = {name: samples[usable] for name, samples in channels.items()}
        clock = replace(clock, values=clock.values[usable])
    step = _stated_step(clock, source)
    start = table.start_time if clock is None else clock.seconds(clock.values[0])
    times = clock if step is None else None
    if times is not None:
        times = timebase.increasing(times, source)
    pieces = gaps_in.pieces(channels, times, step, start, source)
    if request.informative:
        _refuse_constant(pieces, source)
    signals = {name: in_units[name] for name in pieces[0].samples}
    units = {name: signal.unit for name, signal in signals.items()}
    now = meta.get("calibration", {})
    for key in ("calibration", "pressure_reference"):  # of channels that are not calibrated now
        if isinstance(before := table.meta.get(key), Mapping):
            meta[key] = {c: v for c, v in before.items() if c not in now} | meta.get(key, {})
    if source.rest_length is not None:
        meta["rest_length"] = source.rest_length
    meta = {**table.meta, **meta, **origin}
    if table.name is not None:
        meta["name"] = f"{path.stem}[{table.name}]"
    recordings = []
    for piece in pieces:
        piece_meta = meta | ({"bridged": piece.bridged} if piece.bridged else {})
        recordings.append(Recording(piece.samples, piece.step, units, piece.start, piece_meta))
    if len(recordings) == 1:
        return recordings
    return [each.with_meta(name=f"{each.name}[{i}]") for i, each in enumerate(recordings, start=1)]


def _stated_step(times: Times | None, source: Source) -> float | None:
    """Return the sample time stated by the caller or the file, checked against the times."""
    table, request = source.table, source.request
    step = table.sample_time if request.step is None else request.step
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
    options = {name: None for name in ("rate", "sample_time") if getattr(request, name) is not None}
    raise source.error(
        problem, "delete the column of times", "time", options=[options] if options else []
    )


def _refuse_constant(pieces: Sequence[gaps_in.Piece], source: Source) -> None:
    for name in source.request.channels or ():
        samples = np.concatenate([piece.samples[name] for piece in pieces])
        may_be_held = base_name(name) in MAY_BE_HELD or name in source.request.constants
        if not may_be_held and np.ptp(samples) == 0:
            remedy = (
                f"give a recording in which it changes, or another column, `columns[{name}]=COLUMN`"
            )
            raise source.error(f"it is constant, at {samples[0]:g}", remedy, name)
