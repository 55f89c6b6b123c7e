"""mckibben ros: a compensator between topics of ROS 2."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mckibben.cli.options import Force, Json
from mckibben.cli.output import print_json, say
from mckibben.errors import DataError, ModelError

_TYPES = "Float64, Float64MultiArray, FluidPressure or JointState; default by how many numbers."


def ros(
    model: Annotated[Path, typer.Argument(help="Compensator or controller (JSON).")],
    reference: Annotated[
        str, typer.Option("--reference", metavar="TOPIC", help="What is wished for.")
    ],
    pressure: Annotated[str, typer.Option("--pressure", metavar="TOPIC", help="What is given.")],
    highest: Annotated[float, typer.Option(help="Pressures are clipped to this [bar].")],
    measured: Annotated[
        str | None,
        typer.Option("--measured", metavar="TOPIC", help="What else the model asks for."),
    ] = None,
    reference_type: Annotated[str | None, typer.Option(metavar="TYPE", help=_TYPES)] = None,
    measured_type: Annotated[str | None, typer.Option(metavar="TYPE", help="Likewise.")] = None,
    pressure_type: Annotated[str | None, typer.Option(metavar="TYPE", help="Likewise.")] = None,
    lowest: Annotated[float, typer.Option(help="Lowest pressure [bar].")] = 0.0,
    safe: Annotated[float, typer.Option(help="Pressure while topics are silent [bar].")] = 0.0,
    timeout: Annotated[float, typer.Option(help="Longest silence [s].")] = 0.2,
    rate: Annotated[float, typer.Option(help="Steps a second.")] = 100.0,
    duration: Annotated[
        float | None, typer.Option(help="When to end [s]; default at Ctrl-C.")
    ] = None,
    domain: Annotated[int, typer.Option(help="ROS_DOMAIN_ID.")] = 0,
    network: Annotated[
        bool, typer.Option("--network", help="Speak to other machines too, not to this one alone.")
    ] = False,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="Recording of all topics to write: .mcap.")
    ] = None,
    save: Annotated[
        Path | None,
        typer.Option("--save", help="What has been learnt, as a model to write (JSON)."),
    ] = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Run a compensator as a node of ROS 2, over Cyclone DDS, without ROS."""
    import math
    import signal
    import time
    from contextlib import suppress

    from mckibben.blocks.adaptive import Adaptive
    from mckibben.blocks.saving import load
    from mckibben.outputs import claim, claim_model, never
    from mckibben.ros.dds import Topics
    from mckibben.ros.kinds import kind_named
    from mckibben.ros.node import Node, Topic
    from mckibben.stream import FixedRate

    if not 0 < rate <= 1e5 or not (duration is None or 0 < duration <= 1e9):
        raise DataError(
            f"a rate of {rate:g} a second for {duration} s", remedy="give positive numbers"
        )
    if out is not None:
        if out.suffix.lower() != ".mcap":
            raise DataError("it is not called .mcap", file=out, remedy="name it so")
        claim(out, never, inputs=[model], force=force)

    def topic(name: str, kind: str | None) -> Topic:
        return Topic(name, kind_named(kind) if kind is not None else None)

    block = load(model)
    if save is not None:
        if not isinstance(block, Adaptive):
            raise ModelError(
                f"{block.title!r} does not learn, so there is nothing to save",
                remedy="leave out --save, or give what mckibben invert --adaptive writes",
            )
        claim_model(save, inputs=[model], force=force)
    node = Node(
        block,
        Topics(domain, network=network),
        reference=topic(reference, reference_type),
        measured=topic(measured, measured_type) if measured is not None else None,
        pressure=topic(pressure, pressure_type),
        highest=highest,
        lowest=lowest,
        safe=safe,
        timeout=timeout,
        period=1 / rate,
        record=out,
    )
    turns = FixedRate(1 / rate, math.inf if duration is None else duration)
    # as Ctrl-C: whoever ends it, a closed terminal too, the last pressure is the safe one
    enders = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    before = {each: signal.signal(each, signal.default_int_handler) for each in enders}
    try:
        with suppress(KeyboardInterrupt):
            node.run(turns, time.monotonic, time.time_ns)
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)
        if isinstance(block, Adaptive) and save is not None:
            learnt = block if node.state is None else block.resumed(node.state)
            learnt.save(save)
    kept = turns.deadlines
    if as_json:
        print_json(
            {"steps": int(kept.work.size), "missed": kept.missed, "refused": node.refused}
            | {"silences": node.silences, "led": node.led}
            | {"recording": str(out) if out else None, "saved": str(save) if save else None}
        )
        return
    say(str(kept))
    say(f"{node.silences} silences, {node.refused} messages refused")
    if not node.led:
        say(f"No reference ever came on {reference}; the pressure was safe throughout.")
    for written in (out, save):
        if written is not None:
            say(f"Written: {written}")
