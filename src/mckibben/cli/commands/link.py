"""Show what a device on a serial port is and does; with --set, drive its inputs for a while.

Inputs that are not set stay as they are. When the time is up, and should this program end before,
the device takes its safe outputs.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from mckibben.cli.output import show
from mckibben.cli.parameters import Argument, Force, Json, command
from mckibben.options import Option, number


@command
def link(
    port: Annotated[Path, Argument("PORT", "Serial port, such as /dev/ttyACM0.")],
    settings: Annotated[
        dict[str, float],
        Option("Input of the device to drive; repeatable.", "NAME=VALUE", "--set", number),
    ] = {},  # noqa: B006
    seconds: Annotated[float, Option("How long to drive it [s].")] = 1.0,
    out: Annotated[Path | None, Option("Recording of that to write.", "FILE", "-o")] = None,
    every: Annotated[int, Option("Steps from one row of the recording to the next.")] = 1,
    baud: Annotated[int, Option("Rate of the port [bits/s].")] = 115200,
    fingerprint: Annotated[str | None, Option("Of the expected model (link.json).")] = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    from mckibben.errors import DataError
    from mckibben.files import write
    from mckibben.link import Link
    from mckibben.link.driving import drive
    from mckibben.outputs import claim_recording
    from mckibben.report import results, text

    if out is not None:
        if not settings:
            raise DataError(
                "no input is set to drive the device", remedy="give `settings[NAME]=VALUE` with it",
                parameter="out",
            )  # fmt: skip
        claim_recording(out, inputs=[], force=force)
    with Link(port, baud=baud, fingerprint=fingerprint) as line:
        found = drive(line, settings, seconds, every if out else 0)
    if out is not None:
        write(found.recording(), out)
    about = found.to_dict() | {"file": None if out is None else str(out)}
    show(about, lambda: text.lines(results.device(found)), as_json, written=[out])
