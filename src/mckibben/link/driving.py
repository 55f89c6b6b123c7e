"""A device driven with constant inputs for a while, and what it did."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from mckibben.errors import DataError, DataWarning, require
from mckibben.link.client import Link
from mckibben.link.device import Device, State
from mckibben.recording import Recording

LONGEST = 86400.0
"""Time to drive a device [s]."""


@dataclass(frozen=True)
class Driven:
    """What a device is, how it was, and what it did while it was driven.

    Parameters
    ----------
    device : Device
    before : State
    after : State or None
        None where it was not driven.
    samples : tuple of State
        Of the recording.
    every : int
        Steps between these.
    """

    device: Device
    before: State
    after: State | None = None
    samples: tuple[State, ...] = ()
    every: int = 1

    def to_dict(self) -> dict[str, Any]:
        """Return the device and its states, for JSON."""
        device = self.device
        about = {
            "fingerprint": device.fingerprint,
            "period": device.period,
            "watchdog": device.period * device.silence,
            "numbers": str(device.kind),
            "memory": device.n_memory,
            "inputs": [asdict(port) for port in device.inputs],
            "outputs": [asdict(port) for port in device.outputs],
        }
        found = {"device": about, "state": _state(self.before)}
        return found if self.after is None else found | {"led": _state(self.after)}

    def recording(self) -> Recording:
        """Return the samples as a recording; rows that were lost on the way are interpolated.

        Raises
        ------
        DataError
            If there are fewer than two.
        """
        samples, device = self.samples, self.device
        if len(samples) < 2:
            raise DataError(
                "the device sent fewer than two steps in that time",
                remedy="give more `seconds`, or less `every`",
            )
        steps = np.array([one.steps - samples[0].steps for one in samples]) / self.every
        grid = np.arange(int(steps[-1]) + 1)
        if lost := len(grid) - len(samples):
            text = f"{lost} of {len(grid)} rows were lost on the way, and are interpolated"
            warnings.warn(text, DataWarning, stacklevel=2)
        channels, units = {}, {}
        inputs = [port.name for port in device.inputs]
        for k, port in enumerate(device.inputs):
            channels[port.name], units[port.name] = [one.inputs[k] for one in samples], port.unit
        for k, port in enumerate(device.outputs):
            name = f"{port.name}_out" if port.name in inputs else port.name
            channels[name], units[name] = [one.outputs[k] for one in samples], port.unit
        rows = {name: np.interp(grid, steps, column) for name, column in channels.items()}
        meta = {"device": device.fingerprint}
        return Recording(rows, device.period * self.every, units=units, meta=meta)


def _state(state: State) -> dict[str, Any]:
    return {
        "steps": state.steps,
        "safe": state.is_safe,
        "notes": [note.name.lower() for note in state.notes if note.name],
        "inputs": state.inputs.tolist(),
        "outputs": state.outputs.tolist(),
    }


def drive(line: Link, settings: Mapping[str, float], seconds: float, every: int) -> Driven:
    """Drive inputs of a device for some time; without any, only look at it.

    Parameters
    ----------
    line : Link
    settings : mapping of str to float
        Input -> value; the others stay as they are.
    seconds : float
        How long, up to a day.
    every : int
        Steps from one sample of the recording to the next; 0 for none.

    Raises
    ------
    DataError
        On unknown inputs, or values or times that are out of range.
    """
    require(0 < seconds <= LONGEST, "seconds", seconds, f"a time up to {LONGEST:g} s", DataError)
    require(0 <= every <= 0xFFFF, "every", every, "0 to 65535", DataError)
    before = line.state()
    if not settings:
        return Driven(line.device, before)
    inputs, names = before.inputs.copy(), [port.name for port in line.device.inputs]
    for name, value in settings.items():
        if name not in names or not math.isfinite(value):
            problem = f"{name!r:.60} cannot be {value:g}"
            remedy = f"give finite numbers to {', '.join(names)}"
            raise DataError(problem, parameter="settings", remedy=remedy)
        inputs[names.index(name)] = value
    line.set(inputs)
    if every:
        line.stream(every)
    samples: list[State] = []
    until = time.monotonic() + seconds
    pause = min(0.25 * line.device.period * line.device.silence, 0.1)
    while (left := until - time.monotonic()) > 0:
        if every:
            samples += line.samples(timeout=min(pause, left))
        else:
            time.sleep(min(pause, left))
        line.keep()
    return Driven(line.device, before, line.state(), tuple(samples), every or 1)
