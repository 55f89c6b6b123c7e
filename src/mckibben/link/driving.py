"""A device driven with constant inputs for a while, and the recording of it."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import DataError, DataWarning, require
from mckibben.link.client import WORDS, Device, Link, Note, State
from mckibben.recording import Recording

LONGEST = 86400.0
"""Time to drive a device [s]."""

LATE = 1.0
"""Between two samples, the largest difference of the device's time and the host's [s]."""


@dataclass(frozen=True)
class Driven:
    """A device, its state before and, if it was driven, after that, and every so many of its steps."""

    device: Device
    before: State
    after: State | None = None
    samples: tuple[State, ...] = ()
    every: int = 1

    def places(self) -> tuple[list[int], int]:
        """Return the rows of the samples in the recording, and how often the device was interrupted.

        Steps are counted modulo 2^32. Where the count does not fit the time between two samples, or the
        device was resumed, as after a reset, the host's time says how many rows are between them.
        """
        period, rows, n_breaks = self.device.period, [0], 0
        for one, other in pairwise(self.samples):
            steps, seconds = (other.steps - one.steps) % WORDS, other.time - one.time
            resumed = Note.RESUMED in other.notes and Note.RESUMED not in one.notes
            if resumed or abs(steps * period - seconds) > LATE:
                steps, n_breaks = round(seconds / period), n_breaks + 1
            rows.append(rows[-1] + max(round(steps / self.every), 1))
        return rows, n_breaks

    def recording(self) -> Recording:
        """Return the samples as a recording; a warning says how many rows are missing.

        Raises
        ------
        DataError
            If there are fewer than two samples.
        """
        if len(self.samples) < 2:
            problem = "fewer than two steps of the device were received"
            raise DataError(problem, remedy="give more `seconds`, or less `every`")
        rows, n_breaks = self.places()
        grid = np.arange(rows[-1] + 1)
        if missing := len(grid) - len(rows):
            text = f"{missing} of {len(grid)} rows are missing, and interpolated"
            warnings.warn(text, DataWarning, stacklevel=2)
        if n_breaks:
            text = f"the device was reset, or took safe outputs, {n_breaks} time(s) meanwhile"
            warnings.warn(text, DataWarning, stacklevel=2)
        columns, units, device = dict[str, Array](), {}, self.device
        values = np.array([[*one.inputs, *one.outputs] for one in self.samples]).T
        for port, column in zip((*device.inputs, *device.outputs), values, strict=True):
            name = f"{port.name}_out" if port.name in columns else port.name
            columns[name], units[name] = np.interp(grid, rows, column), port.unit
        meta = {"device": device.fingerprint}
        return Recording(columns, device.period * self.every, units=units, meta=meta)

    def to_dict(self) -> dict[str, Any]:
        """Return the device and its states, for JSON."""
        about = {"watchdog": self.device.period * self.device.silence}
        found = {"device": asdict(self.device) | about, "state": _state(self.before)}
        return found if self.after is None else found | {"led": _state(self.after)}


def _state(state: State) -> dict[str, Any]:
    notes = [note.name.lower() for note in Note if note in state.notes and note.name]
    values = {"inputs": state.inputs.tolist(), "outputs": state.outputs.tolist()}
    return {"steps": state.steps, "safe": state.is_safe, "notes": notes, **values}


def drive(link: Link, settings: Mapping[str, float], seconds: float, every: int) -> Driven:
    """Drive inputs of a device for some time [s], up to a day; without settings, only look at it.

    ``settings`` are values of inputs; the others stay. ``every`` so many steps are samples, 0 for none.
    """
    require(0 < seconds <= LONGEST, "seconds", seconds, f"a time up to {LONGEST:g} s", DataError)
    before, device, samples = link.state(), link.device, list[State]()
    if not settings:
        return Driven(device, before)
    inputs, names = before.inputs.copy(), [port.name for port in device.inputs]
    for name, value in settings.items():
        if name not in names or not math.isfinite(value):
            remedy = f"give finite numbers to {', '.join(names)}"
            problem = f"{name!r:.60} cannot be {value:g}"
            raise DataError(problem, parameter="settings", remedy=remedy)
        inputs[names.index(name)] = value
    link.stream(every)
    until = time.monotonic() + seconds
    pause = min(0.25 * device.period * device.silence, 0.1)
    while (left := until - time.monotonic()) > 0:
        link.set(inputs)
        if every:
            samples += link.samples(timeout=min(pause, left))
        else:
            time.sleep(min(pause, left))
    return Driven(device, before, link.state(), tuple(samples), every or 1)
