"""Reading recordings: the columns of a file, on one time grid, without holes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Literal

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.files import rates, sources, timebase
from mckibben.files.assigning import of_matrix
from mckibben.files.channels import about
from mckibben.files.choosing import ASSUMED, Choice, choose
from mckibben.files.fingerprint import fingerprint
from mckibben.files.holes import Channels, treat
from mckibben.files.notices import listed, noted, warn
from mckibben.files.request import FEWEST, Request
from mckibben.files.table import Table
from mckibben.files.timebase import Span
from mckibben.files.units import convert
from mckibben.recording import AT, ROWS, Recording

MAY_BE_HELD = frozenset(
    {"displacement", "length", "contraction", "angle", "velocity", "force", "temperature"}
)
"""Channels that an experiment can hold: a recording of one length, or under one load, tells all else."""

LONGEST_BRIDGE = 100
"""Times the samples there are: interpolating gaps to more than that is refused."""


@dataclass(frozen=True)
class Piece:
    """Samples on a uniform grid: the step [s], None where there is no time, and the start [s]."""

    samples: Channels
    step: float | None
    start: float


def read(
    path: str | Path,
    *,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    rate: float | None = None,
    gaps: Literal["error", "split", "interpolate"] = "error",
    channels: Sequence[str] | None = None,
    informative: bool = True,
    calibration: Mapping[str, tuple[float, float]] | None = None,
    constants: Mapping[str, tuple[float, str]] | None = None,
) -> list[Recording]:
    """Read the recordings in a file, by its ending, or in a folder.

    What ``channels.toml`` in the same folder says of the file (columns, units, calibrations, constants,
    files with one signal each; see `mckibben.files.channels`) goes behind what is said here.

    Parameters
    ----------
    path : path
        Ends in ``.csv .tsv .txt .dat .parquet .mat .h5 .hdf5 .tdms .xlsx .bag .mcap .db3``; or a
        folder of such files: a bag of ROS 2, files with one signal each, or several recordings.
    columns : mapping of str to str, optional
        Channel -> column, by its header with or without the unit; ``data[1]`` is the first column of a
        matrix ``data``. Standard channels are found by
        common names (``p``, ``Druck``, ``position``, ...) without it. ``time`` is a channel here.
    units : mapping of str to str, optional
        Channel -> unit, such as ``{"pressure": "kPa"}``; goes before what the header says.
    rate : float, optional
        Samples per second, positive, where there is no column of times. Without either, a scalar
        beside the samples may tell it, such as ``fs``, or the recording has no time. Channels with
        times of their own are put on a clock of this rate.
    gaps : {"error", "split", "interpolate"}
        What to do where time is missing (a step of more than three median steps) or a sample is
        (blank, NaN or infinite): refuse, cut into several recordings, or bridge linearly.
    channels : sequence of str, optional
        Channels that must be there and whole. Others are then left out, with a `DataWarning`, if
        samples of theirs are missing. By default all must be whole.
    informative : bool
        Whether there must be something to learn from: at least 10 samples, and no constant pressure
        or other channel asked for that an experiment does not hold, as it does a length or a force.
        Without, two samples will do, as for simulating a model.
    calibration : mapping of str to (float, float), optional
        Channel -> gain and offset: the channel is gain times the column, plus offset, in the unit that
        ``units`` or else the header gives. ``{"displacement": (-1, 0)}`` turns a sign.
    constants : mapping of str to (float, str), optional
        Channel -> value and unit of what was held and stands in no column, such as the force
        ``{"force": (200, "g")}``: a mass is the weight that it hangs with. Go before columns.

    Returns
    -------
    list of Recording
        One; or one for each stretch with ``gaps="split"``, each group of a TDMS file, and each file of
        a folder.
        In the package's units: bar, mm, N, s, rad, V, mm/s, degC. A file that `write` made gives
        a recording equal to the one written. What was assumed or mended on the way is in
        ``meta["notes"]``, a list of sentences, if there was anything.

    Raises
    ------
    DataError
        Naming file, channel, row and remedy: file missing, damaged or of an unknown kind; column
        or unit unknown; time repeated, going back or with gaps; samples missing or fewer than 10.

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
    )
    request.check(path)
    return [each for one in sources.inside(path) for each in _read(one, request)]


def _read(path: Path, request: Request) -> list[Recording]:
    request = replace(request, described=about(path))
    with noted() as notes:
        tables, digest = sources.tables(path, request)
        found = [each for table in tables for each in _recordings(table, request, path, digest)]
    said = bool(request.columns or request.units)
    return [_with_notes(recording, notes, said) for recording in found]


def _with_notes(recording: Recording, notes: list[str], said: bool) -> Recording:
    """Return a recording that tells what was assumed or mended when it was read, now or before.

    Units that were assumed before are not, where it is said now what the columns are.
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
    measured = choice.time if step is None else None
    if step is None and measured is None and (columns := of_matrix(table, time=True)):
        warn(path, f"no column of times is named; say --column time=COLUMN{columns}")
    if measured is not None:
        timebase.check(measured, table, path)
    order = np.arange(n, dtype=float) if measured is None else measured
    begin = table.start_time if choice.time is None else _seconds(choice.time[0], choice)
    channels, spans = treat(choice.channels, order, table, request, path)
    if request.informative:
        _refuse_constant(channels, spans, request, path)
    if measured is None:
        pieces = [
            Piece(_cut(channels, span), step, begin + (step or 1.0) * span[0])
            for span in _long_enough(spans, table, request, path)
        ]
    else:
        pieces = _on_grid(channels, measured, spans, choice, table, request, path)
    units = {name: choice.units[name] for name in channels}
    when = (
        begin + (step or 1.0) * order if measured is None else convert(order, choice.time_unit, "s")
    )
    rows = fingerprint({name: choice.recorded[name] for name in channels}, when)
    meta = _meta(choice, table, path, digest)
    found = [
        Recording(
            piece.samples,
            piece.step,
            units,
            piece.start,
            ({ROWS: rows | {AT: piece.start}} if rows else {}) | meta,
        )
        for piece in pieces
    ]
    if len(found) == 1:
        return found
    return [each.with_meta(name=f"{each.name}[{i}]") for i, each in enumerate(found, start=1)]


def _stated_step(choice: Choice, table: Table, request: Request, path: Path) -> float | None:
    """Return the sample time that the caller or the file states, which the times must not deny."""
    step = table.sample_time if request.rate is None else 1.0 / request.rate
    if step is None and choice.time is None and not table.own:
        said = request.described.time.sample_time
        return rates.sample_time(table.rates, path) if said is None else said
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
    choice: Choice,
    table: Table,
    request: Request,
    path: Path,
) -> list[Piece]:
    """Return the spans on one grid: as they are where times are uniform, else resampled."""
    cuts = [at for at in timebase.gaps(time) for start, stop in spans if start < at < stop]
    if cuts and request.gaps == "error":
        lengths = [_seconds(float(time[at] - time[at - 1]), choice) for at in cuts]
        raise DataError(
            f"there is a gap of {lengths[0]:.6g} s before this row{_among(lengths)}",
            file=path,
            channel="time",
            row=table.row(int(cuts[0])),
            remedy="say --gaps split to cut there or --gaps interpolate to bridge them",
        )
    bridged = bool(cuts) and request.gaps == "interpolate"
    stretches = _split(spans, cuts)
    if request.gaps == "split":
        spans = stretches = _long_enough(stretches, table, request, path)
    step = timebase.common_step(time, stretches)
    seconds = _seconds(step.size, choice)
    if step.jitter is not None:
        rms, worst = (_seconds(deviation, choice) for deviation in step.jitter)
        warn(
            path,
            f"the time is not uniform: its steps deviate from {seconds:.6g} s by {rms:.3g} s rms "
            f"({100 * rms / seconds:.3g} %) and {worst:.3g} s at worst "
            f"({100 * worst / seconds:.3g} %); the samples were interpolated onto a uniform grid",
        )
    if bridged:
        _announce_bridges(time, cuts, step.size, choice, path)
    pieces = []
    for start, stop in _long_enough(spans, table, request, path):
        samples, t = _cut(channels, (start, stop)), time[start:stop]
        if bridged or step.jitter is not None:
            samples = {
                name: timebase.resample(t, values, step.size) for name, values in samples.items()
            }
        pieces.append(Piece(samples, seconds, _seconds(float(t[0]), choice)))
    return pieces


def _among(lengths: Sequence[float]) -> str:
    """Return how long several gaps are, of which the first is told [s]."""
    if len(lengths) < 2:
        return ""
    return (
        f" ({len(lengths)} gaps in all: the longest {max(lengths):.3g} s, the median "
        f"{np.median(lengths):.3g} s, together {sum(lengths):.3g} s)"
    )


def _announce_bridges(
    time: Array, cuts: Sequence[int], step: float, choice: Choice, path: Path
) -> None:
    missing = _seconds(float(sum(time[at] - time[at - 1] for at in cuts)), choice)
    if (time[-1] - time[0]) / step > LONGEST_BRIDGE * time.size:
        raise DataError(
            f"{len(cuts)} gap(s) of {missing:.6g} s in all are too long to interpolate over",
            file=path,
            channel="time",
            remedy="say --gaps split",
        )
    warn(path, f"{len(cuts)} gap(s) in time, {missing:.6g} s in all, were interpolated over")


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
            remedy="say --gaps interpolate, or give a recording with fewer gaps",
        )
    if len(kept) < len(spans):
        rows = [f"{table.row(start)}" for start, stop in spans if stop - start < fewest]
        warn(
            path,
            f"{len(rows)} of {len(spans)} stretches between gaps have fewer than {fewest} samples, "
            f"which no later step can use, and were left out: they begin in row {listed(rows)}",
        )
    return kept


def _split(spans: list[Span], cuts: Sequence[int]) -> list[Span]:
    ends = [[start, *(at for at in cuts if start < at < stop), stop] for start, stop in spans]
    return [pair for edges in ends for pair in pairwise(edges)]


def _cut(channels: Channels, span: Span) -> Channels:
    return {name: samples[span[0] : span[1]] for name, samples in channels.items()}


def _seconds(value: float, choice: Choice) -> float:
    return float(convert(np.array([value]), choice.time_unit, "s")[0])


def _meta(choice: Choice, table: Table, path: Path, digest: str) -> dict[str, object]:
    name = {} if table.name is None else {"name": f"{path.stem}[{table.name}]"}
    return {**table.meta, **choice.meta, **name, "file": str(path), "sha256": digest}
