"""Virtual rigs: list, show, run, record."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import click

from mckibben.cli.output import say, show
from mckibben.cli.parameters import Force, Json, command
from mckibben.cli.stopping import stoppable
from mckibben.options import Argument, Jobs, Option, Seed
from mckibben.parsers import setting
from mckibben.printing import printable
from mckibben.system.progress import telling

Name = Annotated[str, Argument("RIG", "Name of a rig, or its file (.toml).")]
Changes = Annotated[
    dict[str, Any],
    Option("Change the rig: payload=10; repeatable.", "NAME=VALUE", "--set", setting),
]


@command
def list_(as_json: Json = False) -> None:
    """List the rigs, the protocols made for them, and the signals that can drive them."""
    from mckibben.report import results, text
    from mckibben.studying.rig_runs import catalogue

    lists = catalogue()
    show(lists, lambda: text.lines(results.rigs(lists)), as_json)


@command
def show_(
    name: Name,
    changes: Changes = {},  # noqa: B006
    out: Annotated[
        Path | None, Option("File to write it to (.toml), as your own rig.", "FILE", "-o")
    ] = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Show every parameter of a rig with its unit, meaning and range, as the text of its file.

    With -o it becomes a rig of your own, which is given by its file wherever a rig is asked for.
    """
    from mckibben.outputs import claim
    from mckibben.rigs import describe, load_rig, save_rig

    if out is not None:
        claim(out, inputs=[Path(name)], force=force)
    rig = load_rig(name).changed(changes)
    if out is not None:
        save_rig(rig.changed({"name": out.stem}), out)
        say(f"Written: {printable(out)}")
    elif as_json:
        show(rig.model_dump(mode="json"), list, True)
    else:
        say(describe(rig), end="")


@command
def run(
    name: Name,
    out: Annotated[Path, Option("File to write (.csv).", "FILE", "-o")],
    signal: Annotated[
        tuple[str, ...],
        Option(
            "What drives a channel, by default the first, over its range; repeatable. See rig list.",
            "[CHANNEL=]SIGNAL[:SETTING=VALUE,...]",
        ),
    ] = (),
    inputs: Annotated[
        Path | None, Option("Recording to take the commands from instead.", "FILE")
    ] = None,
    duration: Annotated[float, Option("Seconds.")] = 60.0,
    rate: Annotated[float | None, Option("Samples per second. Default: the rig's.", "HZ")] = None,
    changes: Changes = {},  # noqa: B006
    ideal: Annotated[bool, Option("Ideal sensors; adds the muscle volumes.")] = False,
    seed: Seed = 0,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Run one experiment and write the recording.

    The rig begins at rest at the first commands, unless its file or --set has others (start.pressure=1).
    """
    from mckibben.errors import DataError
    from mckibben.files import read, write
    from mckibben.outputs import claim_recording
    from mckibben.report import results, text
    from mckibben.rigs import load_rig
    from mckibben.studying.rig_runs import at_first_commands, commands

    claim_recording(out, inputs=[Path(name), *([] if inputs is None else [inputs])], force=force)
    rig = load_rig(name).changed(changes)
    if bool(signal) == (inputs is not None):
        raise DataError(
            "a rig is driven by signals or by a recording", remedy="give `signal` or `inputs`"
        )
    if inputs is None:
        command_recording = commands(rig, signal, duration, rate, seed)
    else:
        command_recording, *others = read(inputs, channels=[rig.inputs[0]], informative=False)
        if others:
            raise DataError("there are several recordings in it", file=inputs, remedy="give one")
        command_recording = command_recording.select(
            [channel for channel in rig.inputs if channel in command_recording]
        )
    recording = at_first_commands(rig, command_recording).run(command_recording, seed, ideal=ideal)
    write(recording.with_meta(name=out.stem), out)
    content = {"file": str(out), "n_samples": len(recording), "ranges": recording.ranges}
    content["saturated"] = dict(recording.meta.get("saturated", {}))
    show(content, lambda: text.lines(results.recording(recording)), as_json, written=[out])


@command
def record(
    protocol: Annotated[str, Argument("PROTOCOL", "Protocol to record; see rig list.")],
    out: Annotated[Path, Option("Folder to write the recordings to.", "DIR", "-o")],
    rig: Annotated[str | None, Option("Rig to record on. Default: the protocol's.", "RIG")] = None,
    changes: Changes = {},  # noqa: B006
    only: Annotated[str | None, Option("Only runs with TEXT in their name.", "TEXT")] = None,
    seed: Seed = 0,
    jobs: Jobs = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Record a paper's whole protocol: one file a run, and protocol.json with what each is for.

    Files of a recording that was stopped are not made again.
    """
    from mckibben.report import results, text
    from mckibben.studying.rig_runs import record_protocol

    with stoppable(out), telling(True, f"recording {protocol}") as tell:
        recorded, earlier, scaled = record_protocol(
            protocol, out, rig=rig, changes=changes, only=only, seed=seed,
            jobs=jobs, force=force, progress=tell,
        )  # fmt: skip
    more = f", {len(earlier)} were there already" if earlier else ""
    lines = [f"Written: {len(recorded)} recordings to {out}{more}; roles are in protocol.json"]
    content: dict[str, Any] = {"folder": str(out), "recorded": recorded, "earlier": sorted(earlier)}
    content |= {"scaled": [level._asdict() for level in scaled]}
    show(content, lambda: [*text.lines(results.scaled(scaled)), *lines], as_json)


rig = click.Group(
    "rig", help=__doc__, commands={one.name or "": one for one in (list_, show_, run, record)}
)
