"""The files of a recording: one, several with one signal each, or a ROS 2 bag folder."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from io import BufferedReader
from pathlib import Path

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.files import formats, timebase
from mckibben.files.channels import NAME, described
from mckibben.files.converting import starts_of, times_of
from mckibben.files.headers import is_standard, is_time, parse
from mckibben.files.own import description
from mckibben.files.request import Request, Source
from mckibben.files.stacked import unstacked
from mckibben.files.table import Column, Table
from mckibben.files.units import convert
from mckibben.system.ordinary import DESCRIPTION, opened, read_text

BAG = "metadata.yaml"
"""Metadata file of a ROS 2 bag folder."""

PROTOCOL = "protocol.json"
"""File with the role of each recording in its folder."""

ROLES = ("train", "validation", "test")


def is_bag(path: Path) -> bool:
    """Return whether a folder is a bag of ROS 2."""
    return path.is_dir() and (path / BAG).is_file()


def inside(path: Path) -> list[Path]:
    """Return the recordings of a path: itself, unless it is a folder of several.

    Of files that are one recording by ``join`` in ``channels.toml``, the first represents all.

    Raises
    ------
    DataError
        If a folder has no recordings.
    """
    if not path.is_dir() or is_bag(path):
        return [path]
    recordings = _files(path) + [file for file in _listed(path) if is_bag(file)]
    if not recordings:
        raise DataError(
            "there is no recording in the folder", file=path, remedy="put recordings in it"
        )
    if os.path.lexists(path / PROTOCOL):
        return recordings
    settings = described(path)
    return list(dict.fromkeys(path / next(iter(settings.parts(file.name))) for file in recordings))


def roles(path: Path) -> dict[str, list[Path]]:
    """Return the recordings of a path by role from its protocol.json, or all to train.

    Raises
    ------
    DataError
        If there are none, or ``protocol.json`` cannot be read; else those of `inside`.
    """
    recordings = inside(path)
    if not os.path.lexists(path / PROTOCOL):
        return {"train": recordings}
    text = read_text(path / PROTOCOL, most=DESCRIPTION)
    by_role: dict[str, list[Path]] = {role: [] for role in ROLES}
    with formats.refusing(path / PROTOCOL):
        role_by_name = {run["name"]: run["role"] for run in json.loads(text)["runs"]}
        for file in recordings:
            by_role[role_by_name.get(file.stem, "train")].append(file)
    return by_role


def expanded(
    files: Sequence[Path], test: Sequence[Path]
) -> tuple[list[Path], list[Path], list[Path]]:
    """Return files to train, validate and test on, folders expanded to their recordings.

    Recordings in a folder of ``files`` have their own roles; all of ``test`` are to test on. Errors are
    those of `roles`.
    """
    by_role = [roles(file) for file in files]
    train, validation, tests = (
        [p for roles_ in by_role for p in roles_.get(role, [])] for role in ROLES
    )
    return train, validation, tests + [path for file in test for path in inside(file)]


def tables(path: Path, request: Request) -> tuple[list[Table], str]:
    """Return the raw contents of a recording, and the SHA-256 of its files.

    Raises
    ------
    DataError
        If there are no files, or one changes while it is read; else those of
        `mckibben.files.formats.read`.
    """
    parts = _parts(path)
    if not parts:
        raise DataError("there is no recording in it", file=path, remedy="copy all of its files")
    tables_by_file: dict[Path, list[Table]] = {}
    digests: list[str] = []
    with ExitStack() as stack:
        files = {part: stack.enter_context(opened(part, most=int(request.most))) for part in parts}
        before = [_state(file) for file in files.values()]
        if is_bag(path):
            tables_by_file[path] = formats.bag(path)
        else:
            for part, file in files.items():
                lines = request.header, request.skip, request.encoding
                text = formats.laid_out(file, part, *lines)
                several = formats.read(text, part, request.sheet)
                tables_by_file[part] = [unstacked(table, part) for table in several]
        for (part, file), state in zip(files.items(), before, strict=True):
            file.seek(0)
            digests.append(hashlib.file_digest(file, "sha256").hexdigest())
            if _state(file) != state:
                problem = "it changed while it was read"
                remedy = "wait until whatever writes it is done, then read it again"
                raise DataError(problem, file=part, remedy=remedy)
    digest, *more = digests
    if more:
        digest = hashlib.sha256("".join(digests).encode()).hexdigest()
    if len(tables_by_file) == 1:
        return next(iter(tables_by_file.values())), digest
    for part, several in tables_by_file.items():
        if len(several) > 1:
            problem = f"it holds {len(several)} recordings, where one signal is expected"
            raise DataError(problem, file=part, remedy=f"leave it out of join in {NAME}")
    table = _joined({part: several[0] for part, several in tables_by_file.items()}, parts, request)
    return [table], digest


def read_with(path: Path) -> list[Path]:
    """Return all files that are read with this file or folder; some may be missing.

    They are the parts of recordings and what describes them.
    """
    if path.is_dir():
        parts = [
            file for folder in (path, *filter(is_bag, _listed(path))) for file in _files(folder)
        ]
        settings = [path / NAME, path / PROTOCOL, path / BAG]
    else:
        parts, settings = [*_parts(path)], [path.with_name(NAME)]
    return [*parts, *filter(None, map(description, parts)), *settings]


def _parts(path: Path) -> dict[Path, str]:
    """Return the files of a recording -> the names of their signals, if there are several."""
    if path.is_dir():
        return dict.fromkeys(_files(path), "")
    parts = described(path.parent).parts(path.name)
    return {path.with_name(file): name for file, name in parts.items()}


def _state(file: BufferedReader) -> tuple[int, int]:
    status = os.fstat(file.fileno())
    return status.st_mtime_ns, status.st_size


def _files(folder: Path) -> list[Path]:
    endings = (*formats.SOUGHT, ".zstd") if is_bag(folder) else formats.SOUGHT  # packed parts
    files = (file for file in _listed(folder) if file.suffix.casefold() in endings)
    return [file for file in files if file.is_file()]


def _listed(folder: Path) -> list[Path]:
    with formats.refusing(folder):
        return sorted(folder.iterdir())


def _joined(tables: Mapping[Path, Table], names: Mapping[Path, str], request: Request) -> Table:
    """Return one table from files with one signal each, given the names of the signals."""
    stamp = request.columns.get("time", request.described.time.column)
    signals: list[Column] = []
    clocks: list[Column] = []
    split = {path: _split(table, stamp) for path, table in tables.items()}
    timed = any(times for _, times in split.values())
    for path, (numbers, times) in split.items():
        channel = problem = None
        if len(numbers) != 1:
            problem = f"it has {len(numbers)} columns of numbers, where one signal is expected"
        elif len(times) != timed:
            channel = "time"
            problem = f"it has {len(times)} columns of times, where another file has one"
        elif tables[path].meta.get("calibration"):
            problem = "it was calibrated before it was written by mckibben"
        if problem:
            remedy = (
                "save one signal in every file, and one column of times in all or in none, and "
                f"use `rate`; or leave the file out of join in {NAME}"
            )
            raise DataError(problem, file=path, channel=channel, remedy=remedy)
        signals.append(_named(numbers[0], names[path]))
        clocks += times
    grids = {(table.sample_time, table.start_time) for table in tables.values()}
    has_clocks = timed or (len(grids) > 1 and all(step is not None for step, _ in grids))
    lengths = {path.name: table.n_samples for path, table in tables.items()}
    if not has_clocks and len(set(lengths.values())) > 1:
        listing = ", ".join(f"{name} {n}" for name, n in lengths.items())
        problem = f"its files have no times and differ in length: {listing}"
        remedy = f"save times in each file, or leave one out of join in {NAME}"
        raise DataError(problem, file=next(iter(tables)).parent, remedy=remedy)
    items = tables.items()
    step, start = grids.pop() if len(grids) == 1 else (None, 0.0)
    together = Table(
        (*clocks[:1], *signals),
        next(iter(tables.values())).lines,
        step,
        start,
        rates={
            f"{path.name}/{n}": rate for path, table in items for n, rate in table.rates.items()
        },
        unread={
            f"{path.name}/{n}": why for path, table in items for n, why in table.unread.items()
        },
    )
    if not has_clocks:
        return together
    if timed:
        sources = [Source(table, request, path) for path, table in items]
        read = [times_of(clock, source) for clock, source in zip(clocks, sources, strict=True)]
        pairs = zip(read, starts_of(read, sources[0]), sources, strict=True)
        seconds = [late + _elapsed(clock, source) for clock, late, source in pairs]
    else:
        seconds = [
            table.start_time + (table.sample_time or 0.0) * np.arange(table.n_samples, dtype=float)
            for table in tables.values()
        ]
    if timed and all(np.array_equal(times, seconds[0]) for times in seconds):
        return together
    columns = (replace(signal, times=times) for signal, times in zip(signals, seconds, strict=True))
    return replace(together, columns=tuple(columns), lines=None)


def _elapsed(clock: timebase.Times, source: Source) -> Array:
    """Return increasing times [s]."""
    clock = timebase.increasing(clock, source)
    return convert(clock.values, clock.unit, "s")


def _split(table: Table, stamp: str | None) -> tuple[list[Column], list[Column]]:
    """Return the signals of a table, and its times."""
    signals: list[Column] = []
    times: list[Column] = []
    for column in table.columns:
        if stamp in (column.header, parse(column.label).name) or is_time(column.label):
            times.append(column)
        elif column.values is not None:
            signals.append(column)
    return signals, times


def _named(column: Column, name: str) -> Column:
    """Return a column named after its file if that is a channel, or else after its header."""
    if is_standard(column.header) and not is_standard(name):
        return replace(column, header=name, alias=column.header)
    return replace(column, header=name, unit=column.unit or parse(column.header).unit)
