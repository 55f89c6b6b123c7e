"""The package's own recording files: reading one returns the same recording to the last bit."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from mckibben.arrays import Array
from mckibben.errors import DataError, MckibbenError
from mckibben.files.formats import tables
from mckibben.files.table import Column, Table
from mckibben.recording import Recording
from mckibben.system import ordinary
from mckibben.system.atomic import digest, replacing
from mckibben.system.validation import reason


class Stored(BaseModel):
    """Description of a recording in a CSV's sidecar.

    ``sha256`` is of the samples as they are on disk, to see whether they were changed since; ``units``
    are in the order of the columns. With a sample time, the first column is the time.
    """

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)

    format: Literal["mckibben-recording"] = "mckibben-recording"
    version: Literal[1] = 1
    sha256: str
    sample_time: Annotated[float, Field(ge=1e-12, lt=1e11)] | None
    start_time: float
    units: dict[str, str]
    meta: dict[str, Any]

    def table(self, values: dict[str, Array]) -> Table:
        """Return the table of the samples described, by channel."""
        columns = tuple(Column(name, values[name], unit) for name, unit in self.units.items())
        return Table(columns, None, self.sample_time, self.start_time, self.meta, own=True)


def write(recording: Recording, path: str | Path) -> None:
    """Write a recording to a file, from which `read` returns an equal one; an old file is replaced.

    Parameters
    ----------
    recording : Recording
    path : path
        Ends in ``.csv``. The file has a plain header of channel names, ``time`` [s] first where the
        recording has time, and beside it is ``NAME.csv-metadata.json`` with units, time grid and meta.

    Raises
    ------
    DataError
        If the ending is another, the folder cannot be written to, a channel is named ``time``, or
        ``meta`` holds what JSON cannot. What was in the file before is then still there.
    """
    import pandas as pd

    path = Path(path)
    require_csv(path)
    # 1.38, not 1.3800000000000001: the description has the exact step
    time = {} if recording.sample_time is None else {"time": recording.time.round(12)}
    columns = {**time, **recording.channels}
    data = pd.DataFrame(columns).to_csv(index=False, lineterminator="\n").encode()
    description = describe(recording, data, path) + "\n"
    with replacing(path) as new:
        new.write_bytes(data)
    with replacing(sidecar(path)) as new:
        new.write_text(description, encoding="utf-8")


def require_csv(path: Path) -> None:
    """Raise an error for a recording to be written to another file than ``.csv``."""
    if path.suffix.casefold() != ".csv":
        raise DataError("recordings are written as CSV", file=path, remedy="end it in .csv")


def describe(recording: Recording, samples: bytes, path: Path) -> str:
    """Return the description, in JSON, of a recording with these bytes of samples.

    Raises
    ------
    DataError
        If a channel is named ``time``, which the grid is, or as no header can be; or if ``meta`` holds
        what JSON cannot.
    """
    for name, unit in recording.units.items():
        if name == "time" or not name.strip() or not (name + unit).isprintable():
            raise DataError(
                f"no column can be named {name!r} with the unit {unit[:40]!r}",
                file=path,
                channel=name,
                remedy="rename the channel and write its unit in plain letters; the time is written "
                "from the sample time",
            )
    step = recording.sample_time
    stored = Stored.model_construct(
        sha256=digest(samples),
        sample_time=None if step is None else float(step),
        start_time=float(recording.start_time),
        units=dict(recording.units),
        meta=dict(recording.meta),
    )
    try:
        return json.dumps(stored.model_dump(), indent=2, allow_nan=False, ensure_ascii=False)
    except (TypeError, ValueError, RecursionError) as error:
        problem = f"the recording's meta cannot be written as JSON ({error})"
        remedy = "use only text, finite numbers, lists and dicts in meta"
        raise DataError(problem, file=path, remedy=remedy) from None


def parse(text: str | bytes) -> Stored | str:
    """Return the description in a JSON text, or why it is invalid."""
    try:
        found = Stored.model_validate_json(text)
    except ValidationError as error:
        return reason(error)
    words = (*found.units, *found.units.values())
    return found if all(map(str.isprintable, words)) else "its names cannot be printed"


def changed(path: Path) -> DataError:
    """Return the error for samples that are not those described."""
    return DataError(
        "its samples are not those that this package wrote",
        file=path,
        remedy=f"to read it by its header alone, remove {sidecar(path).name}",
    )


def sidecar(path: Path) -> Path:
    """Return the path of a text file's description, named as in W3C's "CSV on the Web".

    >>> sidecar(Path("run.csv")).name
    'run.csv-metadata.json'
    """
    return path.with_name(f"{path.name}-metadata.json")


def description(path: Path) -> Path | None:
    """Return the path of a CSV's description; None for other formats."""
    return sidecar(path) if path.suffix.casefold() == ".csv" else None


def describes(path: Path) -> bool:
    """Return whether a file is a description written by this package."""
    try:
        return isinstance(parse(ordinary.read_bytes(path, most=ordinary.DESCRIPTION)), Stored)
    except MckibbenError:
        return False


def is_own(path: Path) -> bool:
    """Return whether a file is an unchanged recording written by this package."""
    beside = description(path)
    if path.is_symlink() or (beside is not None and not describes(beside)):
        return False
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return all(table.own for table in tables(path))
    except MckibbenError:
        return False
