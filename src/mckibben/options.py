"""Options of operations, for the command line, the workbench and Python.

The options of an operation are a dataclass. Its fields are annotated with an `Option`; the command line
makes its flags from them, and forms their controls.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import UnionType
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    Literal,
    Self,
    TypeVar,
    Union,
    cast,
    get_args,
    get_origin,
    get_type_hints,
)

from mckibben.errors import DataError, ModelError
from mckibben.hints import KEYWORDS, former, nearest
from mckibben.parsers import calibration, constant, limits, names, number, pair, setting, span

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Options = TypeVar("Options", bound="DataclassInstance")

RENAMED = {"inputs": "input", "outputs": "output"}
"""Option of an earlier version -> its name."""


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


@dataclass(frozen=True)
class Argument:
    """Declaration of a positional argument: its placeholder in a help text, and what it is.

    ``kind`` is the type of one word.
    """

    metavar: str
    help: str
    several: bool = False
    kind: type = Path


MODEL = Argument("MODEL", "Saved model (JSON).")
COMPENSATOR = Argument("COMPENSATOR", "Compensator, from mckibben invert (JSON).")
FILES = Argument("FILES...", "Recordings: CSV, TSV, Parquet, MAT, HDF5, TDMS, bags.", several=True)
TEST = Option("Recording to test on; repeatable.", "FILE")


def given_options(
    kind: type[Options],
    options: Options | None,
    keywords: Mapping[str, Any],
    others: Sequence[str] = (),
) -> Options:
    """Return options with some fields given by name; ``others`` are further names for the remedy.

    Texts are parsed as on the command line; where there may be several names, a text is one.

    Raises
    ------
    ModelError
        On a name that is no field, which names the nearest, and on a value of another kind.
    """
    from mckibben.signals.checking import generator

    base: Any = options if options is not None else kind()
    if not issubclass(type(base), kind):
        problem = f"these are no {kind.__name__}, but {type(base).__name__}"
        remedy = (
            "give data first and options by name; arrays are {'pressure': u, 'displacement': y}"
        )
        raise ModelError(problem, parameter="options", remedy=remedy)
    names = (*base.__dataclass_fields__, *others)
    keywords = {
        name if name in names else RENAMED.get(name, name): value
        for name, value in keywords.items()
    }
    if unknown := [name for name in keywords if name not in base.__dataclass_fields__]:
        hint = nearest(unknown[0], names, {k: v for k, v in KEYWORDS.items() if v in names})
        remedy = f"use `{hint}`" if hint else f"use one of {', '.join(names)}"
        if "settings" in names and not hint:
            remedy = f"if a model has it, give `settings[{unknown[0]}]=VALUE`; or {remedy}"
        operation = kind.__name__.removesuffix("Options").casefold()
        instead = former([operation], f"--{unknown[0].replace('_', '-')}")
        raise ModelError(f"there is no option {unknown[0]!r}", remedy=instead or remedy)
    values: dict[str, Any] = {}
    for name, hint in get_type_hints(kind, include_extras=True).items():
        values[name] = _as_declared(hint, name, keywords.get(name, getattr(base, name)))
    generator(values.get("seed", 0))  # refuses what is no seed
    return replace(base, **values)


def _as_declared(hint: Any, name: str, value: Any) -> Any:
    """Return the value of an option; texts are parsed as on the command line.

    Raises
    ------
    ModelError
        If it is of another kind.
    """
    kind, option = get_args(hint)[:2]
    if isinstance(value, str) and option.parse is not None:
        value = parsed(option, value, name)
        value = dict([value]) if is_mapping(kind) else value
    if is_mapping(kind) and isinstance(value, Mapping) and option.parse is not None:
        value = dict(
            parsed(option, f"{key}={entry}", name)
            if isinstance(entry, str) and not _fits(get_args(kind)[1], entry)
            else (key, entry)
            for key, entry in value.items()
        )
    if isinstance(value, str) and kind in (Names, Sequence[str]) and option.parse is None:
        value = (value,)
    if not _fits(kind, value):
        allowed = [entry for part in (kind, *get_args(kind)) for entry in choices(part)]
        type_name = str(kind).replace("collections.abc.", "").replace("typing.", "")
        remedy = f"use one of {', '.join(map(str, allowed))}" if allowed else f"give {type_name}"
        raise ModelError(f"it cannot be {value!r:.60}", parameter=name, remedy=remedy)
    return value


def choices(kind: Any) -> tuple[Any, ...]:
    """Return the values of a literal type; none of others."""
    return get_args(kind) if get_origin(kind) is Literal else ()


def _fits(kind: Any, value: Any) -> bool:
    """Return whether a value is of a type, its entries too."""
    value = value.tolist() if hasattr(value, "tolist") else value  # NumPy's
    origin, inner = get_origin(kind), get_args(kind)
    if kind is Any:
        return True
    if origin in (Union, UnionType):
        return any(_fits(item, value) for item in inner)
    if origin is Literal:
        return value in inner
    if is_mapping(kind):
        return isinstance(value, Mapping) and all(_fits(inner[1], item) for item in value.values())
    if origin is tuple and inner[-1] is not Ellipsis:
        is_sequence = isinstance(value, Sequence) and not isinstance(value, str)
        return is_sequence and len(value) == len(inner) and all(map(_fits, inner, value))
    if origin in (Sequence, tuple):
        is_sequence = isinstance(value, Sequence) and not isinstance(value, str)
        return is_sequence and all(_fits(inner[0], item) for item in value)
    if isinstance(value, bool) and kind is not bool:
        return False
    return isinstance(value, {float: float | int, Path: str | Path}.get(kind, kind))


def is_mapping(kind: Any) -> bool:
    """Return whether a type is a mapping."""
    return isinstance(get_origin(kind), type) and issubclass(get_origin(kind), Mapping)


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


Names = str | Sequence[str] | None
"""A name or several; None where they are found by themselves."""

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
    """How data are read, wherever they are.

    Parameters
    ----------
    columns : mapping of str to str, optional
        Channel -> column, by its header with or without the unit; ``data[1]`` is the first column of a
        matrix ``data``. Standard channels are found by common names (``p``, ``Druck``, ...)
        without it. ``time`` is a channel here. Other columns with flaws are then left out, with a note.
    units : mapping of str to str, optional
        Channel -> unit, such as ``{"pressure": "kPa"}``; overrides what the file states.
    constants : mapping of str to (float, str), optional
        Channel -> value and unit of a constant quantity without a column, such as ``{"force": (200,
        "g")}``; a mass is converted to its weight. Overrides columns.
    calibration : mapping of str to (float, float) or (str, float, float, str), optional
        Channel -> gain and offset; or column, gain, offset and unit. The channel is gain times the
        column, plus offset, in that unit, or else that of ``units`` or of the header.
        ``{"displacement": (-1, 0)}`` reverses a sign.
    rate, sample_time : float, optional
        Samples per second, or time between samples [s], positive, where there is no column of times.
        Without either, a scalar in the file, such as ``fs``, is used, or the recording has no time.
        Channels with separate times are resampled to it.
    gaps : {"error", "split", "interpolate"}
        Treatment of missing time (a step of more than three median steps) and missing samples
        (blank, NaN, infinite, or a code such as -9999): raise an error, split into several
        recordings, or interpolate linearly. Bridged samples are not fitted: ``meta["bridged"]`` has
        their first and last times.
    raw : bool
        Whether codes for missing samples, and counters that seem to wrap, are read as measured.
    rest_length : float, optional
        Length of the muscle at displacement 0 [mm], stored in ``meta``: contraction, displacement
        and length are then converted to each other as needed.
    header : int
        Line of a text with the names of columns, counted from 1; 0 to detect it.
    skip : int
        Lines after it that are left out.
    encoding : str, optional
        Of a text, such as ``"cp932"``; default as found.
    join : bool
        Whether all recordings are one run: pieces with the same channels one after the other, or the
        channels of several loggers, put on the times of the slowest.
    sheet : str, optional
        Of a spreadsheet; default that with the most rows of numbers.
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
        Mapping[str, tuple[float, float] | tuple[str, float, float, str]],
        Option(
            "A channel in raw volts or counts, as pressure=A0:2.5:-0.5:bar, or pressure=2.5:-0.5.",
            "CHANNEL=[COLUMN:]GAIN:OFFSET[:UNIT]",
            "--calibrate",
            calibration,
        ),
    ] = field(default_factory=dict)
    rate: Annotated[float | None, Option("Samples per second, without a time column.", "HZ")] = None
    sample_time: Annotated[
        float | None, Option("Time between samples [s], without a time column.", "SECONDS")
    ] = None
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
    join: Annotated[bool, Option("Join pieces of one run, or the files of several loggers.")] = (
        False
    )
    sheet: Annotated[
        str | None, Option("Sheet of a spreadsheet. Default: the one with most numbers.", "NAME")
    ] = None
    between: Annotated[
        tuple[float | None, float | None] | None,
        Option("Part of every recording [s]; either may be left out.", "START:END", "", span),
    ] = None
    resample: Annotated[
        float | None, Option("Sample time to resample to, without aliasing.", "SECONDS")
    ] = None
    zero: Annotated[
        Sequence[str],
        Option("Channel set to 0 where the input is lowest; repeatable.", "CHANNEL"),
    ] = ()

    def __post_init__(self) -> None:
        """Name the columns and units of calibrated channels with the others."""
        columns, units = dict(self.columns), dict(self.units)
        lines: dict[str, tuple[float, float]] = {}
        for channel, given in self.calibration.items():
            if len(given) == 2:
                lines[channel] = given
                continue
            column, gain, offset, unit = given
            for stated, value in ((columns, column), (units, unit)):
                if stated.setdefault(channel, value) != value:
                    problem = f"it is {stated[channel]!r}, and {value!r} in the calibration"
                    raise DataError(problem, channel=channel, remedy="give one of them")
            lines[channel] = gain, offset
        merged = {"columns": columns, "units": units, "calibration": lines}
        for name, mapping in merged.items():
            object.__setattr__(self, name, mapping)

    @property
    def lines(self) -> Mapping[str, tuple[float, float]]:
        """Gain and offset of every calibrated channel."""
        return cast("Mapping[str, tuple[float, float]]", self.calibration)

    def changed(self, options: Mapping[str, Any]) -> Self:
        """Return these with more options, or with others in place of what it has; None is none."""
        more = merged({name: getattr(self, name) for name in options}, options)
        for name, value in more.items():
            if isinstance(value, Mapping):
                more[name] = {key: each for key, each in value.items() if each is not None}
        return replace(self, **more)


def merged(before: Mapping[str, Any], more: Mapping[str, Any]) -> dict[str, Any]:
    """Return options with others, also within mappings."""
    both: dict[str, Any] = {**before}
    for name, value in more.items():
        both[name] = merged(both.get(name) or {}, value) if isinstance(value, Mapping) else value
    return both


@dataclass(frozen=True)
class ChannelOptions:
    """Options of `info` and `data_gaps`, and the first of others: what drives, and what moves."""

    input: Inputs = None
    output: Outputs = None


@dataclass(frozen=True)
class FitOptions(ChannelOptions):
    """Options of `fit`."""

    prior: Annotated[
        str | Path | Any | None,
        Option("A similar muscle (muscles list), or a data sheet (.toml).", "NAME|FILE"),
    ] = None
    residual_of: Annotated[
        Path | Any | None,
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
class CharacterizeOptions(ChannelOptions):
    """Options of `characterize`: of several inputs, those that only schedule."""

    scheduling: Annotated[
        Sequence[str],
        Option("Other input: use only samples where it is constant; repeatable.", "CHANNEL"),
    ] = ()


@dataclass(frozen=True)
class CompareOptions(ChannelOptions):
    """Options of `compare` and `study`: data, models and processes.

    Parameters
    ----------
    input, output : str or sequence of str, optional
        ``pressure`` and ``displacement``, for several muscles ``pressure_1`` and so on. For several
        outputs, models are chosen by the mean error.
    load : str, optional
        Channel of a varying load, an input of the models.
    models : "all", "quick", str, sequence of str, or mapping
        Short names, in a text with commas between; "all" leaves out models that do not apply to the
        channels or take long, "quick" is a choice that takes seconds. A mapping of labels to short names
        or estimators compares one model with several settings.
    settings : mapping of str to mapping
        Model name, or label, to settings of its estimator.
    jobs : int, optional
        Processes, which share the models, or none for little work. Results are identical.
    most_samples : int, optional
        Recordings keep their turning points; default 100 000. Scores refer to these samples.
    allow_shared : bool
        Whether to allow test recordings that were fitted, and repeated training recordings.
    """

    load: Annotated[str | None, Option("Load that varies: one model for all loads.", "CHANNEL")] = (
        None
    )
    models: Annotated[
        str | Sequence[str] | Mapping[str, Any],
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
    quick: Annotated[bool, Option("Models that take seconds; same as --models quick.")] = False

    def __post_init__(self) -> None:
        """Take the quick models where none are named."""
        if self.quick and self.models not in ("all", "quick"):
            problem = "it chooses models, and some are named"
            raise ModelError(problem, parameter="quick", remedy="leave one of both out")
        if self.quick:
            object.__setattr__(self, "models", "quick")


@dataclass(frozen=True)
class StudyOptions(CompareOptions):
    """Options of `study`: those of `compare`, and those of a log and a closed loop."""

    rig: Annotated[str | Any | None, Option("Several muscles: rig to close a loop on.")] = None
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
    controller_out: Annotated[
        Path | None, Option("Controller to write (JSON), for export.", "FILE")
    ] = None
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
class SimulateOptions:
    """Options of `simulate`: how the run begins, and the band."""

    initial: Annotated[
        Literal["measured", "first_sample", "virgin"],
        Option(
            "Memory before the first sample: measured (from the first measured output), first_sample "
            "(at rest at the first input), or virgin."
        ),
    ] = "measured"
    interval: Annotated[
        float | None,
        Option("With a calibrated model: add the band of this coverage, as 0.9.", "LEVEL"),
    ] = None
    fields: Fields = field(default_factory=dict)


@dataclass(frozen=True)
class CalibrateOptions:
    """Options of `calibrate`: what a new run is like, and what was fitted."""

    exchangeable: Annotated[
        Literal["auto", "run", "block"],
        Option("What a new run is like: runs, or long blocks of runs. auto: runs from 9 on."),
    ] = "auto"
    fitted: Annotated[
        Any, Option("Recordings the model was fitted to (refused); repeatable.", "FILE")
    ] = ()


@dataclass(frozen=True)
class ReviewOptions:
    """Options of `review`: what ran, and whether its model is fitted again."""

    model: Annotated[Path | Any | None, Option("The model that ran, or its inverse.", "MODEL")] = (
        None
    )
    compensator: Annotated[Path | Any | None, Option("The compensator that ran.", "MODEL")] = None
    refit: Annotated[bool, Option("Fit the model again to the log.")] = True
    seed: Seed = 0


@dataclass(frozen=True)
class PlotOptions(ChannelOptions):
    """Options of `plot`: what is drawn."""

    model: Annotated[
        Path | Any | None, Option("Saved model to draw against the recordings.", "MODEL")
    ] = None
    kind: Annotated[
        str | None,
        Option("time, loop (default); with a model also fit (default), loops, residuals."),
    ] = None
    width: Annotated[
        Literal[1, 2] | None,
        Option("Width: 1 column of a journal (88 mm) or 2 (180 mm). Default: by the panels."),
    ] = None


@dataclass(frozen=True)
class ReproduceOptions:
    """Options of `reproduce`: the rig, and how much is done."""

    quick: Annotated[bool, Option("Skip the slow parts.")] = False
    rig: Annotated[
        Any, Option("Rig to record, and to close loops on. Default: the paper's.", "RIG")
    ] = None
    seed: Seed = 0
    jobs: Jobs = None


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
        for way, needing in {"adaptive": ("time", "noise"), "predictive": PREDICTIVE}.items():
            alone = [name for name in needing if getattr(self, name) is not None]
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
