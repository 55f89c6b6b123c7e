"""A recording: named channels with units on one uniform time grid, with metadata."""

from __future__ import annotations

import builtins
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple, Protocol, Self, SupportsFloat, SupportsIndex, overload

import numpy as np
from numpy.typing import ArrayLike

from mckibben.arrays import Array, check_finite
from mckibben.errors import DataError
from mckibben.printing import printable
from mckibben.registry import load
from mckibben.system.atomic import digest
from mckibben.system.showing import DrawsItself, Hinted

STANDARD_UNITS: Mapping[str, str] = MappingProxyType(
    {
        "pressure": "bar",
        "voltage": "V",
        "displacement": "mm",
        "length": "mm",
        "contraction": "",
        "force": "N",
        "torque": "N*m",
        "velocity": "mm/s",
        "angle": "rad",
        "temperature": "degC",
    }
)
"""Units of the standard channels; ``pressure_2`` and ``pressure_extensor`` follow ``pressure``."""


class Frame(Protocol):
    """What a data frame is recognized by, of pandas or alike."""

    columns: Any
    attrs: Any

    def to_numpy(self) -> Any:
        """Return its values."""


class Plausible(NamedTuple):
    """Plausible values of a standard channel or of time; others suggest another unit.

    ``typical`` is a common size, by which another unit is proposed; a channel without a unit that
    reaches less than ``least`` or more than ``most`` may well be in another.
    """

    low: float
    high: float
    typical: float = 1.0
    least: float = 0.0
    most: float = math.inf


PLAUSIBLE = {
    "bar": Plausible(-1.1, 60.0, 5.0, 0.6, 12.0),
    "mm": Plausible(-2e4, 2e4, 30.0, 0.5, 3e3),
    "N": Plausible(-1e5, 1e5, 300.0),
    "N*m": Plausible(-1e5, 1e5),
    "s": Plausible(-1e11, 1e11, 1.7e9),  # since 1970
    "rad": Plausible(-1e4, 1e4, 1.0, 0.0, 7.0),
    "V": Plausible(-2e4, 2e4, 5.0),
    "mm/s": Plausible(-1e5, 1e5, 100.0),
    "degC": Plausible(-100.0, 1e3),
    "": Plausible(-1e4, 1e4, 0.2, 0.0, 1.5),
}
"""Plausible range, by the package's unit."""

REFERENCE, COMMAND, MEASURED = "reference_", "command_", "_measured"
"""Affixes of the names of a loop's signals: what was asked for, what was sent, and what was measured."""

FEWEST_SAMPLES = 10
"""Smallest number of samples of a recording, or of a part of one, that is read, fitted or tested."""

PERIODIC = "periodic"
"""Entry of ``meta`` of a recording that is one period of a motion that repeats."""

REST_LENGTH = 'the rest length (`rest_length=MM`, or meta["rest_length"] in Python)'
"""Remedy that states the rest length."""

OWN = "mckibben"
"""Entry of ``attrs`` of a data frame that was a recording: its grid, units and meta."""

SAME_TIME = 1e-3
"""Relative difference up to which sample times are equal."""

PROVENANCE = ("file", "sha256")
"""Entries of ``meta`` on the file of a recording; recordings are compared without them."""


def base_name(channel: str) -> str:
    """Return a channel's name up to its first underscore: its quantity, or that it is set or asked for.

    >>> base_name("pressure_extensor"), base_name("reference_displacement")
    ('pressure', 'reference')
    """
    return channel.partition("_")[0]


def standard_unit(channel: str) -> str | None:
    """Return the package's unit of a channel of this name, or None.

    >>> standard_unit("pressure_extensor"), standard_unit("displacement_model")
    ('bar', 'mm')
    """
    return STANDARD_UNITS.get(base_name(channel))


def conversion(target: str, source: str, rest_length: float | None) -> tuple[float, float] | None:
    """Return gain and offset that convert a channel to another, or None.

    A displacement is a contraction times the rest length [mm], and a length is that less a displacement.

    >>> conversion("contraction_2", "displacement_2", 200.0), conversion("length", "displacement", 200.0)
    ((0.005, 0.0), (-1.0, 200.0))
    """
    if target == source:
        return 1.0, 0.0
    (quantity, _, suffix), (source_quantity, _, source_suffix) = (
        target.partition("_"),
        source.partition("_"),
    )
    if suffix != source_suffix or rest_length is None:
        return None
    as_displacement = {
        "displacement": (1.0, 0.0),
        "contraction": (rest_length, 0.0),
        "length": (-1.0, rest_length),
    }
    if quantity not in as_displacement or source_quantity not in as_displacement:
        return None
    (gain, offset), (target_gain, target_offset) = (
        as_displacement[source_quantity],
        as_displacement[quantity],
    )
    return gain / target_gain, (offset - target_offset) / target_gain


@dataclass(frozen=True, eq=False)
class Recording(Hinted, DrawsItself):
    """Samples of one run, on a uniform time grid.

    Parameters
    ----------
    channels : mapping of str to array_like, shape (n,)
        The samples; finite, all of the same length, at least two. Copied, and read-only after.
        ``time`` [s], uniform, is the sample time and the start, and no channel.
    sample_time : float or None
        Time between samples [s], positive; None where the recording has no time, which only
        rate-independent models accept.
    units : mapping of str to str, optional
        Unit of every channel; standard channels need none, unknown ones without are dimensionless.
    start_time : float, default 0.0
        Time of the first sample [s].
    meta : mapping, optional
        What else is known: rig, muscle geometry, load, notes, source file. Anything that JSON holds.

    Raises
    ------
    DataError
        On channels of unequal length, fewer than two samples, values that are not finite, a
        standard channel in another unit than the package's, or a sample time that is not positive.
    """

    face: ClassVar[str] = "recording"

    channels: Mapping[str, Array]
    sample_time: float | None = None
    units: Mapping[str, str] = field(default_factory=dict)
    start_time: float = 0.0
    meta: Mapping[str, Any] = field(default_factory=dict)

    def __new__(cls, *_: Any, **arguments: Any) -> Self:
        """Refuse channels by keyword."""
        if unknown := [name for name in arguments if name not in cls.__dataclass_fields__]:
            raise DataError(
                f"there is no argument {unknown[0]!r}",
                remedy='give channels by name: Recording({"pressure": u}, sample_time=0.01)',
            )
        return super().__new__(cls)

    def __post_init__(self) -> None:
        if is_frame(self.channels):
            raise DataError("it is a data frame", remedy="read it with mckibben.read")
        for name in ("channels", "units", "meta"):
            value = getattr(self, name)
            if not isinstance(value, Mapping):
                problem = f"{name} cannot be {value!r:.60}"
                raise DataError(problem, remedy='give them by name: {"pressure": ...}')
        channels = {name: _frozen(name, samples) for name, samples in self.channels.items()}
        times = channels.pop("time", None)
        _check_lengths(channels)
        if times is not None:
            if self.sample_time is not None or self.units.get("time", "s") != "s":
                problem = "a recording has times [s], or a sample time"
                raise DataError(problem, channel="time", remedy="leave out one of them")
            step, start = _grid(times)
            object.__setattr__(self, "sample_time", step)
            object.__setattr__(self, "start_time", start)
        _check_grid(self.sample_time, self.start_time)
        units = _units_of(channels, self.units)
        object.__setattr__(self, "channels", MappingProxyType(channels))
        object.__setattr__(self, "units", MappingProxyType(units))
        object.__setattr__(self, "meta", MappingProxyType(dict(self.meta)))

    def __reduce__(self) -> tuple[Any, ...]:
        """Return how to rebuild it from plain dicts, for worker processes."""
        content = (dict(self.channels), self.sample_time, dict(self.units))
        return Recording, (*content, self.start_time, dict(self.meta))

    def __repr__(self) -> str:
        listed = ", ".join(f"{name} [{self.units[name] or '-'}]" for name in self.channels)
        grid = "no time" if self.sample_time is None else f"{self.sample_time:g} s apart"
        return f"Recording({self.name}: {self.n_samples} samples {grid}; {listed})"

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Recording):
            return NotImplemented
        return (
            self.sample_time == other.sample_time
            and self.start_time == other.start_time
            and dict(self.units) == dict(other.units)
            and self._known() == other._known()
            and list(self.channels) == list(other.channels)
            and all(np.array_equal(self[name], other[name]) for name in self.channels)
        )

    def _known(self) -> dict[str, Any]:
        """Return the metadata of the run itself, without those of its file."""
        return {key: value for key, value in self.meta.items() if key not in PROVENANCE}

    __hash__ = None  # type: ignore[assignment]  # equal by content, and content is too large to hash

    def __len__(self) -> int:
        return self.n_samples

    def __contains__(self, channel: object) -> bool:
        return channel in self.channels

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names of the channels, as a data frame does."""
        return iter(self.channels)

    @overload
    def __getitem__(self, channel: str) -> Array: ...
    @overload
    def __getitem__(self, channel: builtins.slice | list[str]) -> Recording: ...
    def __getitem__(self, channel: str | builtins.slice | list[str]) -> Array | Recording:
        """Return the samples of a channel, shape (n,); or the recording of a time [s], or of channels.

        Samples are read-only. ``run["pressure"]``, ``run[2.0:5.0]``, ``run[["pressure", "force"]]``.
        """
        if isinstance(channel, builtins.slice):
            return self._during(channel)
        if isinstance(channel, list):
            return self.select(channel)
        if not isinstance(channel, str):
            raise DataError(
                f"a channel is named, and this is {type(channel).__name__}",
                file=self.source,
                remedy="use .slice(start, stop) of samples, a list of names, or .matrix(names)[rows]",
            )
        if channel not in self.channels:
            remedy = f"name one of them, or map a column with `columns[{channel}]=COLUMN`"
            if any(conversion(channel, name, 1.0) for name in self.channels):
                remedy = f"state {REST_LENGTH}, which makes it of another"
            raise DataError(
                f"there is no such channel; there are {', '.join(self.channels)}",
                file=self.source,
                channel=channel,
                remedy=remedy,
            )
        return self.channels[channel]

    def _during(self, times: builtins.slice) -> Recording:
        ends = (times.start, times.stop)
        if any(isinstance(end, SupportsIndex) for end in ends) or times.step is not None:
            raise DataError(
                f"[{times.start}:{times.stop}] may be samples or seconds",
                file=self.source,
                remedy="use .slice(start, stop) of samples, or decimals of seconds, as [2.0:5.0]",
            )
        return self.between(*ends)

    @property
    def n_samples(self) -> int:
        """Number of samples."""
        return next(iter(self.channels.values())).size

    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """Lowest and highest sample of every channel."""
        return {name: (float(x.min()), float(x.max())) for name, x in self.channels.items()}

    @property
    def step(self) -> float:
        """From one value of `time` to the next: the sample time [s], or 1 where samples are numbered."""
        return 1.0 if self.sample_time is None else self.sample_time

    @property
    def time(self) -> Array:
        """Time of every sample [s], shape (n,); sample numbers if the recording has no time."""
        return self.start_time + self.step * np.arange(self.n_samples, dtype=np.float64)

    @property
    def duration(self) -> float | None:
        """Time from the first sample to the last [s], or None without time."""
        return None if self.sample_time is None else self.sample_time * (self.n_samples - 1)

    @property
    def source(self) -> str | None:
        """The file it was read from, or None."""
        file = self.meta.get("file")
        return None if file is None else str(file)

    @property
    def origin(self) -> str:
        """Label of its samples: "measured", unless a virtual rig's."""
        return "virtual rig" if "(virtual)" in str(self.meta.get("rig", "")) else "measured"

    @property
    def name(self) -> str:
        """A short name to show: ``meta["name"]``, or the stem of the source file."""
        entry = self.meta.get("name")
        if entry is not None:
            return printable(str(entry))
        return "recording" if self.source is None else printable(Path(self.source).stem)

    @property
    def notes(self) -> tuple[str, ...]:
        """Assumptions and corrections made in reading it, from ``meta["notes"]``."""
        entry = self.meta.get("notes")
        entries = entry if isinstance(entry, list | tuple) else () if entry is None else (entry,)
        return tuple(map(str, entries))

    @property
    def periodic(self) -> bool:
        """Whether it is one whole period of a motion that repeats, from ``meta["periodic"]``."""
        return bool(self.meta.get(PERIODIC))

    @property
    def rest_length(self) -> float | None:
        """Length of the muscle at displacement 0 [mm], from ``meta["rest_length"]``."""
        entry = self.meta.get("rest_length")
        return float(entry) if isinstance(entry, int | float) and 0 < entry < np.inf else None

    @property
    def bridged(self) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """Which samples were interpolated over a gap in reading, shape (n,)."""
        time, tolerance = self.time, 1e-6 * self.step
        rows = np.zeros(time.size, dtype=np.bool_)
        for start, stop in self.meta.get("bridged", ()):
            rows |= (time >= start - tolerance) & (time <= stop + tolerance)
        return rows

    def matrix(self, channels: Iterable[str]) -> Array:
        """Return several channels side by side, shape (n, number of channels)."""
        names = list(channels)
        recording = self.with_derived(names)
        return np.column_stack([recording[name] for name in names])

    def with_channels(
        self, units: Mapping[str, str] | None = None, /, **samples: ArrayLike
    ) -> Recording:
        """Return a recording with channels added or replaced; these keep their units by default."""
        added = {name: np.asarray(values, dtype=float) for name, values in samples.items()}
        return replace(
            self, channels={**self.channels, **added}, units={**self.units, **(units or {})}
        )

    @classmethod
    def from_frame(
        cls,
        frame: Any,
        sample_time: float | None = None,
        units: Mapping[str, str] | None = None,
        **meta: Any,
    ) -> Recording:
        """Convert a data frame of pandas to a recording.

        Parameters
        ----------
        frame : pandas.DataFrame
            What `to_frame` returned; or any other, which is understood as a file with its headers: see
            `mckibben.read`. A column or an index of times is the time grid.
        sample_time : float, optional
            Time between rows [s], without such a column; none where neither is given.
        units : mapping of str to str, optional
            Channel -> unit.
        **meta
            What else is known, as ``name="run 1"``.

        Raises
        ------
        DataError
            On times that are not uniform, and samples that are none.
        """
        options = {"sample_time": sample_time, "units": units or {}}
        recording, *others = load("readers", "table")(frame, informative=False, **options)
        if others:
            raise DataError("it has several recordings", remedy="use `mckibben.read`")
        return cls(**vars(recording) | {"meta": {**recording.meta, **meta}})

    def to_frame(self) -> Any:
        """Return the channels as a data frame of pandas over time [s]; the inverse of `from_frame`."""
        import pandas as pd

        index = None if self.sample_time is None else pd.Index(self.time, name="time")
        frame = pd.DataFrame(dict(self.channels), index=index)
        grid = None if self.sample_time is None else (self.sample_time, self.start_time)
        attributes = {"grid": grid, "units": dict(self.units), "meta": dict(self.meta)}
        frame.attrs[OWN] = attributes | {"digest": _frame_digest(frame)}
        return frame

    def with_derived(self, channels: Iterable[str]) -> Recording:
        """Return a recording with channels added that can be derived by the rest length."""
        derived: dict[str, Array] = {}
        for channel in channels:
            if channel not in self.channels and self.rest_length is not None:
                for name, samples in self.channels.items():
                    if (line := conversion(channel, name, self.rest_length)) is not None:
                        derived[channel] = line[0] * samples + line[1]
                        break
        return self.with_channels(**derived) if derived else self

    def between(self, start: float | None = None, stop: float | None = None) -> Recording:
        """Return the samples from ``start`` up to, not including, ``stop``, in seconds of its own time.

        They may lie outside of it, start before stop; default from its first, to its last sample.

        Raises
        ------
        DataError
            If it has no time, or fewer than two samples are left.
        """
        step = sample_time_of(self, "be cut by time", "use Recording.slice, which counts samples")
        ends = (-np.inf if start is None else start, np.inf if stop is None else stop)
        first, last = (
            int(np.clip(np.ceil((end - self.start_time) / step - 1e-6), 0, len(self)))
            for end in ends
        )
        if last - first < 2:
            raise DataError(
                f"there are {max(last - first, 0)} samples from {ends[0]:g} to {ends[1]:g} s",
                file=self.source,
                remedy=f"stay within {self.time[0]:g} and {self.time[-1]:g} s",
            )
        return self.slice(first, last)

    def resample(self, sample_time: float) -> Recording:
        """Return it at another sample time [s], without aliasing; see `mckibben.signals.resample`."""
        resampled: Recording = load("readers", "resample")(self, sample_time)
        return resampled

    def to_xarray(self) -> Any:
        """Return the channels as a data set of xarray over time [s], with units as attributes."""
        try:
            import xarray
        except ImportError:
            problem = "data sets need the library xarray"
            raise DataError(problem, remedy="pip install xarray, or use to_frame()") from None
        samples = {n: ("time", x, {"units": self.units[n]}) for n, x in self.channels.items()}
        return xarray.Dataset(samples, {"time": self.time}, dict(self.meta))

    def with_meta(self, **meta: Any) -> Recording:
        """Return a recording with entries of ``meta`` added or replaced."""
        return replace(self, meta={**self.meta, **meta})

    def select(self, channels: Sequence[str]) -> Recording:
        """Return a recording of some channels only, in the order given."""
        recording = self.with_derived(channels)
        return replace(
            self,
            channels={name: recording[name] for name in channels},
            units={name: recording.units[name] for name in channels},
        )

    def slice(self, start: int, stop: int) -> Recording:
        """Return samples ``start`` up to, not including, ``stop``, counted from 0."""
        are_indices = all(isinstance(end, SupportsIndex) for end in (start, stop))
        if not (are_indices and 0 <= start < stop <= self.n_samples):
            raise DataError(
                f"samples {start}:{stop} are not within 0:{self.n_samples}",
                file=self.source,
                remedy="give a range inside the recording",
            )
        return replace(
            self,
            channels={name: samples[start:stop] for name, samples in self.channels.items()},
            start_time=float(self.time[start]),
            # a piece of a period does not repeat
            meta={name: value for name, value in self.meta.items() if name != PERIODIC},
        )


def sample_time_of(
    recording: Recording,
    purpose: str,
    remedy: str = "read it with a column of times, or give `rate`",
) -> float:
    """Return the sample time of a recording; raise an error if it has none.

    Parameters
    ----------
    purpose : str
        What it is needed for, after "cannot".

    Raises
    ------
    DataError
        If the recording has no time.
    """
    if recording.sample_time is None:
        problem = f"a recording without time cannot {purpose}"
        raise DataError(problem, file=recording.source, channel="time", remedy=remedy)
    return recording.sample_time


def check_sample_times(recordings: Sequence[Recording], *, equal: bool = True) -> None:
    """Raise a `DataError` where some recordings have no time, or sample times are not `equal`."""
    for first, recording in ((recordings[0], recording) for recording in recordings):
        step, first_step = recording.sample_time, first.sample_time
        if (step is None) != (first_step is None):
            raise DataError(
                "some recordings have time and others have none",
                file=recording.source,
                channel="time",
                remedy="give `rate` for those without, or use them separately",
            )
        if equal and step and first_step and abs(step - first_step) > SAME_TIME * first_step:
            raise DataError(
                f"the sample time is {step:g} s here and {first_step:g} s in {first.name}",
                file=recording.source,
                options=[{"resample": float(f"{max(step, first_step):.3g}")}],
                remedy="give recordings of one sample time",
            )


def _check_lengths(channels: Mapping[str, Array]) -> None:
    """Raise an error unless there are channels, all of one length of two samples or more."""
    if not channels:
        raise DataError("a recording needs at least one channel", remedy="name a column to read")
    lengths = {name: samples.size for name, samples in channels.items()}
    if len(set(lengths.values())) > 1:
        raise DataError(
            f"channels differ in length: {lengths}", remedy="record all channels on one grid"
        )
    if min(lengths.values()) < 2:
        raise DataError(
            f"{min(lengths.values())} sample(s) are too few", remedy="give at least two samples"
        )


def _check_grid(step: Any, start: float) -> None:
    """Raise an error unless a sample time is positive or None, and the start is finite."""
    if step is not None and not (isinstance(step, SupportsFloat) and 0 < float(step) < np.inf):
        raise DataError(
            f"a sample time of {step!r:.60} s is impossible",
            remedy="give a positive time in seconds, or None where time is unknown",
        )
    if not np.isfinite(start):
        raise DataError("the start time is not finite", remedy="give a time in seconds")


def _units_of(channels: Iterable[str], given: Mapping[str, str]) -> dict[str, str]:
    """Return the unit of every channel: the given one, or the package's, which must not differ."""
    units = {name: given.get(name, standard_unit(name) or "") for name in channels}
    for name, unit in units.items():
        expected = standard_unit(name)
        if expected is not None and unit != expected:
            raise DataError(
                f"a recording holds this channel in {expected or 'no unit'}, not {unit!r}",
                channel=name,
                remedy="convert it, or read the file with mckibben.read, which converts",
            )
    absent = set(given) - set(units) - {"time"}
    if absent:
        raise DataError(f"units are given for absent channels {sorted(absent)}", remedy="drop them")
    return units


def _frozen(name: str, samples: ArrayLike) -> Array:
    if isinstance(samples, np.ma.MaskedArray) and (masked := int(np.sum(samples.mask))):
        raise DataError(
            f"{masked} sample(s) are masked", channel=name, remedy="cut them out, or fill them in"
        )
    try:
        array = np.asarray(samples)
        if array.dtype.kind in "cmM":
            raise TypeError(f"{array.dtype.name}")
        values = np.array(array, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise DataError(
            f"the samples are not numbers ({error})", channel=name, remedy="give real numbers"
        ) from None
    if values.ndim != 1:
        raise DataError(
            f"samples have shape {values.shape}", channel=name, remedy="give one value a sample"
        )
    remedy = "cut those samples out, or read the file with `gaps=split` or `gaps=interpolate`"
    check_finite(values, remedy, name)
    values.flags.writeable = False
    return values


def notes_by_file(recordings: Iterable[Recording]) -> dict[str, list[str]]:
    """Return the reading notes of every file of recordings, if there are any."""
    notes_of: dict[str, list[str]] = {}
    for recording in recordings:
        notes = notes_of.setdefault(recording.source or recording.name, [])
        notes += [note for note in recording.notes if note not in notes]
    return {file: notes for file, notes in notes_of.items() if notes}


def reading_notes(recordings: Iterable[Recording]) -> tuple[str, ...]:
    """Return the notes of `notes_by_file` as sentences that begin with the file."""
    notes_of = notes_by_file(recordings)
    return tuple(f"{file}: {note}" for file, notes in notes_of.items() for note in notes)


def _grid(time: Array, step: float = 0.0, start: float = 0.0) -> tuple[float, float]:
    """Return sample time and start of uniform times: the given ones, if they are exact."""
    if step and np.array_equal(start + step * np.arange(time.size), time):
        return step, start
    steps = np.diff(time)
    step = float(np.median(steps)) if steps.size else 0.0
    wrong = np.flatnonzero(~(np.abs(steps - step) <= 1e-3 * abs(step)))
    if wrong.size or not step > 0:
        raise DataError(
            "the times are not uniform and rising",
            channel="time",
            row=int(wrong[0]) + 2 if wrong.size else None,
            remedy="resample the frame, or write it to a CSV and read that",
        )
    return float(steps.mean()), float(time[0])


def restored(frame: Any) -> Recording | None:
    """Return the recording that a data frame was, or None if it was none or was changed since."""
    attributes = frame.attrs.get(OWN)
    if attributes is None or attributes["digest"] != _frame_digest(frame):
        return None
    channels = {str(name): frame[name].to_numpy() for name in frame}
    step, start = attributes["grid"] or (None, 0.0)
    return Recording(channels, step, attributes["units"], start, attributes["meta"])


def _frame_digest(frame: Any) -> str:
    """Return a digest of the names and values of a data frame, by which changes are seen."""
    names = repr([frame.index.name, *frame.columns]).encode()
    tables = [frame.index.to_numpy(), *(frame[name].to_numpy() for name in frame)]
    return digest(names + b"".join(np.ascontiguousarray(table).tobytes() for table in tables))


def is_frame(given: object) -> bool:
    """Return whether an object is a data frame."""
    return hasattr(given, "columns") and hasattr(given, "to_numpy")


def listed(recordings: Any) -> list[Recording]:
    """Return recordings as a list, also a single one; data frames as recordings.

    Raises
    ------
    DataError
        If something else is given, such as the name of a file.
    """
    values = recordings
    is_collection = isinstance(values, Iterable) and not isinstance(
        values, Recording | str | np.ndarray
    )
    items = list(values) if is_collection and not is_frame(values) else [values]
    items = [Recording.from_frame(item) if is_frame(item) else item for item in items]
    for item in items:
        if not isinstance(item, Recording):
            raise DataError(
                f"a recording is needed here, not {type(item).__name__} {str(item)[:40]!r}",
                remedy="read the file with mckibben.read; make one of arrays by "
                "mckibben.Recording({'pressure': u, 'displacement': y}, sample_time)",
            )
    return items
