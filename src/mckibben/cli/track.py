"""mckibben track: close a loop on a virtual rig."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mckibben import registry
from mckibben.cli.options import Columns, Force, Gaps, Json, Rate, Reading, Seed, Units
from mckibben.cli.output import print_json, print_table, progress_bar, say
from mckibben.errors import DataError, ModelError
from mckibben.numerals import numeral

if TYPE_CHECKING:
    from mckibben.blocks.core.block import Block
    from mckibben.recording import Recording
    from mckibben.rigs import Rig

COMMAND = "command_"


def track(
    compensator: Annotated[Path, typer.Argument(help="Inverse, from mckibben invert (JSON).")],
    rig: Annotated[str, typer.Option("--rig", help="Rig, by name or file; see rig list.")],
    reference: Annotated[
        Path,
        typer.Option("--reference", metavar="FILE", help="Displacements, or force, to follow."),
    ],
    controller: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="feedforward, feedforward-pid, observer, or pid, which does without the inverse.",
            autocompletion=lambda: registry.names("controllers"),
        ),
    ] = "feedforward",
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="Recording of the run to write.")
    ] = None,
    controller_out: Annotated[
        Path | None,
        typer.Option("--controller-out", help="Controller to write (JSON), for export."),
    ] = None,
    approach: Annotated[float, typer.Option(help="Time to reach the first reference [s].")] = 20.0,
    settle: Annotated[float, typer.Option(help="Time after that not scored [s].")] = 0.0,
    noise: Annotated[float, typer.Option(help="Added to what is followed [mm or N].")] = 0.0,
    delay: Annotated[int, typer.Option(help="Steps by which measurements come late.")] = 0,
    slew: Annotated[float | None, typer.Option(help="Fastest pressure change [bar/s].")] = None,
    preview: Annotated[
        float | None,
        typer.Option(
            help="How far ahead compensators know the reference [s]; default their dead time."
        ),
    ] = None,
    pressure_loop: Annotated[
        bool, typer.Option(help="Feed measured pressures back inside, as regulators do.")
    ] = True,
    seed: Seed = 0,
    column: Columns = None,
    unit: Units = None,
    rate: Rate = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Let a compensator, or a controller with it, follow a reference on a virtual rig."""
    from mckibben.blocks.core.block import Block
    from mckibben.blocks.core.saving import load
    from mckibben.blocks.coupled.known import beyond_known
    from mckibben.blocks.feedback.feedforward_feedback import FeedforwardFeedback
    from mckibben.control import control_law, dead_time_undone, tune_pid
    from mckibben.control import track as close
    from mckibben.control.preview import samples_foreseen
    from mckibben.files import write
    from mckibben.outputs import claim_model, claim_recording
    from mckibben.rigs import load_rig

    inputs = [compensator, reference, Path(rig)]
    if out is not None:
        claim_recording(out, inputs=inputs, force=force)
        inputs.append(out)
    if controller_out is not None:
        claim_model(controller_out, inputs=inputs, force=force)
    block = load(compensator)
    plant = load_rig(rig)
    runs = Reading(column, unit, rate, Gaps.ERROR).read([reference], None, informative=False)
    wanted = runs[0]
    _fits(block, plant, wanted)
    # pressures recorded with the reference are not what the compensator will give
    given = {channel.name for channel in block.outputs} | set(_driven(block))
    wanted = wanted.select([name for name in wanted.channels if name not in given])
    notes = beyond_known(block, wanted)
    held = {name: float(wanted[name][0]) for name in plant.inputs if name in wanted}
    step = wanted.sample_time or 0.02
    commanded = any(channel.name.startswith(COMMAND) for channel in block.outputs)
    with progress_bar(f"{controller} on {plant.name}") as tell:
        chosen = control_law(
            controller, block, lambda: tune_pid(plant, sample_time=step, scheduled=held)
        )
        if controller_out is not None and not isinstance(chosen, Block):
            raise ModelError(
                f"{controller!r} is no block that could be saved or exported. "
                "Remedy: leave out --controller-out, or use a compensator, PID, or both together."
            )
        ahead = dead_time_undone(block) if preview is None else preview
        ahead += samples_foreseen(block) * step
        if controller_out is not None and isinstance(chosen, FeedforwardFeedback) and ahead > step:
            raise ModelError(
                f"a block has one reference, but compensator and feedback get it {ahead:g} s apart. "
                "Remedy: leave out --controller-out, or say --preview 0."
            )
        found = close(
            chosen,
            plant,
            wanted,
            approach=approach,
            settle=settle,
            # commands are no pressures to be compared with what is measured
            pressure_loop=pressure_loop and not commanded,
            noise=noise,
            delay=delay,
            slew=slew,
            preview=preview,
            seed=seed,
            progress=lambda share: tell(share, ""),
        )
    if out is not None:
        write(found.recording, out)
    if controller_out is not None and isinstance(chosen, Block):
        chosen.save(controller_out)
    if as_json:
        print_json(
            {
                "controller": controller,
                "rmse": dict(found.rmse),
                "largest": dict(found.largest),
                "clipped": found.clipped,
                "clipping_cost": found.clipping_cost,
                "step_time": {"median": found.step_time[0], "p99.9": found.step_time[1]},
                "file": None if out is None else str(out),
                "controller_file": None if controller_out is None else str(controller_out),
                "notes": notes,
            }
        )
        return
    rows = [
        [name, numeral(found.rmse[name], 3), numeral(found.largest[name], 3)] for name in found.rmse
    ]
    measure = wanted.units[next(iter(found.rmse))]
    print_table(["followed", f"RMSE [{measure}]", f"largest [{measure}]"], rows)
    if found.clipped >= len(found.recording):
        say("Pressures were at a limit throughout: the reference is out of reach.")
    elif found.clipped:
        side = "below" if found.clipping_cost < 0 else "above"
        say(
            f"Pressures were at a limit in {found.clipped} steps; RMSE there is "
            f"{numeral(abs(found.clipping_cost), 3)} {measure} {side} that of the other steps."
        )
    say(
        f"Controller: {1e6 * found.step_time[0]:.0f} µs a step (median), "
        f"{1e6 * found.step_time[1]:.0f} µs (99.9 %)."
    )
    for note in notes:
        say(f"Note: {note}")
    if out is not None:
        say(f"Written: {out}")


def _driven(block: Block) -> list[str]:
    """Return the inputs of a plant that a compensator drives; commands are recorded under such names."""
    return [channel.name.removeprefix(COMMAND) for channel in block.outputs]


def _fits(block: Block, plant: Rig, reference: Recording) -> None:
    """Refuse a model in place of an inverse, and references without what the inverse needs."""
    for name in _driven(block):
        if name not in plant.inputs:
            raise DataError(
                f"the compensator gives {name!r}, which does not drive {plant.name!r}",
                remedy="give what mckibben invert wrote, and the rig that the model is of",
            )
    for channel in block.inputs:
        if channel.name not in reference:
            raise DataError(
                "the compensator needs it, but the reference has no such channel",
                file=reference.source,
                channel=channel.name,
                remedy="add the column",
            )
