"""mckibben plan: what to record next."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from mckibben.cli.grouping import spread
from mckibben.cli.options import Force, Json, Reading, Seed
from mckibben.cli.output import print_json, print_table, progress_bar, say

MOST = 12
"""Parameters in the table; --json has all."""


@spread
def plan(
    reading: Reading,
    out: Annotated[Path, typer.Option("-o", "--out", help="File to write: .csv, .tsv, .parquet.")],
    files: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[FILES]...", help="What has been recorded; also of a plan before."),
    ] = None,
    rig: Annotated[
        str | None,
        typer.Option("--rig", metavar="NAME|FILE", help="Rig that is driven: channels and limits."),
    ] = None,
    muscle: Annotated[
        str | None,
        typer.Option("--muscle", metavar="NAME|FILE", help="Without files: muscle, or data sheet."),
    ] = None,
    model: Annotated[
        str | None,
        typer.Option(
            "--model",
            metavar="NAME|FILE",
            help="Model to fit, or a saved one (.json). Default: balance; of forces multistate.",
        ),
    ] = None,
    minutes: Annotated[float, typer.Option("--minutes", help="How long to record.")] = 3.0,
    limits: Annotated[
        list[str] | None,
        typer.Option(
            "--limits",
            metavar="CHANNEL=LOW:HIGH[:RATE]",
            help="Commands, and how fast they go a second; repeatable. Default: the rig's, or those "
            "of the files.",
        ),
    ] = None,
    goal: Annotated[
        str | None,
        typer.Option(
            "--for",
            metavar="TEXT,...",
            help="Parameters that are to be known, by parts of their names. Default: predictions.",
        ),
    ] = None,
    seed: Seed = 0,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Find the motion that tells most of what is not known yet, to be recorded next.

    It starts and ends at rest. Record it, and plan again with all files: that goes for other things.
    """
    from mckibben.blocks.saving import load
    from mckibben.excitation.limits import parsed
    from mckibben.excitation.planning import plan as planned
    from mckibben.files import write
    from mckibben.outputs import claim_recording

    saved = model is not None and model.endswith(".json")
    named = [Path(name) for name in (rig, muscle, model if saved else None) if name is not None]
    read = [*(files or []), *named]
    claim_recording(out, inputs=read, force=force)
    within = parsed(limits or [])
    recordings = reading.read(files, None, informative=False) if files else []
    with progress_bar("planning") as tell:
        found = planned(
            recordings,
            rig=rig,
            muscle=muscle,
            model=load(model) if saved and model is not None else model,
            minutes=minutes,
            limits=within,
            goal=goal,
            seed=seed,
            progress=tell,
        )
    write(found.recording, out)
    if as_json:
        print_json({"file": str(out), **found.to_dict()})
        return
    say(found.sentence)
    if found.interrupted:
        say("Stopped: this is the best plan until then.")
    print_table(
        ["seconds", "what", "tells most of"],
        [[f"{one.start:.0f} to {one.stop:.0f}", one.what, one.why] for one in found.steps],
    )
    print_table(
        ["parameter", "value", "expected error now", "after"],
        [
            [one.name, f"{one.value:.4g}", f"{100 * one.now:.3g} %", f"{100 * one.after:.3g} %"]
            for one in found.learned[:MOST]
        ],
    )
    for note in found.notes:
        say(f"Note: {note}")
    say(f"Written: {out}{_how_to_record(found, rig, out)}")


def _how_to_record(found: Any, rig: str | None, out: Path) -> str:
    """Return the command that records it on a virtual rig, started where the plan starts."""
    if rig is None:
        return ""
    from mckibben.rigs import load_rig

    resting = dict(zip(load_rig(rig).inputs, load_rig(rig).resting[0].tolist(), strict=True))
    moved = [
        f" --set start.{name}={samples[0]:g}"
        for name, samples in found.recording.channels.items()
        if abs(samples[0] - resting[name]) > 0
    ]
    return (
        f"; record it with: mckibben rig run {rig} --inputs {out}{''.join(moved)} -o recorded.csv"
    )
