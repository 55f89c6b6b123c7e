"""What can be done to a recording after it was read: steps as plain data, as calls, and in words."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mckibben import signals
from mckibben.app.kept import Step
from mckibben.errors import DataError
from mckibben.recording import Recording


@dataclass(frozen=True)
class _Edit:
    """A kind of step.

    Parameters
    ----------
    takes : tuple of str
        Fields of the step, in the order of the function's arguments.
    do : callable
        The function.
    call, words : str
        With the fields in braces; in a call, ``{x}`` is the recording.
    """

    takes: tuple[str, ...]
    do: Callable[..., Recording]
    call: str
    words: str


EDITS = {
    "slice": _Edit(
        ("start", "stop"), Recording.slice, "{x}.slice({start}, {stop})", "samples {start}:{stop}"
    ),
    "low_pass": _Edit(
        ("cutoff", "channels"),
        signals.low_pass,
        "mckibben.signals.low_pass({x}, {cutoff}, {channels})",
        "low-pass {cutoff} Hz",
    ),
    "detrend": _Edit(
        ("channels",), signals.detrend, "mckibben.signals.detrend({x}, {channels})", "drift removed"
    ),
    "resample": _Edit(
        ("sample_time",),
        signals.resample,
        "mckibben.signals.resample({x}, {sample_time})",
        "resampled to {sample_time} s",
    ),
    "zero": _Edit(
        ("channels", "over"),
        signals.zeroed,
        "mckibben.signals.zeroed({x}, {channels}, {over})",
        "zero where {over} is lowest",
    ),
}
"""By their names in a `mckibben.app.kept.Step`."""


def applied(recording: Recording, steps: Sequence[Step]) -> Recording:
    """Return a recording after some steps; errors are those of the functions."""
    for step in steps:
        edit = EDITS[step.do]
        values = _values(step)
        if step.do != "detrend" and any(values[name] is None for name in edit.takes[:1]):
            raise DataError(f"{step.do} needs {edit.takes[0]}", remedy="give it")
        recording = edit.do(recording, *(values[name] for name in edit.takes))
    return recording


Span = tuple[float, float] | None
"""First and last time of what a step cuts out; None of others."""


def spans(recording: Recording, steps: Sequence[Step]) -> list[Span]:
    """Return the times that steps cut out of a recording; errors are those of `applied`."""
    found: list[Span] = []
    for step in steps:
        cut = step.do == "slice"
        found.append(_ends(recording.slice(step.start, step.stop)) if cut else None)
        recording = applied(recording, [step])
    return found


def spanning(
    recording: Recording, steps: Sequence[Step], spans: Sequence[Span]
) -> tuple[Step, ...]:
    """Return steps whose cuts span some times of a recording; errors are those of `applied`."""
    found: list[Step] = []
    for step, span in zip(steps, spans, strict=True):
        if span is not None:
            half = 0.5 * (recording.sample_time or 1.0)
            start, stop = np.searchsorted(recording.time, (span[0] - half, span[1] + half))
            step = step.model_copy(update={"start": int(start), "stop": int(stop)})
        found.append(step)
        recording = applied(recording, [step])
    return tuple(found)


def renamed(step: Step, names: Mapping[str, str], recording: Recording) -> Step | None:
    """Return a step of channels that a recording may call otherwise; None where it has none of them.

    Parameters
    ----------
    step : Step
    names : mapping of str to str
        What channels are called now; those that are not in it are called the same.
    recording : Recording
    """
    channels, over = step.channels, step.over
    if channels is not None:
        channels = [now for name in channels if (now := names.get(name, name)) in recording]
    if over is not None:
        over = names.get(over, over)
    if channels == [] or (over is not None and over not in recording):
        return None
    return step.model_copy(update={"channels": channels, "over": over})


def _ends(recording: Recording) -> tuple[float, float]:
    return float(recording.time[0]), float(recording.time[-1])


def call(read: str, steps: Sequence[Step]) -> str:
    """Return the call that reads a recording and repeats the steps."""
    for step in steps:
        given = {name: repr(value) for name, value in _values(step).items()}
        read = EDITS[step.do].call.format(x=read, **given).replace(", None)", ")")
    return read


def words(step: Step) -> str:
    """Return what a step does, in a few words."""
    said = EDITS[step.do].words.format(**_values(step))
    return said if not step.channels else f"{said} ({', '.join(step.channels)})"


def _values(step: Step) -> dict[str, Any]:
    return {name: getattr(step, name) for name in EDITS[step.do].takes}
