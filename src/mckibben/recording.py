"""A recording: named channels with units on one uniform time grid, with metadata."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple, SupportsFloat, SupportsIndex

import numpy as np
from numpy.typing import ArrayLike

from mckibben.arrays import Array, check_finite
from mckibben.errors import DataError
from mckibben.system.showing import DrawsItself

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
    "V": Plausible(-1e3, 1e3, 5.0),
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

SAME_TIME = 1e-3
"""Relative difference up to which sample times are equal."""

PROVENANCE = ("file", "sha256")
"""Entries of ``meta`` on the file of a recording; recordings are compared without them."""


def standard_unit(channel: str) -> str | None:
    """Return the package's unit of a channel of this name, or None.

    >>> standard_unit("pressure_extensor"), standard_unit("displacement_model")
    ('bar', 'mm')
    """
    return STANDARD_UNITS.get(channel.partition("_")[0])


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
class Recording(DrawsItself):
    """Samples of one run, on a uniform time grid.

    Parameters
    ----------
    channels : mapping of str to array_like, shape (n,)
        The samples; finite, all of the same length, at least two. Copied, and read-only after.
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

    def __post_init__(self) -> None:
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
        strangers = set(self.units) - set(channels)
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

    def __getitem__(self, channel: str) -> Array:
        """Return the samples of one channel, shape (n,), read-only."""
        if channel not in self.channels:
            remedy = f"name one of them, or map a column with `columns[{channel}]=COLUMN`"
            if any(conversion(channel, name, 1.0) for name in self.channels):
                remedy = f"state {REST_LENGTH}, which makes it of another"
            raise DataError(
                f"there is no channel {channel!r}; there are {', '.join(self.channels)}",
                file=self.source,
                remedy=remedy,
            )
        return self.channels[channel]

    @property
    def n_samples(self) -> int:
        """Number of samples."""
        return next(iter(self.channels.values())).size

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
        return "simulated" if "(virtual)" in str(self.meta.get("rig", "")) else "measured"

    @property
    def name(self) -> str:
        """A short name to show: ``meta["name"]``, or the stem of the source file."""
        given = self.meta.get("name")
        if given is not None:
            return str(given)
        return "recording" if self.source is None else Path(self.source).stem

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
            Its columns are channels, in the package's units (bar, mm, N, s, rad). A column or an index
            named ``time`` [s], or an index of dates or durations, is the time grid.
        sample_time : float, optional
            Time between rows [s], without such a column; none where neither is given.
        units : mapping of str to str, optional
            Units of channels that the package has no unit for.
        **meta
            What else is known, as ``name="run 1"``.

        Raises
        ------
        DataError
            On times that are not uniform, and samples that are none.
        """
        start, known, columns = 0.0, frame.attrs.get("mckibben", {}), frame
        stamps = frame.index
        if "time" in frame:
            stamps, columns = frame["time"], frame.drop(columns="time")
        kind = stamps.dtype.kind
        if stamps.name == "time" or kind in "mM":
            time = stamps.to_numpy(f"{kind}8[ns]" if kind in "mM" else None)
            seconds = (time - time[:1]) / np.timedelta64(1, "s") if kind in "mM" else time
            sample_time, start = _grid(_frozen("time", seconds), *known.get("grid") or ())
        channels = {str(name): columns[name].to_numpy() for name in columns}
        carried = {name: unit for name, unit in known.get("units", {}).items() if name in channels}
        units = carried | dict(units or {})
        return cls(channels, sample_time, units, start, known.get("meta", {}) | meta)

    def to_frame(self) -> Any:
        """Return the channels as a data frame of pandas over time [s]; the inverse of `from_frame`."""
        import pandas as pd

        index = None if self.sample_time is None else pd.Index(self.time, name="time")
        frame = pd.DataFrame(dict(self.channels), index=index)
        grid = None if self.sample_time is None else (self.sample_time, self.start_time)
        about = {"grid": grid, "units": dict(self.units), "meta": dict(self.meta)}
        frame.attrs["mckibben"] = about
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
        raise DataError(problem, file=recording.source, remedy=remedy)
    return recording.sample_time


def check_sample_times(recordings: Sequence[Recording], *, equal: bool = True) -> None:
    """Raise a `DataError` where some recordings have no time, or sample times are not `equal`."""
    for first, one in ((recordings[0], one) for one in recordings):
        step, usual = one.sample_time, first.sample_time
        if (step is None) != (usual is None):
            raise DataError(
                "some recordings have time and others have none",
                file=one.source,
                remedy="give `rate` for those without, or use them separately",
            )
        if equal and step and usual and abs(step - usual) > SAME_TIME * usual:
            raise DataError(
                f"the sample time is {step:g} s here and {usual:g} s in {first.name}",
                file=one.source,
                remedy=f"give `resample={max(step, usual):.3g}`",
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
