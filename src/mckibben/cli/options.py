"""Options that several commands share, and reading files by them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from mckibben.errors import DataError, ModelError

if TYPE_CHECKING:
    from mckibben.recording import Recording


class Gaps(StrEnum):
    """What to do about gaps in time."""

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
Input = Annotated[str, typer.Option("--input", metavar="CHANNEL", help="Input channel.")]
Output = Annotated[str, typer.Option("--output", metavar="CHANNEL", help="Output channel.")]
Columns = Annotated[
    list[str] | None,
    typer.Option("--column", metavar="CHANNEL=COLUMN", help="Column to read a channel from."),
]
Units = Annotated[
    list[str] | None, typer.Option("--unit", metavar="CHANNEL=UNIT", help="Unit of a channel.")
]
Rate = Annotated[
    float | None,
    typer.Option("--rate", metavar="HZ", help="Samples per second, without a time column."),
]
GapPolicy = Annotated[Gaps, typer.Option("--gaps", help="What to do about gaps in time.")]
Resample = Annotated[
    float | None,
    typer.Option(
        "--resample", metavar="SECONDS", help="Sample time to resample to, without aliasing."
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
Jobs = Annotated[int | None, typer.Option("--jobs", help="Processes. Default: as many as cores.")]
Dask = Annotated[
    str | None,
    typer.Option(
        "--dask", metavar="ADDRESS", help="Fit on a Dask cluster: its scheduler's address."
    ),
]


_POLICIES: dict[Gaps, Literal["error", "split", "interpolate"]] = {
    Gaps.ERROR: "error",
    Gaps.SPLIT: "split",
    Gaps.INTERPOLATE: "interpolate",
}


@dataclass(frozen=True)
class Reading:
    """How files are to be read."""

    columns: list[str] | None
    units: list[str] | None
    rate: float | None
    gaps: Gaps
    sample_time: float | None = None

    def read(
        self, files: Sequence[Path], channels: Sequence[str] | None, *, informative: bool = True
    ) -> list[Recording]:
        """Return the recordings in all files, with the channels asked for; see `mckibben.read`."""
        from mckibben.files import read

        recordings: list[Recording] = []
        for file in files:
            recordings += read(
                file,
                columns=_pairs("--column", self.columns),
                units=_pairs("--unit", self.units),
                rate=self.rate,
                gaps=_POLICIES[self.gaps],
                channels=channels,
                informative=informative,
            )
        if self.sample_time is not None:
            from mckibben.signals import resample

            recordings = [resample(recording, self.sample_time) for recording in recordings]
        return recordings


def _pairs(option: str, given: list[str] | None) -> dict[str, str]:
    pairs = {}
    for item in given or []:
        name, equals, value = item.partition("=")
        if not (name and equals and value):
            raise DataError(
                f"{option} {item!r} is not of the form CHANNEL=VALUE",
                remedy=f"write for instance {option} pressure="
                + ("P1" if option == "--column" else "kPa"),
            )
        pairs[name] = value
    return pairs


def parse_settings(
    given: list[str] | None, model: str, group: str = "estimators"
) -> dict[str, Any]:
    """Return the settings of one model's estimator, checked against those it has.

    Values are read as JSON where they are that, else as words. A name may be preceded by a model and
    a dot, and is then for that model only.
    """
    import dataclasses

    from mckibben import registry
    from mckibben.estimators.settings import check_settings, setting_value

    estimator = registry.load(group, model)
    known = {field.name for field in dataclasses.fields(estimator)}
    settings: dict[str, Any] = {}
    for item in given or []:
        name, equals, text = item.partition("=")
        owner, dot, rest = name.partition(".")
        if dot and owner != model:
            continue
        name = rest if dot else name
        name = name.replace("-", "_")
        if not equals or name not in known:
            raise ModelError(
                f"--set {item!r}: {model!r} has no setting {name!r}. "
                f"Remedy: use one of {', '.join(sorted(known))}."
            )
        settings[name] = setting_value(text)
    if settings:  # now, and not when this model's turn has come
        check_settings(estimator(**settings))
    return settings


def chosen_models(given: str, quick: bool = False) -> str | list[str]:
    """Return ``"all"``, ``"quick"`` or the list of names."""
    if quick and given != "all":
        raise ModelError("--quick and --models exclude each other. Remedy: leave one out.")
    if given in ("all", "quick"):
        return "quick" if quick else given
    return [name.strip() for name in given.split(",") if name.strip()]


def settings_of_all(given: list[str] | None, models: str | list[str]) -> dict[str, dict[str, Any]]:
    """Return the settings of several models; a bare setting goes to the models that have it."""
    import dataclasses

    from mckibben import registry

    if not given:
        return {}
    names = registry.names("estimators") if isinstance(models, str) else models
    found: dict[str, dict[str, Any]] = {}
    used: set[str] = set()
    for model in names:
        known = {field.name for field in dataclasses.fields(registry.load("estimators", model))}
        mine = []
        for item in given or []:
            name = item.partition("=")[0].replace("-", "_")
            owner, dot, rest = name.partition(".")
            if (dot and owner == model) or (not dot and name in known):
                mine.append(item)
                used.add(item)
            del rest
        found[model] = parse_settings(mine, model)
    for item in given or []:
        if item not in used:
            raise ModelError(
                f"--set {item!r}: none of the models {', '.join(names)} has that setting. "
                "Remedy: see mckibben info --models."
            )
    return found
