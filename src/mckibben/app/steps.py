"""How a recording is read and what is done to it then, as plain data that a folder keeps as JSON."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from mckibben import signals
from mckibben.errors import DataError, TooLargeError
from mckibben.files.choosing import Seen
from mckibben.files.reading import columns_of, look
from mckibben.recording import Recording

LARGEST = 512 * 2**20
"""Bytes of an uploaded file."""

MOST_CELLS = 40_000_000
"""Samples times channels of the recordings in a file."""

TEXT = (".csv", ".tsv", ".txt", ".dat", ".log")
"""Endings of files with lines, of which some can be left out."""


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


Text = Annotated[str, Field(max_length=10_000)]
Number = Annotated[float | None, BeforeValidator(_finite)]
Count = Annotated[int, Field(ge=0, le=2**53)]


class Plain(BaseModel):
    """Anything in a folder; fields that are not known are ignored."""

    model_config = ConfigDict(extra="ignore")


class Reading(Plain):
    """How a file is read: the options of `mckibben.read`, and the layout of a text.

    Parameters
    ----------
    channels : list of str, optional
        Channels to use; default all.
    header : int
        Line of the names of columns, from 1; 0 where it is found.
    skip : int
        Lines after it that are left out.
    encoding : str
        Of a text; empty where it is found.
    """

    columns: dict[Text, Text] = {}
    units: dict[Text, Text] = {}
    calibration: dict[Text, tuple[float, float]] = {}
    constants: dict[Text, tuple[float, Text]] = {}
    rate: Number = None
    rest_length: Number = None
    gaps: Literal["error", "split", "interpolate"] = "error"
    raw: bool = False
    channels: list[Text] | None = None
    header: Count = 0
    skip: Count = 0
    encoding: Text = ""

    def options(self) -> dict[str, Any]:
        """Return the options of `mckibben.read`; there, other channels are not looked at."""
        return self.model_dump(exclude_defaults=True, exclude={"header", "skip", "encoding"})

    @property
    def amends(self) -> bool:
        """Whether lines are left out or the encoding is given."""
        return bool(self.header > 1 or self.skip or self.encoding)


TAKES = {
    "slice": ("start", "stop"),
    "low_pass": ("cutoff", "channels"),
    "detrend": ("channels",),
    "resample": ("sample_time",),
    "zero": ("channels", "over"),
}
"""What steps take."""

CALLED = {"zero": "zeroed"}
"""Functions of `mckibben.signals` that are called otherwise than their steps."""


class Step(Plain):
    """What is done to a recording after it was read: a function of `mckibben.signals`, or a cut."""

    do: Literal["slice", "low_pass", "detrend", "resample", "zero"]
    start: Count = 0
    stop: Count = 0
    cutoff: Number = None
    sample_time: Number = None
    over: Text | None = None
    channels: list[Text] | None = None

    @property
    def arguments(self) -> list[Any]:
        """What the function takes after the recording."""
        return [value for name in TAKES[self.do] if (value := getattr(self, name)) is not None]

    def apply(self, recording: Recording) -> Recording:
        """Return a recording after it; errors are those of the function."""
        for name in TAKES[self.do]:
            if getattr(self, name) is None and (name != "channels" or self.do == "zero"):
                raise DataError(f"{self.do} needs a value", parameter=name, remedy="give one")
        if self.do == "slice":
            return recording.slice(*self.arguments)
        found: Recording = getattr(signals, CALLED.get(self.do, self.do))(
            recording, *self.arguments
        )
        return found

    def code(self, recording: str) -> str:
        """Return the Python that does it to an expression."""
        values = [repr(one) for one in self.arguments]
        if self.do == "slice":
            return f"{recording}.slice({', '.join(values)})"
        name = CALLED.get(self.do, self.do)
        return f"mckibben.signals.{name}({', '.join([recording, *values])})"

    def __str__(self) -> str:
        of = f" of {', '.join(self.channels)}" if self.channels else ""
        return {
            "slice": f"Keep samples {self.start} to {self.stop}",
            "low_pass": f"Low-pass {self.cutoff:g} Hz{of}" if self.cutoff else "Low-pass",
            "detrend": f"Remove drift{of}",
            "resample": f"Resample to {self.sample_time:g} s" if self.sample_time else "Resample",
            "zero": f"Zero{of} where {self.over} is lowest",
        }[self.do]


def applied(recording: Recording, steps: Sequence[Step]) -> Recording:
    """Return a recording after steps."""
    for step in steps:
        recording = step.apply(recording)
    return recording


def read_file(path: Path, reading: Reading | None = None) -> list[Recording]:
    """Return the recordings of a file.

    Raises
    ------
    DataError
        If it cannot be read so, or holds more numbers than `MOST_CELLS`.
    """
    return understand(path, reading or Reading())[0]


def understand(path: Path, reading: Reading) -> tuple[list[Recording], list[Seen]]:
    """Return the recordings of a file, and its columns; errors are those of `read_file`."""
    options = reading.options()
    chosen = options.pop("channels", None)
    with _amended(path, reading) as file:
        found, columns = look(file, informative=False, channels=chosen, **options)
    if chosen is not None:
        found = [one.select([c for c in one.channels if c in chosen]) for one in found]
    if sum(len(one) * len(one.channels) for one in found) > MOST_CELLS:
        problem = f"it holds more than {MOST_CELLS:,} numbers"
        raise TooLargeError(problem, file=path, remedy="cut or thin it before")
    return [one.with_meta(file=str(path)) for one in found], columns


def columns_in(path: Path, reading: Reading) -> list[Seen]:
    """Return the columns of a file that may not be readable as recordings; none if there is no table."""
    options = reading.options()
    options.pop("channels", None)
    try:
        with _amended(path, reading) as file:
            return columns_of(file, **options)
    except DataError:
        return []


@contextmanager
def _amended(path: Path, reading: Reading) -> Iterator[Path]:
    """Give a file as it is, or a copy of a text as it is to be read; errors name the file itself."""
    with TemporaryDirectory() as folder:
        file = path
        if reading.amends:
            file = Path(folder, path.name)
            file.write_bytes(amend(path, reading))
        try:
            yield file
        except DataError as error:
            error.file = path
            raise


def amend(path: Path, reading: Reading) -> bytes:
    """Return a text in UTF-8 with the lines blanked that are left out; the others keep their numbers.

    Raises
    ------
    DataError
        If it is not in that encoding, or no text.
    """
    if path.suffix.casefold() not in TEXT:
        problem = "only text has lines and an encoding"
        raise DataError(problem, file=path, remedy="leave both as found")
    encoding = reading.encoding or "utf-8"
    try:
        lines = path.read_bytes().decode(encoding).splitlines()
    except (LookupError, ValueError):
        problem = f"it is no text in {encoding}"
        raise DataError(problem, file=path, parameter="encoding", remedy="choose another") from None
    header = max(reading.header, 1)
    out = {*range(header - 1), *range(header, header + reading.skip)}
    return "\n".join("" if at in out else line for at, line in enumerate(lines)).encode()
