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


def conversion(wanted: str, given: str, rest_length: float | None) -> tuple[float, float] | None:
    """Return gain and offset that convert a channel to another, or None.

    A displacement is a contraction times the rest length [mm], and a length is that less a displacement.

    >>> conversion("contraction_2", "displacement_2", 200.0), conversion("length", "displacement", 200.0)
    ((0.005, 0.0), (-1.0, 200.0))
    """
    if wanted == given:
        return 1.0, 0.0
    (end, _, of), (start, _, also) = wanted.partition("_"), given.partition("_")
    if of != also or rest_length is None:
        return None
    as_displacement = {
        "displacement": (1.0, 0.0),
        "contraction": (rest_length, 0.0),
        "length": (-1.0, rest_length),
    }
    if end not in as_displacement or start not in as_displacement:
        return None
    (gain, offset), (per, zero) = as_displacement[start], as_displacement[end]
    return gain / per, (offset - zero) / per


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

    def __new__(cls, *_: Any, **given: Any) -> Self:
        """Refuse channels by keyword."""
        if strange := [name for name in given if name not in cls.__dataclass_fields__]:
            raise DataError(
                f"there is no argument {strange[0]!r}",
                remedy='give channels by name: Recording({"pressure": u}, sample_time=0.01)',
            )
        return super().__new__(cls)

    def __post_init__(self) -> None:
        if is_frame(self.channels):
            raise DataError("it is a data frame", remedy="read it with mckibben.read")
        for what, named in (
            ("channels", self.channels),
            ("units", self.units),
            ("meta", self.meta),
        ):
            if not isinstance(named, Mapping):
                raise DataError(
                    f"{what} cannot be {named!r:.60}", remedy='give them by name: {"pressure": ...}'
                )
        channels = {name: _frozen(name, samples) for name, samples in self.channels.items()}
        times = channels.pop("time", None)
        if not channels:
            raise DataError(
                "a recording needs at least one channel", remedy="name a column to read"
            )
        lengths = {name: samples.size for name, samples in channels.items()}
        if len(set(lengths.values())) > 1:
            raise DataError(
                f"channels differ in length: {lengths}", remedy="record all channels on one grid"
            )
        if min(lengths.values()) < 2:
            raise DataError(
                f"{min(lengths.values())} sample(s) are too few", remedy="give at least two samples"
            )
        step: Any = self.sample_time
        if times is not None:
            if step is not None or self.units.get("time", "s") != "s":
                problem = "a recording has times [s], or a sample time"
                raise DataError(problem, channel="time", remedy="leave out one of them")
            step, start = _grid(times)
            object.__setattr__(self, "sample_time", step)
            object.__setattr__(self, "start_time", start)
        if step is not None and not (isinstance(step, SupportsFloat) and 0 < float(step) < np.inf):
            raise DataError(
                f"a sample time of {step!r:.60} s is impossible",
                remedy="give a positive time in seconds, or None where time is unknown",
            )
        if not np.isfinite(self.start_time):
            raise DataError("the start time is not finite", remedy="give a time in seconds")
        units = {name: self.units.get(name, standard_unit(name) or "") for name in channels}
        for name, unit in units.items():
            expected = standard_unit(name)
            if expected is not None and unit != expected:
                raise DataError(
                    f"a recording holds this channel in {expected or 'no unit'}, not {unit!r}",
                    channel=name,
                    remedy="convert it, or read the file with mckibben.read, which converts",
                )
        strangers = set(self.units) - set(channels) - {"time"}
        if strangers:
            raise DataError(
                f"units are given for absent channels {sorted(strangers)}", remedy="drop them"
            )
        object.__setattr__(self, "channels", MappingProxyType(channels))
        object.__setattr__(self, "units", MappingProxyType(units))
        object.__setattr__(self, "meta", MappingProxyType(dict(self.meta)))

    def __reduce__(self) -> tuple[Any, ...]:
        """Return how to rebuild it from plain dicts, for worker processes."""
        plain = (dict(self.channels), self.sample_time, dict(self.units))
        return Recording, (*plain, self.start_time, dict(self.meta))

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

    def _during(self, wanted: builtins.slice) -> Recording:
        ends = (wanted.start, wanted.stop)
        if any(isinstance(end, SupportsIndex) for end in ends) or wanted.step is not None:
            raise DataError(
                f"[{wanted.start}:{wanted.stop}] may be samples or seconds",
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
        given = self.meta.get("name")
        if given is not None:
            return printable(str(given))
        return "recording" if self.source is None else printable(Path(self.source).stem)

    @property
    def notes(self) -> tuple[str, ...]:
        """Assumptions and corrections made in reading it, from ``meta["notes"]``."""
        given = self.meta.get("notes")
        several = given if isinstance(given, list | tuple) else () if given is None else (given,)
        return tuple(map(str, several))

    @property
    def periodic(self) -> bool:
        """Whether it is one whole period of a motion that repeats, from ``meta["periodic"]``."""
        return bool(self.meta.get(PERIODIC))

    @property
    def rest_length(self) -> float | None:
        """Length of the muscle at displacement 0 [mm], from ``meta["rest_length"]``."""
        given = self.meta.get("rest_length")
        return float(given) if isinstance(given, int | float) and 0 < given < np.inf else None

    @property
    def bridged(self) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """Which samples were interpolated over a gap in reading, shape (n,)."""
        time, within = self.time, 1e-6 * self.step
        found = np.zeros(time.size, dtype=np.bool_)
        for start, stop in self.meta.get("bridged", ()):
            found |= (time >= start - within) & (time <= stop + within)
        return found

    def matrix(self, channels: Iterable[str]) -> Array:
        """Return several channels side by side, shape (n, number of channels)."""
        names = list(channels)
        whole = self.with_derived(names)
        return np.column_stack([whole[name] for name in names])

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
        found, *more = load("readers", "table")(frame, informative=False, **options)
        if more:
            raise DataError("it has several recordings", remedy="use `mckibben.read`")
        return cls(**vars(found) | {"meta": {**found.meta, **meta}})

    def to_frame(self) -> Any:
        """Return the channels as a data frame of pandas over time [s]; the inverse of `from_frame`."""
        import pandas as pd

        index = None if self.sample_time is None else pd.Index(self.time, name="time")
        frame = pd.DataFrame(dict(self.channels), index=index)
        grid = None if self.sample_time is None else (self.sample_time, self.start_time)
        about = {"grid": grid, "units": dict(self.units), "meta": dict(self.meta)}
        frame.attrs[OWN] = about | {"digest": _frame_digest(frame)}
        return frame

    def with_derived(self, channels: Iterable[str]) -> Recording:
        """Return a recording with channels added that can be derived by the rest length."""
        found: dict[str, Array] = {}
        for wanted in channels:
            if wanted not in self.channels and self.rest_length is not None:
                for name, samples in self.channels.items():
                    if (line := conversion(wanted, name, self.rest_length)) is not None:
                        found[wanted] = line[0] * samples + line[1]
                        break
        return self.with_channels(**found) if found else self

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
        found: Recording = load("readers", "resample")(self, sample_time)
        return found

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
        whole = self.with_derived(channels)
        return replace(
            self,
            channels={name: whole[name] for name in channels},
            units={name: whole.units[name] for name in channels},
        )

    def slice(self, start: int, stop: int) -> Recording:
        """Return samples ``start`` up to, not including, ``stop``, counted from 0."""
        whole = all(isinstance(end, SupportsIndex) for end in (start, stop))
        if not (whole and 0 <= start < stop <= self.n_samples):
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
    for first, one in ((recordings[0], one) for one in recordings):
        step, usual = one.sample_time, first.sample_time
        if (step is None) != (usual is None):
            raise DataError(
                "some recordings have time and others have none",
                file=one.source,
                channel="time",
                remedy="give `rate` for those without, or use them separately",
            )
        if equal and step and usual and abs(step - usual) > SAME_TIME * usual:
            raise DataError(
                f"the sample time is {step:g} s here and {usual:g} s in {first.name}",
                file=one.source,
                options=[{"resample": float(f"{max(step, usual):.3g}")}],
                remedy="give recordings of one sample time",
            )


def _frozen(name: str, samples: ArrayLike) -> Array:
    if isinstance(samples, np.ma.MaskedArray) and (masked := int(np.sum(samples.mask))):
        raise DataError(
            f"{masked} sample(s) are masked", channel=name, remedy="cut them out, or fill them in"
        )
    try:
        given = np.asarray(samples)
        if given.dtype.kind in "cmM":
            raise TypeError(f"{given.dtype.name}")
        values = np.array(given, dtype=np.float64)
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
    found: dict[str, list[str]] = {}
    for recording in recordings:
        known = found.setdefault(recording.source or recording.name, [])
        known += [note for note in recording.notes if note not in known]
    return {file: notes for file, notes in found.items() if notes}


def reading_notes(recordings: Iterable[Recording]) -> tuple[str, ...]:
    """Return the notes of `notes_by_file` as sentences that begin with the file."""
    found = notes_by_file(recordings)
    return tuple(f"{file}: {note}" for file, notes in found.items() for note in notes)


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
    known = frame.attrs.get(OWN)
    if known is None or known["digest"] != _frame_digest(frame):
        return None
    channels = {str(name): frame[name].to_numpy() for name in frame}
    step, start = known["grid"] or (None, 0.0)
    return Recording(channels, step, known["units"], start, known["meta"])


def _frame_digest(frame: Any) -> str:
    """Return a digest of the names and values of a data frame, by which changes are seen."""
    names = repr([frame.index.name, *frame.columns]).encode()
    tables = [frame.index.to_numpy(), *(frame[name].to_numpy() for name in frame)]
    return digest(names + b"".join(np.ascontiguousarray(one).tobytes() for one in tables))


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
    given = recordings
    several = isinstance(given, Iterable) and not isinstance(given, Recording | str | np.ndarray)
    found = list(given) if several and not is_frame(given) else [given]
    found = [Recording.from_frame(one) if is_frame(one) else one for one in found]
    for one in found:
        if not isinstance(one, Recording):
            raise DataError(
                f"a recording is needed here, not {type(one).__name__} {str(one)[:40]!r}",
                remedy="read the file with mckibben.read; make one of arrays by "
                "mckibben.Recording({'pressure': u, 'displacement': y}, sample_time)",
            )
    return found
