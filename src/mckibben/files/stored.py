"""What a file that this package wrote says about itself, beside the samples."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.files.table import Column, Table
from mckibben.recording import Recording
from mckibben.system.manifest import digest


class Stored(BaseModel):
    """The description of a recording in a CSV's sidecar or in the schema of a Parquet file.

    Parameters
    ----------
    units : dict of str to str
        Unit of every channel, in the order of the columns.
    sample_time, start_time : float or None, float
        The time grid [s]; with a sample time, the first column is the time.
    sha256 : str
        Of the samples as they are on disk, to see whether they were changed since.
    """

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)

    format: Literal["mckibben-recording"] = "mckibben-recording"
    version: Literal[1] = 1
    sha256: str
    sample_time: Annotated[float, Field(ge=1e-12, lt=1e11)] | None
    start_time: float
    units: dict[str, str]
    meta: dict[str, Any]

    @classmethod
    def describe(cls, recording: Recording, samples: bytes, path: Path) -> Stored:
        """Describe a recording whose samples are these bytes on disk.

        Raises
        ------
        DataError
            If a channel is named ``time``, which the grid is, or in a way no header can hold; or
            if ``meta`` holds what JSON cannot.
        """
        for name in recording.channels:
            if name == "time" or not name.strip() or not name.isprintable():
                raise DataError(
                    f"no column can be named {name!r}",
                    file=path,
                    channel=name,
                    remedy="rename the channel; the time is written from the sample time",
                )
        for name, unit in recording.units.items():
            if not unit.isprintable():
                raise DataError(
                    f"no unit can be {unit[:40]!r}",
                    file=path,
                    channel=name,
                    remedy="give the unit in plain letters",
                )
        step = recording.sample_time
        stored = cls.model_construct(
            sha256=digest(samples),
            sample_time=None if step is None else float(step),
            start_time=float(recording.start_time),
            units=dict(recording.units),
            meta=dict(recording.meta),
        )
        stored.to_json(path)
        return stored

    def to_json(self, path: Path) -> str:
        """Return it as JSON that a person can read; `DataError` if ``meta`` is not JSON."""
        try:
            return json.dumps(self.model_dump(), indent=2, allow_nan=False, ensure_ascii=False)
        except (TypeError, ValueError, RecursionError) as error:
            raise DataError(
                f"the recording's meta cannot be written as JSON ({error})",
                file=path,
                remedy="keep text, finite numbers, lists and dicts in meta",
            ) from None

    def table(self, values: dict[str, Array]) -> Table:
        """Return the table of the samples described, by channel."""
        return Table(
            tuple(Column(name, values[name], unit) for name, unit in self.units.items()),
            sample_time=self.sample_time,
            start_time=self.start_time,
            meta=self.meta,
            own=True,
        )


def parse(text: str | bytes) -> Stored | str:
    """Return what the JSON describes, or in words why it does not."""
    try:
        found = Stored.model_validate_json(text)
        words = (*found.units, *found.units.values())
        return found if all(map(str.isprintable, words)) else "its names cannot be printed"
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(step) for step in first["loc"])
        return f"{where[:60]}: {first['msg'][:200]}" if where else str(first["msg"])[:200]
