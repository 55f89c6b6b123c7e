"""The package's own recording files: reading one returns the same recording to the last bit."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from mckibben.arrays import Array
from mckibben.errors import DataError, MckibbenError
from mckibben.files.formats import tables
from mckibben.files.notices import warn
from mckibben.files.table import Column, Table
from mckibben.printing import encoded
from mckibben.recording import Recording
from mckibben.system.atomic import digest, replacing
from mckibben.system.ordinary import DESCRIPTION, read_bytes
from mckibben.system.validation import reason

VERSION: Final = 2
"""Version of the description that is written; of version 1, ``sha256`` is of the samples alone."""

Plain = Annotated[str, Field(pattern=r"^[^\p{Cc}\p{Cf}\p{Zl}\p{Zp}]*$")]
"""A text that can be printed."""


class Stored(BaseModel):
    """Description of a recording in a CSV's sidecar.

    ``sha256`` is of all else in it and the samples as they are on disk; ``units`` are in the order of
    the columns. With a sample time, the first column is the time.
    """

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)

    format: Literal["mckibben-recording"]
    version: Literal[1, 2]
    sha256: str
    sample_time: Annotated[float, Field(ge=1e-12, lt=1e11)] | None
    start_time: float
    units: dict[Plain, Plain]
    meta: dict[Any, Any]

    def digest(self, samples: bytes) -> str:
        """Return what ``sha256`` is to be, for these bytes of samples."""
        if self.version == 1:
            return digest(samples)
        contents = json.dumps(self.model_dump(exclude={"sha256"}), allow_nan=False)
        return digest(contents.encode() + b"\n" + samples)

    @property
    def header(self) -> list[str]:
        """Names of the columns."""
        return [*([] if self.sample_time is None else ["time"]), *self.units]

    def table(self, values: dict[str, Array], path: Path) -> Table:
        """Return the table of the samples described; raise an error if their times are others."""
        if self.sample_time is not None:
            times = on_grid(self.sample_time, self.start_time, values["time"].size)
            if not np.allclose(values["time"], times, rtol=1e-15, atol=1e-12):
                raise conflict(path)
        columns = tuple(Column(name, values[name], unit) for name, unit in self.units.items())
        return Table(columns, None, self.sample_time, self.start_time, self.meta, own=True)


def on_grid(step: float, start: float, n: int) -> Array:
    """Return the times in a file: 1.38, not 1.3800000000000001, as the description has the step."""
    return (start + step * np.arange(n, dtype=np.float64)).round(12)


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
    step, start, n = recording.sample_time, recording.start_time, recording.n_samples
    time = {} if step is None else {"time": on_grid(step, start, n)}
    columns = {**time, **recording.channels}
    data = pd.DataFrame(columns).to_csv(index=False, lineterminator="\n").encode()
    description = describe(recording, data, path)
    with replacing(path) as new:
        new.write_bytes(data)
    with replacing(sidecar(path)) as new:
        new.write_bytes(description)


def require_csv(path: Path) -> None:
    """Raise an error for a recording to be written to another file than ``.csv``."""
    if path.suffix.casefold() != ".csv":
        raise DataError("recordings are written as CSV", file=path, remedy="end it in .csv")


def describe(recording: Recording, samples: bytes, path: Path) -> bytes:
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
    about = {
        "format": "mckibben-recording",
        "version": VERSION,
        "sha256": "",
        "sample_time": None if step is None else float(step),
        "start_time": float(recording.start_time),
        "units": dict(recording.units),
        "meta": dict(recording.meta),
    }
    try:
        stored = Stored.model_validate(json.loads(json.dumps(about, allow_nan=False)))
        stored.sha256 = stored.digest(samples)
        text = encoded(json.dumps(stored.model_dump(), indent=2, ensure_ascii=False) + "\n")
        if len(text) <= DESCRIPTION:
            return text
        why = f"it has {len(text)} bytes, of at most {DESCRIPTION}"
    except (TypeError, ValueError, RecursionError) as error:
        why = reason(error)
    problem = f"the recording's meta cannot be written as JSON ({why})"
    remedy = "use only text, finite numbers, lists and dicts in meta, and no samples"
    raise DataError(problem, file=path, remedy=remedy)


def described(path: Path) -> Stored | None:
    """Return the description beside a CSV; None, with a note, if it is not by this package.

    Raises
    ------
    DataError
        If it is by this package, and was changed or is of a newer version.
    """
    sidecar_path = sidecar(path)
    try:
        return Stored.model_validate(json.loads(read_bytes(sidecar_path, most=DESCRIPTION)))
    except DataError as error:
        why = error.problem
    except ValidationError as error:
        why, wrong = reason(error), {each["loc"]: each["input"] for each in error.errors()}
        if not {(), ("format",)} & wrong.keys():
            version = wrong.get(("version",))
            if type(version) is int and version > VERSION:
                by = f"was written by a newer mckibben, in version {version} of its format"
                raise conflict(path, by, "update mckibben") from None
            raise conflict(path) from None
    except (ValueError, RecursionError) as error:
        why = reason(error)
    warn(path, f"{sidecar_path.name} is ignored, as it is not by mckibben ({why})")
    return None


def conflict(
    path: Path,
    problem: str = "does not describe it as this package wrote it",
    remedy: str = "copy both again",
) -> DataError:
    """Return the error for a description that is not used."""
    sidecar_name = sidecar(path).name
    remedy = f"{remedy}; or, to read it by its header alone, remove {sidecar_name}"
    return DataError(f"{sidecar_name} {problem}", file=path, remedy=remedy)


def sidecar(path: Path) -> Path:
    """Return the path of a text file's description, named as in W3C's "CSV on the Web".

    >>> sidecar(Path("run.csv")).name
    'run.csv-metadata.json'
    """
    return path.with_name(f"{path.name}-metadata.json")


def description(path: Path) -> Path | None:
    """Return the path of a CSV's description; None for other formats."""
    return sidecar(path) if path.suffix.casefold() == ".csv" else None


def is_own(path: Path) -> bool:
    """Return whether a file is an unchanged recording written by this package."""
    description_path = description(path)
    if path.is_symlink() or (description_path is not None and not description_path.is_file()):
        return False
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return all(table.own for table in tables(path))
    except MckibbenError:
        return False
