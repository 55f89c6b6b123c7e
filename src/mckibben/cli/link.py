"""mckibben link: look at a device on a serial port, and lead it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mckibben.cli.options import Force, Json
from mckibben.cli.output import print_json, print_table, say
from mckibben.errors import DataError
from mckibben.numerals import numeral

if TYPE_CHECKING:
    from mckibben.link import Device, Link, State
    from mckibben.recording import Recording

LONGEST = 86400.0


def link(
    port: Annotated[Path, typer.Argument(help="Serial port, such as /dev/ttyACM0.")],
    setting: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="NAME=VALUE", help="Lead the device with this input; repeatable."
        ),
    ] = None,
    seconds: Annotated[float, typer.Option(help="How long to lead it [s].")] = 1.0,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="Recording of what it does to write.")
    ] = None,
    every: Annotated[int, typer.Option(help="Steps from one row of that to the next.")] = 1,
    baud: Annotated[int, typer.Option(help="Rate of the port [bits/s].")] = 115200,
    fingerprint: Annotated[
        str | None, typer.Option(help="Of the model that must be there (link.json).")
    ] = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Tell what a device is and how it stands; with --set, lead it for a while.

    Inputs that are not set stay as they are. When the time is up, and should this program end before,
    the device takes its safe outputs.
    """
    from mckibben.files import write
    from mckibben.link import Link
    from mckibben.outputs import claim_recording

    if not 0 < seconds <= LONGEST:
        raise DataError(f"--seconds {seconds:g}", remedy=f"give a time up to {LONGEST:g} s")
    if not 1 <= every <= 0xFFFF:
        raise DataError(f"--every {every}", remedy="give 1 to 65535")
    wanted = _settings(setting or [])
    if out is not None:
        if not wanted:
            raise DataError(
                "a device that nobody leads does nothing", remedy="give --set NAME=VALUE with -o"
            )
        claim_recording(out, inputs=[], force=force)
    with Link(port, baud=baud, fingerprint=fingerprint) as line:
        before = line.state()
        told = {"device": _told(line.device), "state": _stands(before)}
        if not as_json:
            _show(line.device, before)
        samples = _led(line, before, wanted, seconds, every if out else 0) if wanted else []
        if wanted:
            after = line.state()
            told["led"] = _stands(after)
            if not as_json:
                say(f"After {seconds:g} s: {_words(line.device, after)}")
        if out is not None:
            write(_recorded(line.device, samples, every), out)
    if as_json:
        print_json(told | {"file": None if out is None else str(out)})
    elif out is not None:
        say(f"Written: {out}")


def _settings(given: list[str]) -> dict[str, float]:
    found = {}
    for text in given:
        name, _, value = text.partition("=")
        try:
            found[name] = float(value)
        except ValueError:
            found[name] = math.nan
        if not name or not math.isfinite(found[name]):
            raise DataError(
                f"--set {text!r:.60}", remedy="give NAME=VALUE, such as displacement=12"
            )
    return found


def _led(
    line: Link, state: State, wanted: dict[str, float], seconds: float, every: int
) -> list[State]:
    """Lead a device for some time, and return what it told."""
    import time

    inputs, names = state.inputs.copy(), [port.name for port in line.device.inputs]
    for name, value in wanted.items():
        if name not in names:
            raise DataError(f"--set {name!r:.60}", remedy=f"the inputs are {', '.join(names)}")
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
    return samples


def _recorded(device: Device, samples: list[State], every: int) -> Recording:
    """Return the samples as a recording; rows that were lost on the way are interpolated, and told."""
    import numpy as np

    from mckibben.recording import Recording

    if len(samples) < 2:
        raise DataError(
            "the device told no two steps in that time",
            remedy="give more --seconds, or less --every",
        )
    steps = (
        np.array([state.steps - samples[0].steps for state in samples], dtype=np.float64) / every
    )
    grid = np.arange(int(steps[-1]) + 1)
    if lost := len(grid) - len(samples):
        say(
            f"Note: {lost} of {len(grid)} rows were lost on the way, and are interpolated",
            error=True,
        )
    channels, units = {}, {}
    inputs = [port.name for port in device.inputs]
    for k, port in enumerate(device.inputs):
        channels[port.name], units[port.name] = [state.inputs[k] for state in samples], port.unit
    for k, port in enumerate(device.outputs):
        name = f"{port.name}_out" if port.name in inputs else port.name
        channels[name], units[name] = [state.outputs[k] for state in samples], port.unit
    rows = {name: np.interp(grid, steps, column) for name, column in channels.items()}
    meta = {"device": device.fingerprint}
    return Recording(rows, device.period * every, units=units, meta=meta)


def _told(device: Device) -> dict[str, Any]:
    from dataclasses import asdict

    return {
        "fingerprint": device.fingerprint,
        "period": device.period,
        "watchdog": device.period * device.silence,
        "numbers": str(device.kind),
        "memory": device.n_memory,
        "inputs": [asdict(port) for port in device.inputs],
        "outputs": [asdict(port) for port in device.outputs],
    }


def _stands(state: State) -> dict[str, Any]:
    return {
        "steps": state.steps,
        "safe": state.is_safe,
        "notes": [note.name.lower() for note in state.notes if note.name],
        "inputs": state.inputs.tolist(),
        "outputs": state.outputs.tolist(),
    }


def _show(device: Device, state: State) -> None:
    kinds = ["input"] * len(device.inputs) + ["output"] * len(device.outputs)
    say(
        f"Model {device.fingerprint}: a step every {device.period:g} s, safe after "
        f"{device.period * device.silence:g} s of silence; {_words(device, state)}"
    )
    print_table(
        ["", "channel", "unit", "lowest", "highest", "safe", "now"],
        [
            [
                kind,
                port.name,
                port.unit,
                numeral(port.low, 4),
                numeral(port.high, 4),
                numeral(port.safe, 4) if kind == "output" else "",
                numeral(now, 5),
            ]
            for kind, port, now in zip(
                kinds,
                [*device.inputs, *device.outputs],
                [*state.inputs.tolist(), *state.outputs.tolist()],
                strict=True,
            )
        ],
    )


def _words(device: Device, state: State) -> str:
    outputs = ", ".join(
        f"{port.name} {numeral(value, 5)} {port.unit}"
        for port, value in zip(device.outputs, state.outputs.tolist(), strict=True)
    )
    how = "safe" if state.is_safe else "led"
    return f"{how} after {state.steps} steps: {outputs}"
