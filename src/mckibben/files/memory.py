"""Data as a user gives them, one by one, and the tables of those in memory."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mckibben.errors import DataError
from mckibben.files.table import Column, Table, column
from mckibben.recording import OWN, Frame, Recording, is_frame, restored, standard_unit
from mckibben.registry import names

InMemory = Recording | Frame | Mapping[str, ArrayLike]
"""A recording, a data frame, or arrays by name."""

Data = str | Path | InMemory | Sequence[str | Path | InMemory]
"""Files or folders with recordings, or data in memory; one or several."""


def items(data: Data) -> list[Path | InMemory]:
    """Return data as a list, also of one; texts are paths, or patterns of some, such as ``run*.csv``.

    Raises
    ------
    DataError
        On the name of a model, where there is no file of that name.
    """
    single = (
        is_frame(data)
        or hasattr(data, "read")
        or isinstance(data, Recording | str | Path | np.ndarray | Mapping)
    )
    listed: Iterable[Any] = data if isinstance(data, Iterable) and not single else [data]
    return [each for one in listed for each in _items(one)]


def _items(item: Any) -> list[Any]:
    if isinstance(item, str | Path):
        if Path(item).exists():
            return [Path(item)]
        if str(item) in {*names("estimators"), *names("blocks")}:
            problem = f"{str(item)!r} is a model, and there is no file of that name"
            raise DataError(problem, remedy="name models with `models`, or give a file")
        path = Path(item)
        return sorted(path.parent.glob(path.name)) or [path]
    return [(restored(item) or item) if is_frame(item) else item]


def table_of(data: InMemory) -> tuple[Table, Path]:
    """Return the table of a data frame, of arrays by name, or of a recording, and its name in errors.

    Raises
    ------
    DataError
        If it is anything else, or an array is not one value a sample.
    """
    if isinstance(data, Recording):
        grid = [] if data.sample_time is None else [Column("time", data.time, "s")]
        columns = [Column(name, x, data.units[name]) for name, x in data.channels.items()]
        table = Table(
            (*grid, *columns), None, data.sample_time, data.start_time, data.meta, own=True
        )
        return table, Path(data.source or data.name)
    if isinstance(data, Mapping):
        times: tuple[Column, ...] = ()
        units, meta, label = dict[str, str](), dict[str, Any](), Path("arrays")
        columns_by_name = {str(name): np.asarray(values) for name, values in data.items()}
    elif is_frame(data):
        frame: Any = data
        index = frame.index
        timed = index.dtype.kind in "mM" or index.name is not None
        if not timed and index.dtype.kind in "iuf" and (index != np.arange(len(index))).any():
            problem, remedy = "its index may be times", "name the index `time`, or reset it"
            raise DataError(problem, file=Path("data frame"), remedy=remedy)
        before = frame.attrs.get(OWN, {})  # of a recording that was changed since
        units = {
            name: unit for name, unit in before.get("units", {}).items() if not standard_unit(name)
        }
        meta = before.get("meta", {})
        times = (column(str(index.name or "time"), index.to_numpy()),) if timed else ()
        columns_by_name = {str(name): frame[name].to_numpy() for name in frame}
        label = Path("data frame")
    else:
        remedy = (
            "give a path, a data frame, arrays by name as {'pressure': u, 'displacement': y}, or make "
            "a mckibben.Recording of these"
        )
        if hasattr(data, "face"):
            remedy = "give recordings; to test a model on some, use `check()`"
        raise DataError(f"a recording cannot be made of {type(data).__name__}", remedy=remedy)
    for name, values in columns_by_name.items():
        if values.ndim != 1:
            problem = f"its samples have shape {values.shape}"
            remedy = "give one value a sample, and several channels by name"
            raise DataError(problem, file=label, channel=name, remedy=remedy)
    columns = [*times, *(column(name, x, units.get(name)) for name, x in columns_by_name.items())]
    if not any(one.values is not None for one in columns):
        raise DataError("it has no numbers", file=label, remedy="give columns of numbers")
    return Table(tuple(columns), meta=meta), label
