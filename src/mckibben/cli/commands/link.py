"""Show the model, the channels and the state of a device on a serial port.

Nothing on the device is changed. To drive a device from Python, use `mckibben.link.Link`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from mckibben.cli.output import show
from mckibben.cli.parameters import Json, command
from mckibben.options import Argument, Option


@command
def link(
    port: Annotated[Path, Argument("PORT", "Serial port, such as /dev/ttyACM0.")],
    baud: Annotated[int, Option("Rate of the port [bits/s].")] = 115200,
    fingerprint: Annotated[str | None, Option("Of the expected model (link.json).")] = None,
    as_json: Json = False,
) -> None:
    from dataclasses import asdict

    from mckibben.link import Link
    from mckibben.report import results, text

    with Link(port, baud=baud, fingerprint=fingerprint) as line:
        device, state = line.device, line.state()
    content = {
        "device": asdict(device) | {"watchdog": device.period * device.silence},
        "state": {
            "steps": state.steps,
            "safe": state.is_safe,
            "notes": [str(note.name).lower() for note in state.notes],
            "inputs": state.inputs.tolist(),
            "outputs": state.outputs.tolist(),
        },
    }
    show(content, lambda: text.lines(results.device(device, state)), as_json)
