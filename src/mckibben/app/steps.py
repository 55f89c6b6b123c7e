"""How a recording is read and what is done to it then, as plain data that a folder keeps as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from operator import attrgetter
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict

import mckibben
from mckibben.errors import DataError
from mckibben.files.choosing import Seen
from mckibben.files.reading import look
from mckibben.options import ReadOptions
from mckibben.recording import Recording

Role = Literal["train", "test", "unused"]

LARGEST_UPLOAD = 512 * 2**20
"""Largest uploaded file [bytes]."""


class StoredModel(BaseModel):
    """Anything in a folder; fields that are not known are ignored."""

    model_config = ConfigDict(extra="ignore")


@dataclass(frozen=True)
class Reading(ReadOptions):
    """How a file is read: options of `mckibben.read`; of ``channels``, no others are used."""

    channels: Sequence[str] | None = None

    def given(self) -> dict[str, Any]:
        """Return the options that are not as they are by default."""
        values = {each.name: getattr(self, each.name) for each in fields(self)}
        return {name: value for name, value in values.items() if value != getattr(UNTOUCHED, name)}


UNTOUCHED = Reading()
"""A file read without options."""


FUNCTIONS = {
    "slice": ("Recording.slice", ("start", "stop")),
    "low_pass": ("signals.low_pass", ("cutoff", "channels")),
    "detrend": ("signals.detrend", ("channels",)),
    "resample": ("signals.resample", ("sample_time",)),
    "zero": ("signals.zeroed", ("channels", "over")),
}
"""Step -> its function in `mckibben`, and what that takes after the recording."""


class Step(StoredModel):
    """What is done to a recording after it was read."""

    do: Literal["slice", "low_pass", "detrend", "resample", "zero"]
    start: int = 0
    stop: int = 0
    cutoff: float | None = None
    sample_time: float | None = None
    over: str | None = None
    channels: list[str] | None = None

    def _call(self) -> tuple[str, list[Any]]:
        """Return the function, and its arguments after the recording."""
        function, names = FUNCTIONS[self.do]
        for name in names:
            if getattr(self, name) is None and (name != "channels" or self.do == "zero"):
                raise DataError(f"{self.do} needs a value", parameter=name, remedy="give one")
        values = [getattr(self, name) for name in names]
        return function, [value for value in values if value is not None]

    def apply(self, recording: Recording) -> Recording:
        """Return a recording after it; errors are those of the function."""
        function, values = self._call()
        result: Recording = attrgetter(function)(mckibben)(recording, *values)
        return result

    def code(self, recording: str) -> str:
        """Return the Python that does it to an expression."""
        function, values = self._call()
        return f"mckibben.{function}({', '.join([recording, *map(repr, values)])})"

    def __str__(self) -> str:
        channels = f" of {', '.join(self.channels)}" if self.channels else ""
        return {
            "slice": f"Keep samples {self.start} to {self.stop}",
            "low_pass": f"Low-pass {self.cutoff or 0:g} Hz{channels}",
            "detrend": f"Remove drift{channels}",
            "resample": f"Resample to {self.sample_time or 0:g} s",
            "zero": f"Zero{channels} where {self.over} is lowest",
        }[self.do]


class Entry(StoredModel):
    """A recording of the folder: recording number ``part`` of the raw file ``upload``."""

    name: str = ""
    role: Role
    upload: str = ""
    part: int = 0
    reading: Reading = UNTOUCHED
    steps: list[Step] = []

    def code(self) -> str:
        """Return the Python that reads it and repeats its steps, in the folder."""
        words = [f"{name}={value!r}" for name, value in self.reading.given().items()]
        arguments = ", ".join([repr(f"uploads/{self.upload}"), "informative=False", *words])
        expression = f"mckibben.read({arguments})[{self.part}]"
        for step in self.steps:
            expression = step.code(expression)
        return expression


def apply_steps(recording: Recording, steps: Sequence[Step]) -> Recording:
    """Return a recording after steps."""
    for step in steps:
        recording = step.apply(recording)
    return recording


def understand(path: Path, reading: Reading) -> tuple[list[Recording], list[Seen]]:
    """Return the recordings of a file, and its columns; errors are those of `mckibben.read`."""
    recordings, columns = look(path, reading, reading.channels, LARGEST_UPLOAD)
    if (channels := reading.channels) is not None:
        recordings = [
            recording.select([name for name in recording.channels if name in channels])
            for recording in recordings
        ]
    return recordings, columns
