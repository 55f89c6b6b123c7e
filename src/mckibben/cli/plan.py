"""mckibben plan: what to record next."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mckibben.cli.grouping import spread
from mckibben.cli.options import Force, Json, Reading, Seed, limits_in
from mckibben.cli.output import print_json, print_table, say
from mckibben.numerals import numeral
from mckibben.recording import Recording

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
            help="Model of the standard errors, to fit, or saved (.json). Default: balance, or "
            "multistate of forces.",
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
    seed: Seed = 0,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Write the motion to record next: random motion within limits, and what closes data gaps.

    It starts and ends at rest. Expected standard errors of a model's parameters stand beside it.
    """
    from mckibben.blocks.saving import load
    from mckibben.files import write
    from mckibben.outputs import claim_recording
    from mckibben.planning.planner import plan as planned
    from mckibben.report.words import plan_sentences

    saved = model is not None and model.endswith(".json")
    named = [Path(name) for name in (rig, muscle, model if saved else None) if name is not None]
    claim_recording(out, inputs=[*(files or []), *named], force=force)
    within = limits_in(limits or [])
    found = planned(
        reading.read(files, None, informative=False) if files else [],
        rig=rig,
        muscle=muscle,
        model=load(model) if saved and model is not None else model,
        minutes=minutes,
        limits=within,
        seed=seed,
    )
    write(found.recording, out)
    if as_json:
        print_json({"file": str(out), **found.to_dict()})
        return
    print_table(
        ["seconds", "what", "closes"],
        [
            [f"{one.start:.0f} to {one.stop:.0f}", one.what, ", ".join(one.gaps) or "-"]
            for one in found.steps
        ],
    )
    shown = sorted(found.parameters, key=lambda one: one.after or 0.0, reverse=True)[:MOST]
    if shown:
        print_table(
            ["parameter", "value", "standard error now", "with the plan"],
            [
                [one.name, f"{one.value:.4g}", *(_percent(x) for x in (one.now, one.after))]
                for one in shown
            ],
        )
    for sentence in plan_sentences(found):
        say(sentence)
    say(f"Written: {out}{_how_to_record(found.recording, rig, out)}")


def _percent(share: float | None) -> str:
    return "-" if share is None else "over 100 %" if share > 1 else f"{numeral(100 * share, 2)} %"


def _how_to_record(planned: Recording, rig: str | None, out: Path) -> str:
    """Return the command that records it on a virtual rig, started where the plan starts."""
    if rig is None:
        return ""
    from mckibben.rigs import load_rig

    resting = dict(zip(load_rig(rig).inputs, load_rig(rig).resting[0].tolist(), strict=True))
    moved = [
        f" --set start.{name}={samples[0]:g}"
        for name, samples in planned.channels.items()
        if abs(samples[0] - resting[name]) > 0
    ]
    return (
        f"; record it with: mckibben rig run {rig} --inputs {out}{''.join(moved)} -o recorded.csv"
    )
