"""Options that several commands share, and reading files by them."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mckibben.errors import DataError, ModelError

if TYPE_CHECKING:
    from mckibben.blocks.base import Block
    from mckibben.files.choosing import Seen
    from mckibben.recording import Recording


class Gaps(StrEnum):
    """What to do about gaps in time and missing samples."""

    ERROR = "error"
    SPLIT = "split"
    INTERPOLATE = "interpolate"


Files = Annotated[
    list[Path],
    typer.Argument(metavar="FILES...", help="Recordings: CSV, TSV, Parquet, MAT, HDF5, TDMS."),
]
Test = Annotated[
    list[Path] | None,
    typer.Option("--test", metavar="FILE", help="Recording to test on; repeatable."),
]
Input = Annotated[
    str | None,
    typer.Option("--input", metavar="CHANNEL", help="Input. Default: pressure, or else voltage."),
]
Output = Annotated[
    str | None,
    typer.Option(
        "--output", metavar="CHANNEL", help="Output. Default: displacement, or else angle."
    ),
]
Inputs = Annotated[
    list[str] | None,
    typer.Option(
        "--input",
        metavar="CHANNEL",
        help="Input channel; repeatable. Default: pressure, pressure_1 ..., or voltage ...",
    ),
]
Outputs = Annotated[
    list[str] | None,
    typer.Option(
        "--output",
        metavar="CHANNEL",
        help="Output channel; repeatable. Default: displacement, displacement_1 ..., or angle ...",
    ),
]
Load = Annotated[
    str | None,
    typer.Option("--load", metavar="CHANNEL", help="Load that varies: one model for all loads."),
]
Columns = Annotated[
    list[str] | None,
    typer.Option("--column", metavar="CHANNEL=COLUMN", help="Column to read a channel from."),
]
Units = Annotated[
    list[str] | None, typer.Option("--unit", metavar="CHANNEL=UNIT", help="Unit of a channel.")
]
Constants = Annotated[
    list[str] | None,
    typer.Option(
        "--constant",
        metavar="CHANNEL=VALUE UNIT",
        help="What was held and is in no column, as 'force=200 g'.",
    ),
]
Calibrations = Annotated[
    list[str] | None,
    typer.Option(
        "--calibrate",
        metavar="CHANNEL=COLUMN:GAIN:OFFSET:UNIT",
        help="Channel from raw volts or counts, as pressure=A0:2.5:-0.5:bar.",
    ),
]
Most = Annotated[
    str, typer.Option("--most", metavar="SIZE", help="Largest file that is read, as 2GB.")
]
Rate = Annotated[
    float | None,
    typer.Option("--rate", metavar="HZ", help="Samples per second, without a time column."),
]
GapPolicy = Annotated[
    Gaps, typer.Option("--gaps", help="What to do about gaps and missing samples.")
]
Raw = Annotated[
    bool, typer.Option("--raw", help="Read codes for missing samples, and wraps, as measured.")
]
RestLength = Annotated[
    float | None,
    typer.Option(
        "--rest-length",
        metavar="MM",
        help="Length at displacement 0, which makes contraction, displacement and length of another.",
    ),
]
Resample = Annotated[
    float | None,
    typer.Option(
        "--resample", metavar="SECONDS", help="Sample time to resample to, without aliasing."
    ),
]
Between = Annotated[
    str | None,
    typer.Option(
        "--between",
        metavar="START:END",
        help="Part of every recording [s]; either may be left out.",
    ),
]
Zero = Annotated[
    list[str] | None,
    typer.Option(
        "--zero",
        metavar="CHANNEL",
        help="Count it from where the input is lowest, in each recording.",
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON on standard output.")]
Seed = Annotated[int, typer.Option("--seed", help="Of everything random.")]
Models = Annotated[
    str,
    typer.Option(
        "--models",
        metavar="all|quick|NAME,...",
        help="Models, by short name; see info --models. quick: a choice that takes seconds.",
    ),
]
Quick = Annotated[bool, typer.Option("--quick", help="Same as --models quick.")]
Samples = Annotated[
    int | None,
    typer.Option(
        "--samples",
        metavar="N",
        min=1,
        max=10**9,
        help="Samples to fit to at most: longer recordings are thinned.",
    ),
]
AllowShared = Annotated[
    bool,
    typer.Option("--allow-shared", help="Test on data fitted to, and say so in every result."),
]
AllowEarly = Annotated[
    bool, typer.Option("--allow-early", help="Compare although the output moves before its input.")
]
Force = Annotated[
    bool,
    typer.Option(
        "--force", help="Replace files that this program did not write; never what is read."
    ),
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="[MODEL.]NAME=VALUE", help="Setting of the estimator; repeatable."
    ),
]
Fields = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help="Field of the saved model that is not identified, as frequency=1.5; repeatable.",
    ),
]
Jobs = Annotated[int | None, typer.Option("--jobs", help="Processes. Default: as many as cores.")]
Dask = Annotated[
    str | None,
    typer.Option(
        "--dask", metavar="ADDRESS", help="Fit on a Dask cluster: its scheduler's address."
    ),
]


SEVERAL = re.compile(r"(pressure|voltage|displacement|angle)_\d+|voltage|angle|command_.+")
"""Names of channels by which recordings of several muscles, of voltages or angles, and logs are told."""


@dataclass(frozen=True)
class Reading:
    """How files are to be read."""

    column: Columns = None
    unit: Units = None
    constant: Constants = None
    calibrate: Calibrations = None
    most: Most = "2GB"
    rate: Rate = None
    gaps: GapPolicy = Gaps.ERROR
    raw: Raw = False
    rest_length: RestLength = None
    between: Between = None
    resample: Resample = None
    zero: Zero = None

    def options(self) -> dict[str, Any]:
        """Return the options as `mckibben.read` takes them."""
        columns = _pairs("--column", self.column, "pressure=P1")
        units = _pairs("--unit", self.unit, "pressure=kPa")
        calibration = {}
        for channel, (column, gain, offset, unit) in _calibrations(self.calibrate).items():
            columns[channel], calibration[channel] = column, (gain, offset)
            units.setdefault(channel, unit)
        return {
            "columns": columns,
            "units": units,
            "calibration": calibration,
            "constants": _constants(self.constant),
            "rate": self.rate,
            "gaps": self.gaps.value,
            "raw": self.raw,
            "rest_length": self.rest_length,
            "most": _bytes(self.most),
        }

    def read(
        self, files: Sequence[Path], channels: Sequence[str] | None, *, informative: bool = True
    ) -> list[Recording]:
        """Return the recordings in all files, with the channels asked for; see `mckibben.read`."""
        from mckibben.files import read

        recordings: list[Recording] = []
        for file in files:
            recordings += read(file, channels=channels, informative=informative, **self.options())
        return self._prepared(recordings)

    def look(
        self, files: Sequence[Path], channels: Sequence[str] | None
    ) -> tuple[list[Recording], dict[str, list[Seen]]]:
        """Return the recordings in all files, and the columns of each that is no folder."""
        from mckibben.files.reading import look, read

        recordings: list[Recording] = []
        columns: dict[str, list[Seen]] = {}
        options = {"channels": channels, "informative": False, **self.options()}
        for file in files:
            if file.is_dir():
                recordings += read(file, **options)
            else:
                found, columns[str(file)] = look(file, **options)
                recordings += found
        return self._prepared(recordings), columns

    def _prepared(self, recordings: list[Recording]) -> list[Recording]:
        """Return recordings cut, resampled and zeroed as asked for."""
        if self.between is not None:
            from mckibben.signals import cut

            start, end = _times(self.between)
            recordings = [cut(recording, start, end) for recording in recordings]
        if self.resample is not None:
            from mckibben.signals import resample

            recordings = [resample(recording, self.resample) for recording in recordings]
        if self.zero:
            from mckibben.comparison.channels import recognised
            from mckibben.signals import zeroed

            for place, one in enumerate(recordings):
                (over, *_), _ = recognised([one], list(one.channels))
                recordings[place] = zeroed(one, self.zero, over)
        return recordings

    def read_one(
        self,
        files: Sequence[Path],
        input: str | None,  # noqa: A002
        output: str | None,
        beside: Sequence[str] = (),
    ) -> tuple[list[Recording], str, str]:
        """Return recordings of one muscle, its input and its output: as named, the usual, or others.

        Raises
        ------
        DataError
            If a channel is missing, or is that of several muscles.
        """
        from mckibben.comparison.channels import channels_of

        asked = input or "pressure", output or "displacement"
        try:
            return self.read(files, [*asked, *beside]), *asked
        except DataError:
            if not self._finds_its_own(files[0]):
                raise
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            begun = self.read(files[:1], None, informative=False)
        found = channels_of(begun, input, output, None)
        if len(found.inputs) > 1 or len(found.outputs) > 1:
            raise DataError(
                f"it is of several: {', '.join((*found.inputs, *found.outputs))}",
                file=files[0],
                remedy="name one of each with --input and --output; fit balance models all at once",
            )
        named = found.inputs[0], found.outputs[0]
        return self.read(files, [*named, *beside]), *named

    def read_all(
        self,
        files: Sequence[Sequence[Path]],
        inputs: Sequence[str] | None,
        outputs: Sequence[str] | None,
        load: str | None,
    ) -> list[list[Recording]]:
        """Return the recordings in several lists of files, to compare models on.

        Those of one muscle are asked for, or what is named instead, unless the first file is of several
        or of one that is held: which of theirs are meant, the comparison finds.
        """
        asked = [*(inputs or ["pressure"]), *(outputs or ["displacement"])]
        named = [*(inputs or ()), *(outputs or ()), *([] if load is None else [load])] or None
        if load is not None or len(asked) > 2:
            return [self.read(some, named, informative=False) for some in files]
        (first, *rest), *others = files
        try:
            begun = self.read([first], asked)
            every = inputs is None and outputs is None and _is_held(begun)
        except DataError:
            if not self._finds_its_own(first, or_of_force=True):
                raise
            every = True
        if every:
            return [self.read(some, named, informative=False) for some in files]
        return [begun + self.read(rest, asked), *(self.read(some, asked) for some in others)]

    def _finds_its_own(self, file: Path, *, or_of_force: bool = False) -> bool:
        """Tell whether a file is of several muscles, a loop's log, or of force by length alone."""
        from mckibben.comparison.channels import lacks_displacement

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                (found, *_) = self.read([file], None, informative=False)
            except DataError as error:
                if SEVERAL.fullmatch(error.channel or ""):
                    raise
                return False  # what is wrong with one muscle's file is said by whoever asks
        alone = or_of_force and lacks_displacement([found])
        return alone or any(map(SEVERAL.fullmatch, found.channels))


def _is_held(recordings: Sequence[Recording]) -> bool:
    """Tell whether nothing moves, so that the force may be what is to be modelled."""
    from mckibben.comparison.channels import any_moves

    return not any_moves(recordings, ("displacement",))


def _pairs(option: str, given: list[str] | None, instance: str) -> dict[str, str]:
    pairs = {}
    for item in given or []:
        name, equals, value = item.partition("=")
        if not (name and equals and value):
            raise DataError(
                f"{option} {item!r} is not of the form NAME=VALUE",
                remedy=f"write for instance {option} {instance}",
            )
        pairs[name] = value
    return pairs


def _constants(given: list[str] | None) -> dict[str, tuple[float, str]]:
    """Return channels that were held, with value and unit: ``force=200 g``."""
    found = {}
    for item in given or []:
        said = re.fullmatch(
            r"([^=]+)=\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\D.*)?", item
        )
        if said is None:
            raise DataError(
                f"--constant {item!r} is not of the form CHANNEL=VALUE UNIT",
                remedy="write for instance --constant 'force=200 g'",
            )
        found[said[1].strip()] = float(said[2]), said[3] or ""
    return found


def _calibrations(given: list[str] | None) -> dict[str, tuple[str, float, float, str]]:
    """Return column, gain, offset and unit of channels: ``pressure=A0:2.5:-0.5:bar``."""
    found = {}
    for channel, said in _pairs("--calibrate", given, "pressure=A0:2.5:-0.5:bar").items():
        column, gain, offset, unit = ["", "", "", *said.rsplit(":", 3)][-4:]
        try:
            found[channel] = column, float(gain), float(offset), unit
        except ValueError:
            column = ""
        if not column or not unit:
            raise DataError(
                f"--calibrate {channel}={said} is not of the form CHANNEL=COLUMN:GAIN:OFFSET:UNIT",
                remedy="write for instance --calibrate pressure=A0:2.5:-0.5:bar",
            )
    return found


def _times(given: str) -> tuple[float, float]:
    """Return start and end [s] from ``START:END``."""
    start, colon, end = given.partition(":")
    try:
        if not colon:
            raise ValueError
        return float(start or "-inf"), float(end or "inf")
    except ValueError:
        raise DataError(
            f"--between {given!r} is not of the form START:END",
            remedy="write for instance --between 15: to leave out the first 15 s",
        ) from None


def _bytes(size: str) -> float:
    """Return a size such as ``2GB``, ``500 MB`` or ``1e9`` in bytes."""
    said = re.fullmatch(r"\s*([\d.]+(?:[eE]\d+)?)\s*([kMGT]?)i?B?\s*", size, re.IGNORECASE)
    try:
        number = float(said[1]) if said else 0.0
    except ValueError:
        number = 0.0
    if said is None or number <= 0:
        raise DataError(f"--most {size!r} is no size", remedy="write for instance --most 2GB")
    return number * 1024.0 ** " KMGT".index(said[2].upper() or " ")


def loaded(model: Path, given: list[str] | None) -> Block:
    """Return a saved model, its fields set as given by ``--set NAME=VALUE``."""
    from mckibben.blocks.saving import load
    from mckibben.blocks.setting import with_fields
    from mckibben.estimators.core.settings import setting_value

    values = _pairs("--set", given, "frequency=1.5")
    return with_fields(load(model), {name: setting_value(text) for name, text in values.items()})


def chosen_models(given: str, quick: bool = False) -> str | list[str]:
    """Return ``"all"``, ``"quick"`` or the list of names."""
    if quick and given != "all":
        raise ModelError("--quick and --models exclude each other", remedy="leave one out")
    if given in ("all", "quick"):
        return "quick" if quick else given
    return [name.strip() for name in given.split(",") if name.strip()]


def limits_in(items: Iterable[str]) -> dict[str, list[float | None]]:
    """Return limits from texts CHANNEL=LOW:HIGH[:RATE], of which numbers may be left out.

    >>> limits_in(["pressure=1:5.5", "force=::20"])
    {'pressure': [1.0, 5.5], 'force': [None, None, 20.0]}
    """
    found = {}
    for item in items:
        name, equals, text = item.partition("=")
        parts = text.split(":")
        try:
            if not (name and equals and text and 2 <= len(parts) <= 3):
                raise ValueError
            found[name] = [float(part) if part else None for part in parts]
        except ValueError:
            raise DataError(
                f"--limits {item!r} is not of the form CHANNEL=LOW:HIGH or CHANNEL=LOW:HIGH:RATE",
                remedy="write for instance --limits pressure=1:5.5:2, which is bar and bar/s",
            ) from None
    return found
