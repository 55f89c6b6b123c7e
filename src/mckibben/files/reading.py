"""From a file to recordings: a table, its channels and units, its time grid."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.files import quality, sources, timebase
from mckibben.files.channels import about
from mckibben.files.choosing import ASSUMED, Choice, Seen, choose, matrix_hint, seen
from mckibben.files.fingerprint import fingerprint
from mckibben.files.notices import listed, noted, warn
from mckibben.files.quality import Channels, Mask
from mckibben.files.request import FEWEST, Gaps, Request
from mckibben.files.table import Table
from mckibben.files.timebase import Span
from mckibben.files.units import convert
from mckibben.recording import AT, ROWS, Recording

MAY_BE_HELD = frozenset(
    {"displacement", "length", "contraction", "angle", "velocity", "force", "temperature"}
)
"""Channels that an experiment can hold constant."""

LONGEST_BRIDGE = 100
"""Most samples to which gaps are interpolated, over those there are."""

LONGEST_STEP = 5.0
"""Longest sample time [s] that is believed of times without a certain unit."""


@dataclass(frozen=True)
class Piece:
    """Samples on a uniform grid: the step [s], None without time, and the start [s]."""

    samples: Channels
    step: float | None
    start: float
    bridged: Mask


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
    most: float = 2.0**31,
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
        Samples per second, positive, where there is no column of times. Without either, a scalar
        beside the samples may state it, such as ``fs``, or the recording has no time. Channels with
        times of their own are put on a clock of this rate.
    gaps : {"error", "split", "interpolate"}
        What to do where time is missing (a step of more than three median steps) or a sample is
        (blank, NaN, infinite, or a code such as -9999): refuse, cut into several recordings, or bridge
        linearly. Bridged samples are not fitted: ``meta["bridged"]`` has their first and last times.
    channels : sequence of str, optional
        Channels that must be there and whole. Others are left out, with a `DataWarning`, if samples of
        theirs are missing. By default all must be whole.
    informative : bool
        Whether there must be something to learn from: at least 10 samples, and no constant pressure
        or other channel asked for that an experiment does not hold, as it does a length or a force.
        Without, two samples are enough, as for simulating a model.
    calibration : mapping of str to (float, float), optional
        Channel -> gain and offset: the channel is gain times the column, plus offset, in the unit that
        ``units`` or else the header gives. ``{"displacement": (-1, 0)}`` turns a sign.
    constants : mapping of str to (float, str), optional
        Channel -> value and unit of what was held and is in no column, such as the force
        ``{"force": (200, "g")}``: a mass is the weight that it hangs with. Override columns.
    most : float
        Largest file that is read [bytes].

    Returns
    -------
    list of Recording
        One; or one for each stretch with ``gaps="split"``, each group of a TDMS file, and each file of
        a folder. In the package's units: bar, mm, N, s, rad, V, mm/s, degC. A file that `write` made
        gives a recording equal to the one written. What was assumed, mended or left out is in
        ``meta["notes"]``, a list of sentences, if anything was.

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
    path = Path(path)
    request = Request(
        dict(columns or {}),
        dict(units or {}),
        rate,
        gaps,
        channels,
        informative,
        dict(calibration or {}),
        dict(constants or {}),
        most,
    )
    request.check(path)
    return [each for one in sources.inside(path) for each in _read(one, request)]


def columns_of(path: str | Path, **options: Any) -> list[Seen]:
    """Return the columns of a file or a folder's recording, and the channel that each is read as.

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
    return seen(table, request.describing(table), path)


def _read(path: Path, request: Request) -> list[Recording]:
    request = replace(request, described=about(path))
    with noted() as notes:
        tables, digest = sources.tables(path, request)
        found = [each for table in tables for each in _recordings(table, request, path, digest)]
    said = bool(request.columns or request.units)
    return [_with_notes(recording, notes, said) for recording in found]


def _with_notes(recording: Recording, notes: list[str], said: bool) -> Recording:
    """Return a recording with the notes of this reading after earlier ones.

    Units that were assumed before are not, where it is stated now what the columns are.
    """
    known = [note for note in recording.notes if not (said and note.startswith(ASSUMED))]
    told = known + [note for note in notes if note not in known]
    return recording if told == list(recording.notes) else recording.with_meta(notes=told)


def _recordings(table: Table, request: Request, path: Path, digest: str) -> list[Recording]:
    choice = choose(table, request, path)
    n = next(iter(choice.channels.values())).size
    if n < request.fewest:
        raise DataError(
            f"{n} sample(s) are too few, at least {request.fewest} are needed",
            file=path,
            remedy="give a longer recording",
        )
    step = _stated_step(choice, table, request, path)
    time = choice.time if step is None else None
    if step is None and time is None and (columns := matrix_hint(table, time=True)):
        warn(path, f"no column of times is named; use --column time=COLUMN{columns}")
    if time is not None:
        time = timebase.checked(time, table, path)
    order = np.arange(n, dtype=float) if time is None else time
    begin = table.start_time if choice.time is None else _seconds(choice.time[0], choice)
    channels, spans, bridged = quality.fill(choice.channels, order, table, request, path)
    if request.informative:
        _refuse_constant(channels, spans, request, path)
    if time is None:
        pieces = [
            Piece(
                _cut(channels, span), step, begin + (step or 1.0) * span[0], bridged[slice(*span)]
            )
            for span in _long_enough(spans, table, request, path)
        ]
    else:
        pieces = _on_grid(channels, time, spans, bridged, choice, table, request, path)
    units = {name: choice.units[name] for name in channels}
    when = begin + (step or 1.0) * order if time is None else convert(order, choice.time_unit, "s")
    rows = fingerprint({name: choice.recorded[name] for name in channels}, when)
    meta = _meta(choice, table, path, digest)
    found = [
        Recording(
            piece.samples,
            piece.step,
            units,
            piece.start,
            ({ROWS: rows | {AT: piece.start}} if rows else {}) | meta | _bridged(piece),
        )
        for piece in pieces
    ]
    if len(found) == 1:
        return found
    return [each.with_meta(name=f"{each.name}[{i}]") for i, each in enumerate(found, start=1)]


def _stated_step(choice: Choice, table: Table, request: Request, path: Path) -> float | None:
    """Return the sample time that the caller or the file states, which the times must not contradict."""
    step = table.sample_time if request.rate is None else 1.0 / request.rate
    if step is None and choice.time is None and not table.own:
        said = request.described.time.sample_time
        return timebase.stated_step(table.rates, path) if said is None else said
    if step is None:
        return None
    if table.sample_time is not None and abs(step - table.sample_time) > 1e-3 * step:
        problem = f"the file states {1 / table.sample_time:g} samples per second"
    elif choice.time is not None and not timebase.agrees(choice.time, step / _seconds(1.0, choice)):
        lasting = _seconds(float(choice.time[-1] - choice.time[0]), choice)
        mean = (choice.time.size - 1) / lasting if lasting else np.nan
        problem = f"the column of times has {mean:.6g} samples per second on average"
    else:
        return step if table.sample_time is None else table.sample_time
    raise DataError(
        f"{problem}, or not evenly, which is not the {1 / step:g} asked for",
        file=path,
        channel="time",
        remedy="leave --rate out, or delete the column of times",
    )


def _on_grid(
    channels: Channels,
    time: Array,
    spans: list[Span],
    bridged: Mask,
    choice: Choice,
    table: Table,
    request: Request,
    path: Path,
) -> list[Piece]:
    """Return the spans on one grid: as they are where times are uniform, else resampled."""
    cuts = [at for at in timebase.gaps(time) for start, stop in spans if start < at < stop]
    lengths = [_seconds(float(time[at] - time[at - 1]), choice) for at in cuts]
    if cuts and request.gaps == "error":
        among = (
            f" ({len(cuts)} gaps in all, together {sum(lengths):.3g} s)" if len(cuts) > 1 else ""
        )
        raise DataError(
            f"there is a gap of {lengths[0]:.6g} s before this row{among}",
            file=path,
            channel="time",
            row=table.row(int(cuts[0])),
            remedy="use --gaps split to cut there or --gaps interpolate to bridge them",
        )
    over = bool(cuts) and request.gaps == "interpolate"
    stretches = _split(spans, cuts)
    if request.gaps == "split":
        spans = stretches = _long_enough(stretches, table, request, path)
    step = timebase.common_step(time, stretches)
    seconds = _seconds(step.size, choice)
    if seconds > LONGEST_STEP and not choice.stated:
        raise DataError(
            f"its steps are {seconds:.6g} s: is time in ms?",
            file=path,
            channel="time",
            row=table.row(0),
            remedy="name its unit, as in --unit time=ms, or --unit time=s where that is right",
        )
    if step.jitter is not None:
        rms, worst = (_seconds(deviation, choice) for deviation in step.jitter)
        warn(
            path,
            f"the time is not uniform: its steps deviate from {seconds:.6g} s by {rms:.3g} s rms "
            f"({100 * rms / seconds:.3g} %) and {worst:.3g} s at worst "
            f"({100 * worst / seconds:.3g} %); the samples were interpolated onto a uniform grid",
        )
    if over:
        if (time[-1] - time[0]) / step.size > LONGEST_BRIDGE * time.size:
            raise DataError(
                f"{len(cuts)} gap(s) of {sum(lengths):.6g} s in all are too long to interpolate over",
                file=path,
                channel="time",
                remedy="use --gaps split",
            )
        warn(
            path, f"{len(cuts)} gap(s) in time, {sum(lengths):.6g} s in all, were interpolated over"
        )
    pieces = []
    for start, stop in _long_enough(spans, table, request, path):
        samples, t, mended = _cut(channels, (start, stop)), time[start:stop], bridged[start:stop]
        if over or step.jitter is not None:
            grid = timebase.grid(t, step.size)
            samples = {name: np.interp(grid, t, values) for name, values in samples.items()}
            # a sample of the grid is bridged where either neighbour is, or both enclose a gap
            after = np.clip(np.searchsorted(t, grid - 1e-9 * step.size), 1, t.size - 1)
            gap = np.isin(after + start, cuts) & (grid < t[after] - 1e-6 * step.size)
            gap &= grid > t[after - 1] + 1e-6 * step.size
            mended = (mended[after] & mended[after - 1]) | gap
        pieces.append(Piece(samples, seconds, _seconds(float(t[0]), choice), mended))
    return pieces


def _refuse_constant(channels: Channels, spans: list[Span], request: Request, path: Path) -> None:
    for name in request.channels or ():
        samples = np.concatenate([channels[name][start:stop] for start, stop in spans])
        held = name.partition("_")[0] in MAY_BE_HELD or name in request.constants
        if not held and samples.size and np.ptp(samples) == 0:
            raise DataError(
                f"it is constant, at {samples[0]:g}",
                file=path,
                channel=name,
                remedy=f"give a recording in which it changes, or --column {name}=COLUMN",
            )


def _long_enough(spans: list[Span], table: Table, request: Request, path: Path) -> list[Span]:
    """Return the spans that are not too short to be of use: of a split, to any later step."""
    fewest = FEWEST if len(spans) > 1 else request.fewest
    kept = [span for span in spans if span[1] - span[0] >= fewest]
    if not kept:
        raise DataError(
            f"no stretch without gaps has {fewest} samples",
            file=path,
            remedy="use --gaps interpolate, or give a recording with fewer gaps",
        )
    if len(kept) < len(spans):
        rows = [f"{table.row(start)}" for start, stop in spans if stop - start < fewest]
        warn(
            path,
            f"{len(rows)} of {len(spans)} stretches between gaps have fewer than {fewest} samples and "
            f"were left out: they begin in row {listed(rows)}",
        )
    return kept


def _split(spans: list[Span], cuts: Sequence[int]) -> list[Span]:
    ends = [[start, *(at for at in cuts if start < at < stop), stop] for start, stop in spans]
    return [pair for edges in ends for pair in pairwise(edges)]


def _cut(channels: Channels, span: Span) -> Channels:
    return {name: samples[span[0] : span[1]] for name, samples in channels.items()}


def _seconds(value: float, choice: Choice) -> float:
    return float(convert(np.array([value]), choice.time_unit, "s")[0])


def _bridged(piece: Piece) -> dict[str, Any]:
    """Return the first and last times of interpolated samples as ``meta`` lists them."""
    edges = np.flatnonzero(np.diff(piece.bridged.astype(np.int8), prepend=0, append=0))
    times = piece.start + (piece.step or 1.0) * (edges.reshape(-1, 2) - [0, 1])
    return {"bridged": times.tolist()} if edges.size else {}


def _meta(choice: Choice, table: Table, path: Path, digest: str) -> dict[str, object]:
    name = {} if table.name is None else {"name": f"{path.stem}[{table.name}]"}
    return {**table.meta, **choice.meta, **name, "file": str(path), "sha256": digest}
