"""Options of operations, for the command line, the workbench and Python.

The options of an operation are a dataclass. Its fields are annotated with an `Option`; the command line
makes its flags from them, and forms their controls.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from mckibben.errors import DataError, ModelError

Options = TypeVar("Options")


@dataclass(frozen=True)
class Option:
    """Declaration of an option: help, metavariable, flag and parser.

    Parameters
    ----------
    help : str
        What it is, in a line.
    metavar : str
        Placeholder of the value in a help text, such as ``HZ``.
    flag : str
        The flag of the command line; default ``--`` and the name of the field.
    parse : callable, optional
        Makes a value, or an entry (key, value) of a mapping, of a text.
    """

    help: str
    metavar: str = ""
    flag: str = ""
    parse: Callable[[str], Any] | None = None


def given_options(
    kind: type[Options],
    options: Options | None,
    given: Mapping[str, Any],
    others: Sequence[str] = (),
) -> Options:
    """Return options with some fields given by name; ``others`` are further names for the remedy.

    Raises
    ------
    ModelError
        On a name that is no field.
    """
    from mckibben.signals.checking import generator

    base: Any = options if options is not None else kind()
    if not issubclass(type(base), kind):
        problem = f"these are no {kind.__name__}, but {type(base).__name__}"
        raise ModelError(problem, parameter="options", remedy="give those of this operation")
    if strange := [name for name in given if name not in base.__dataclass_fields__]:
        raise ModelError(
            f"there is no option {strange[0]!r}",
            remedy=f"use {', '.join((*base.__dataclass_fields__, *others))}",
        )
    found = replace(base, **given) if given else base
    for name, hint in get_type_hints(kind).items():
        if get_origin(hint) is Literal and getattr(found, name) not in get_args(hint):
            problem = f"it cannot be {getattr(found, name)!r:.60}"
            raise ModelError(
                problem, parameter=name, remedy=f"use one of {', '.join(get_args(hint))}"
            )
    generator(getattr(found, "seed", 0))  # refuses what is no seed
    return found


def parsed(option: Option, text: str, name: str) -> Any:
    """Return the value of an option from a text.

    Raises
    ------
    DataError
        If it is of another form; ``name`` is the parameter's.
    """
    try:
        return text if option.parse is None else option.parse(text)
    except (ValueError, KeyError, TypeError):
        raise DataError(
            f"{text!r:.80} is not of the form {option.metavar}",
            parameter=name,
            remedy=f"write it so: {option.help.rstrip('.')}",
        ) from None


# Parsers of options. A ValueError is raised for a text of another form.


def pair(text: str) -> tuple[str, str]:
    """Return name and value of ``NAME=VALUE``."""
    name, _, value = text.partition("=")
    if not (name and value):
        raise ValueError
    return name.strip(), value.strip()


def setting(text: str) -> tuple[str, Any]:
    """Return name and value of ``NAME=VALUE``, the value parsed as JSON if possible.

    >>> setting("n-operators=4"), setting("initial=rest")
    (('n_operators', 4), ('initial', 'rest'))
    """
    name, value = pair(text)
    try:
        found = json.loads(value)
    except (ValueError, RecursionError):
        found = None if value.lower() == "none" else value
    return name.replace("-", "_"), tuple(found) if isinstance(found, list) else found


def number(text: str) -> tuple[str, float]:
    """Return name and number of ``NAME=NUMBER``."""
    name, value = pair(text)
    return name, float(value)


def constant(text: str) -> tuple[str, tuple[float, str]]:
    """Return channel, value and unit of ``force=200 g``."""
    name, value = pair(text)
    found = re.fullmatch(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\D.*)?", value)
    if found is None:
        raise ValueError
    return name, (float(found[1]), found[2] or "")


def calibration(text: str) -> tuple[str, tuple[str, float, float, str]]:
    """Return channel, and column, gain, offset and unit of ``pressure=A0:2.5:-0.5:bar``."""
    channel, value = pair(text)
    column, gain, offset, unit = value.rsplit(":", 3)
    if not (column and unit):
        raise ValueError
    return channel, (column, float(gain), float(offset), unit)


def span(text: str) -> tuple[float, float]:
    """Return the two numbers of ``START:END``, infinite where left out."""
    start, end = text.split(":")
    return float(start or "-inf"), float(end or "inf")


def limits(text: str) -> tuple[str, tuple[float | None, ...]]:
    """Return channel and limits of ``CHANNEL=LOW:HIGH[:RATE]``, None where left out.

    >>> limits("pressure=1:5.5"), limits("force=::20")
    (('pressure', (1.0, 5.5)), ('force', (None, None, 20.0)))
    """
    channel, value = pair(text)
    parts = value.split(":")
    if not 2 <= len(parts) <= 3:
        raise ValueError
    return channel, tuple(float(part) if part else None for part in parts)


def names(text: str) -> str | tuple[str, ...]:
    """Return the names in ``all``, ``quick``, ``none`` or ``NAME,NAME``."""
    if text in ("all", "quick", "none"):
        return text
    return tuple(name.strip() for name in text.split(",") if name.strip())


Names = tuple[str, ...] | None
Seed = Annotated[int, Option("Seed of everything random.")]
Jobs = Annotated[int | None, Option("Processes. Default: as many as cores.")]
Settings = Annotated[
    Mapping[str, Any],
    Option("Setting of the estimator; repeatable.", "[MODEL.]NAME=VALUE", "--set", setting),
]
Inputs = Annotated[
    Names, Option("Input channel; repeatable. Default: by name.", "CHANNEL", "--input")
]
Outputs = Annotated[
    Names, Option("Output channel; repeatable. Default: by name.", "CHANNEL", "--output")
]
Fields = Annotated[
    Mapping[str, Any],
    Option("Field of the model that is not identified, as frequency=1.5; repeatable.",
           "NAME=VALUE", "--set", setting),
]  # fmt: skip


@dataclass(frozen=True)
class ReadOptions:
    """How files are read; see `mckibben.read` for all but the last three.

    Parameters
    ----------
    calibration : mapping of str to (str, float, float, str)
        Channel -> column, gain, offset and unit.
    between : (float, float), optional
        Part of every recording [s].
    resample : float, optional
        Sample time to resample to [s].
    zero : sequence of str
        Channels that count from where the input is lowest, in each recording.
    """

    columns: Annotated[
        Mapping[str, str],
        Option("Column of a channel, as pressure=P1.", "CHANNEL=COLUMN", "--column", pair),
    ] = field(default_factory=dict)
    units: Annotated[
        Mapping[str, str],
        Option("Unit of a channel, as pressure=kPa.", "CHANNEL=UNIT", "--unit", pair),
    ] = field(default_factory=dict)
    constants: Annotated[
        Mapping[str, tuple[float, str]],
        Option(
            "A channel that was held and has no column, as 'force=200 g'.",
            "CHANNEL=VALUE UNIT",
            "--constant",
            constant,
        ),
    ] = field(default_factory=dict)
    calibration: Annotated[
        Mapping[str, tuple[str, float, float, str]],
        Option(
            "A channel in raw volts or counts, as pressure=A0:2.5:-0.5:bar.",
            "CHANNEL=COLUMN:GAIN:OFFSET:UNIT",
            "--calibrate",
            calibration,
        ),
    ] = field(default_factory=dict)
    rate: Annotated[float | None, Option("Samples per second, without a time column.", "HZ")] = None
    gaps: Annotated[
        Literal["error", "split", "interpolate"],
        Option("Treatment of gaps in time and missing samples."),
    ] = "error"
    raw: Annotated[
        bool, Option("Read codes for missing samples, and counter wraps, as measured.")
    ] = False
    rest_length: Annotated[
        float | None,
        Option("Length at displacement 0: converts contraction, displacement, length.", "MM"),
    ] = None
    header: Annotated[int, Option("Line of a text with the names of columns.", "LINE")] = 0
    skip: Annotated[int, Option("Lines after the header that are left out.", "N")] = 0
    encoding: Annotated[str | None, Option("Encoding of a text. Default: as found.", "NAME")] = None
    between: Annotated[
        tuple[float, float] | None,
        Option("Part of every recording [s]; either may be left out.", "START:END", "", span),
    ] = None
    resample: Annotated[
        float | None, Option("Sample time to resample to, without aliasing.", "SECONDS")
    ] = None
    zero: Annotated[
        tuple[str, ...],
        Option("Channel set to 0 where the input is lowest; repeatable.", "CHANNEL"),
    ] = ()

    def arguments(self) -> dict[str, Any]:
        """Return the arguments of `mckibben.read`."""
        columns, units = dict(self.columns), dict(self.units)
        for channel, (column, _, _, unit) in self.calibration.items():
            columns[channel] = column
            units.setdefault(channel, unit)
        return {
            "columns": columns,
            "units": units,
            "calibration": {
                name: (gain, zero) for name, (_, gain, zero, _) in self.calibration.items()
            },
            "constants": dict(self.constants),
            "rate": self.rate,
            "gaps": self.gaps,
            "raw": self.raw,
            "rest_length": self.rest_length,
            "header": self.header,
            "skip": self.skip,
            "encoding": self.encoding,
        }


@dataclass(frozen=True)
class FitOptions:
    """Options of `fit`."""

    input: Inputs = None
    output: Outputs = None
    prior: Annotated[
        str | None, Option("A similar muscle (muscles list), or a data sheet (.toml).", "NAME|FILE")
    ] = None
    residual_of: Annotated[
        Path | None,
        Option("Saved model (JSON) that is subtracted first; the sum of both is saved.", "MODEL"),
    ] = None
    target: Annotated[
        Literal["mjcf"] | None,
        Option(
            "Fit what an export format supports; report the error without that limit.", flag="--for"
        ),
    ] = None
    settings: Settings = field(default_factory=dict)
    seed: Seed = 0


@dataclass(frozen=True)
class CompareOptions:
    """Options of `compare` and `study`: data, models and processes.

    Parameters
    ----------
    inputs, outputs : sequence of str, optional
        ``pressure`` and ``displacement``, for several muscles ``pressure_1`` and so on. For several
        outputs, models are chosen by the mean error.
    load : str, optional
        Channel of a varying load, an input of the models.
    models : "all", "quick", str, sequence of str, or mapping
        Short names, in a text with commas between; "all" leaves out models that do not apply to the
        channels, "quick" is a choice that takes seconds. A mapping of labels to short names or
        estimators compares one model with several settings.
    settings : mapping of str to mapping
        Model name, or label, to settings of its estimator.
    jobs : int, optional
        Processes, which share the models, or none for little work. Results are identical.
    most_samples : int, optional
        Recordings keep their turning points; default 100 000. Scores refer to these samples.
    allow_shared : bool
        Whether to allow test recordings that were fitted, and repeated training recordings.
    """

    inputs: Inputs = None
    outputs: Outputs = None
    load: Annotated[str | None, Option("Load that varies: one model for all loads.", "CHANNEL")] = (
        None
    )
    models: Annotated[
        str | Sequence[str],
        Option("Models by short name (info --models), or a quick choice.", "all|quick|NAME,...",
               parse=names),
    ] = "all"  # fmt: skip
    settings: Settings = field(default_factory=dict)
    seed: Seed = 0
    jobs: Jobs = None
    most_samples: Annotated[
        int | None,
        Option("Most samples to fit to: longer recordings are thinned.", "N", "--samples"),
    ] = None
    allow_shared: Annotated[
        bool, Option("Allow test data that were fitted; every result states it.")
    ] = False


@dataclass(frozen=True)
class StudyOptions(CompareOptions):
    """Options of `study`: those of `compare`, and those of a log and a closed loop."""

    rig: Annotated[str | None, Option("Several muscles: rig to close a loop on.")] = None
    compensator: Annotated[
        Path | Any | None, Option("Of a loop's log: the compensator that ran (JSON).", "MODEL")
    ] = None
    model: Annotated[
        Path | Any | None, Option("Of a loop's log: the model that ran, or its inverse.", "MODEL")
    ] = None
    title: Annotated[str, Option("Title of the report. Default: the recording's name.")] = ""


@dataclass(frozen=True)
class TrackOptions:
    """Options of `track`: the plant, the controller, and imperfections of the loop."""

    rig: Annotated[Any, Option("Virtual rig to test it on; see rig list.", "NAME|FILE")] = None
    plant: Annotated[
        Path | Any | None,
        Option("Model of your own muscle to test it on (JSON).", "MODEL"),
    ] = None
    limits: Annotated[
        Mapping[str, tuple[float | None, ...]],
        Option(
            "Limits of the plant, if its model has none, as pressure=0:6; repeatable.",
            "CHANNEL=LOW:HIGH",
            parse=limits,
        ),
    ] = field(default_factory=dict)
    controller: Annotated[
        str, Option("feedforward, feedforward-pid, observer, or pid (no inverse).", "NAME")
    ] = "feedforward"
    repetitions: Annotated[
        int, Option("Learn from that many repetitions of the reference.", "N")
    ] = 0
    approach: Annotated[float, Option("Time to reach the first reference [s].", "S")] = 20.0
    settle: Annotated[float, Option("Time after that not scored [s].", "S")] = 0.0
    noise: Annotated[float, Option("Standard deviation of measurement noise [mm or N].", "X")] = 0.0
    delay: Annotated[int, Option("Delay of measurements, in steps.", "N")] = 0
    slew: Annotated[float | None, Option("Fastest pressure change [bar/s].", "X")] = None
    preview: Annotated[
        float | None,
        Option("Preview time of the reference [s].  [default: dead time]", "S"),
    ] = None
    pressure_loop: Annotated[
        bool, Option("Correct pressures by measured ones, as regulators do.")
    ] = True
    fields: Fields = field(default_factory=dict)
    seed: Seed = 0


@dataclass(frozen=True)
class LearnOptions:
    """Options of `learn`: how the motion is repeated."""

    ahead: Annotated[
        int, Option("Samples by which the reference is given before it is due.", "N")
    ] = 0
    repeats: Annotated[
        bool, Option("Repetitions follow each other without a pause or a new start.")
    ] = False
    best: Annotated[
        bool, Option("Write the compensator of the best repetition, not the next one to try.")
    ] = False


@dataclass(frozen=True)
class InvertOptions:
    """Options of `invert`: purpose of the compensator, adaptation, and prediction."""

    wanted: Annotated[
        Literal["input", "force"],
        Option("Output: the model's input, or the force from measured displacement and pressure.",
               flag="--for"),
    ] = "input"  # fmt: skip
    adaptive: Annotated[bool, Option("Learn the model's parameters from measurements.")] = False
    time: Annotated[
        float | None, Option("With --adaptive: adaptation time [s].  [default: 60]", "S")
    ] = None
    noise: Annotated[
        float | None, Option("With --adaptive: standard deviation of the measured output.", "X")
    ] = None
    predictive: Annotated[bool, Option("Optimise pressures over a horizon, within limits.")] = False
    horizon: Annotated[
        int | None, Option("With --predictive: samples of the horizon.  [default: 20]", "N")
    ] = None
    rate_limit: Annotated[
        float | None, Option("With --predictive: fastest change of a pressure [bar/s].", "X")
    ] = None
    pressures: Annotated[
        tuple[float, float] | None,
        Option("With --predictive: lowest and highest pressure [bar].", "LOW HIGH"),
    ] = None
    learned: Annotated[
        tuple[Path, ...],
        Option(
            "For sdchm: train an inverse network on recordings, as in the paper; repeatable.",
            "FILE",
        ),
    ] = ()
    fields: Fields = field(default_factory=dict)
    seed: Seed = 0

    def check(self) -> None:
        """Raise an error for options that exclude each other, or need another option."""
        ways = {
            "adaptive": self.adaptive,
            "predictive": self.predictive,
            "learned": bool(self.learned),
            "wanted=force": self.wanted == "force",
        }
        if len(both := [name for name, on in ways.items() if on]) > 1:
            raise ModelError(
                f"`{both[0]}` and `{both[1]}` exclude each other", remedy=f"leave out `{both[1]}`"
            )
        for way, names in {"adaptive": ("time", "noise"), "predictive": PREDICTIVE}.items():
            alone = [name for name in names if getattr(self, name) is not None]
            if alone and not ways[way]:
                raise ModelError(
                    f"it is of a compensator with `{way}`",
                    parameter=alone[0],
                    remedy=f"add `{way}`, or leave it out",
                )

    def of_predictive(self) -> dict[str, Any]:
        """Return the arguments of `mckibben.blocks.predictive.Predictive`."""
        given = {name: getattr(self, name) for name in PREDICTIVE}
        given["pressure_range"] = given.pop("pressures")
        given["horizon"] = 20 if self.horizon is None else self.horizon
        return given


PREDICTIVE = ("horizon", "rate_limit", "pressures")


@dataclass(frozen=True)
class PlanOptions:
    """Options of `plan`: driven channels, duration and limits."""

    rig: Annotated[Any, Option("Rig that is driven: channels and limits.", "NAME|FILE")] = None
    minutes: Annotated[float, Option("How long to record.", "X")] = 3.0
    limits: Annotated[
        Mapping[str, tuple[float | None, ...]],
        Option("Limits of a command, and its rate per second; repeatable.",
               "CHANNEL=LOW:HIGH[:RATE]", parse=limits),
    ] = field(default_factory=dict)  # fmt: skip
    seed: Seed = 0


@dataclass(frozen=True)
class ExportOptions:
    """Options of `export` to any target."""

    name: Annotated[
        str | None, Option("Name of functions and files. Default: the file's name.", "NAME")
    ] = None
    sample_time: Annotated[
        float | None, Option("Sample time [s], if the model needs one.", "SECONDS")
    ] = None
    inverse: Annotated[bool, Option("Export the model's inverse.")] = False
    fields: Fields = field(default_factory=dict)
    force: Annotated[bool, Option("Replace files that mckibben did not write, except inputs.")] = (
        False
    )


@dataclass(frozen=True)
class COptions(ExportOptions):
    """Options of `export` to C99."""

    single: Annotated[bool, Option("Single precision.", flag="--float32")] = False
    check: Annotated[bool, Option("Compile it here and run its self-test.")] = False
    emulate: Annotated[
        bool, Option("Run it on an emulated Cortex-M4F too, in single precision (QEMU).")
    ] = False
    link: Annotated[bool, Option("Add a server that answers over a serial line.")] = False
    limits: Annotated[
        Mapping[str, tuple[float, float]],
        Option("With --link: limits of a channel; repeatable.", "NAME=LOW:HIGH", "--limit", limits),
    ] = field(default_factory=dict)
    safe: Annotated[
        Mapping[str, float],
        Option(
            "With --link: safe value of an output without a host; repeatable.",
            "NAME=VALUE",
            parse=number,
        ),
    ] = field(default_factory=dict)
    watchdog: Annotated[
        float | None,
        Option("With --link: silence until outputs take safe values [s]. Default: 0.5.", "S"),
    ] = None


@dataclass(frozen=True)
class MJCFOptions:
    """Options of `export` to MJCF."""

    rest_length: Annotated[
        float | None, Option("Distance of the sites where the displacement is 0; needed.", "MM")
    ] = None
    site_from: Annotated[
        str | None,
        Option("Site of your model from which the muscle pulls; with --site-to.", "SITE"),
    ] = None
    site_to: Annotated[str | None, Option("Site that it pulls.", "SITE")] = None
    example: Annotated[
        Literal["hanging", "joint", "arm"],
        Option("Without sites: a load on a muscle, a joint between two, or a plate on three."),
    ] = "hanging"
    lag: Annotated[float, Option("Time constant from command to pressure.", "SECONDS")] = 0.0
    name: Annotated[str | None, Option("Name of the actuator. Default: of the file.", "NAME")] = (
        None
    )
    force: Annotated[bool, Option("Replace files that mckibben did not write, except inputs.")] = (
        False
    )


@dataclass(frozen=True)
class FMUOptions(ExportOptions):
    """Options of `export` to an FMU."""

    library: Annotated[bool, Option("Include the library for this machine.")] = True
