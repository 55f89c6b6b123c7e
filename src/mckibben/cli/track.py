"""mckibben track: close a loop on a virtual rig, or on a model of one's own muscle."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mckibben import registry
from mckibben.cli.options import (
    Columns,
    Fields,
    Force,
    Json,
    Rate,
    Reading,
    RestLength,
    Seed,
    Units,
    limits_in,
    loaded,
)
from mckibben.cli.output import print_json, print_table, progress_bar, say
from mckibben.errors import DataError, ModelError
from mckibben.numerals import numeral

if TYPE_CHECKING:
    from mckibben.control.loop import Tracked
    from mckibben.control.roles import Plant


def track(
    compensator: Annotated[Path, typer.Argument(help="Inverse, from mckibben invert (JSON).")],
    reference: Annotated[
        Path,
        typer.Option("--reference", metavar="FILE", help="Displacements, or force, to follow."),
    ],
    rig: Annotated[
        str | None,
        typer.Option("--rig", metavar="NAME|FILE", help="Virtual rig to try it on; see rig list."),
    ] = None,
    twin: Annotated[
        Path | None,
        typer.Option(
            "--plant",
            metavar="MODEL",
            help="Model of your own muscle to try it on (JSON) instead; with a band, it scatters.",
        ),
    ] = None,
    limits: Annotated[
        list[str] | None,
        typer.Option(
            "--limits",
            metavar="CHANNEL=LOW:HIGH",
            help="Of --plant, where the model does not say, as pressure=0:6; repeatable.",
        ),
    ] = None,
    rest_length: RestLength = None,
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
    fields: Fields = None,
    seed: Seed = 0,
    column: Columns = None,
    unit: Units = None,
    rate: Rate = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Let a compensator, or a controller with it, follow a reference on a virtual rig, or on a model.

    Beside it stands what no compensation does: pressures read off one slow rise of the same plant.
    """
    from mckibben.blocks.base import Block
    from mckibben.blocks.feedback import FeedforwardFeedback
    from mckibben.control import (
        UNCOMPENSATED,
        BlockController,
        Twin,
        before,
        control_law,
        dead_time_undone,
        tune_pid,
    )
    from mckibben.control import track as close
    from mckibben.control.identified import beyond_known
    from mckibben.control.roles import asked, offered
    from mckibben.control.suiting import doubts_of_feedback
    from mckibben.control.twin import COMMAND
    from mckibben.files import write
    from mckibben.outputs import claim_model, claim_recording

    inputs = [compensator, reference, *([Path(rig)] if rig else []), *([twin] if twin else [])]
    if out is not None:
        claim_recording(out, inputs=inputs, force=force)
        inputs.append(out)
    if controller_out is not None:
        claim_model(controller_out, inputs=inputs, force=force)
    block = loaded(compensator, fields)
    plant = _plant(rig, twin, limits or [], rest_length)
    runs = Reading(column, unit, rate=rate).read([reference], None, informative=False)
    wanted = asked(plant, runs[0], block)
    BlockController(block).connect(offered(plant, wanted))  # before anything is tuned
    notes = beyond_known(block, wanted)
    held = {name: float(wanted[name][0]) for name in plant.inputs if name in wanted}
    step = wanted.sample_time or 0.02
    commanded = any(channel.name.startswith(COMMAND) for channel in block.outputs)
    with progress_bar(f"{controller} on {plant.name}") as tell:
        chosen = control_law(
            controller,
            block,
            lambda: tune_pid(plant, sample_time=step, scheduled=held, references=block.inputs),
        )
        if controller_out is not None and not isinstance(chosen, Block):
            raise ModelError(
                f"{controller!r} is no block that could be saved or exported",
                remedy="leave out --controller-out, or use a compensator, PID, or both together",
            )
        ahead = dead_time_undone(block) if preview is None else preview
        ahead += block.samples_ahead * step
        if controller_out is not None and isinstance(chosen, FeedforwardFeedback) and ahead > step:
            raise ModelError(
                f"a block has one reference, but compensator and feedback get it {ahead:g} s apart",
                remedy="leave out --controller-out, or say --preview 0",
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
            progress=lambda share: tell(0.5 * share, ""),
        )
        without = before(
            block,
            plant,
            wanted,
            approach=approach,
            settle=settle,
            pressure_loop=pressure_loop and not commanded,
            noise=noise,
            delay=delay,
            slew=slew,
            seed=seed,
            progress=lambda share: tell(0.5 + 0.5 * share, ""),
        )
    notes += [*without.notes, *doubts_of_feedback(controller, plant)]
    if out is not None:
        write(without.beside(found.recording), out)
    if controller_out is not None and isinstance(chosen, Block):
        chosen.save(controller_out)
    if as_json:
        print_json(
            {
                "controller": controller,
                "plant": {"name": plant.name, "virtual_rig": twin is None},
                "rmse": dict(found.rmse),
                "largest": dict(found.largest),
                "clipped": found.clipped,
                "clipping_cost": found.clipping_cost,
                "out_of_reach": {name: far._asdict() for name, far in found.beyond.items()},
                "scatter": dict(found.scatter),
                "uncompensated": _figures(without.tracked),
                "step_time": {"median": found.step_time[0], "p99.9": found.step_time[1]},
                "file": None if out is None else str(out),
                "controller_file": None if controller_out is None else str(controller_out),
                "notes": notes,
            }
        )
        return
    ways = [(controller, found), (UNCOMPENSATED, without.tracked)]
    rows = [
        [name, way, numeral(one.rmse[name], 3), numeral(one.largest[name], 3)]
        for name in found.rmse
        for way, one in ways
        if one is not None
    ]
    measure = wanted.units[next(iter(found.rmse))]
    for note in notes:  # before what they put in doubt
        say(f"Note: {note}")
    print_table(["followed", "by", f"RMSE [{measure}]", f"largest [{measure}]"], rows)
    if twin is None:
        say(f"On the virtual rig {plant.name}; --plant model.json tries it on your own muscle.")
    elif isinstance(plant, Twin):
        scatters = (
            "which scatters as its band says" if plant.scatters else "without a band to scatter"
        )
        say(f"On {twin}, a model ({plant.model.title}) {scatters}; seed {seed}.")
    for name, size in found.scatter.items():
        say(
            f"Of the RMSE of {name}, the plant's own scatter, which no compensator removes without "
            f"feedback: {numeral(size, 3)} {measure} RMS (seed {seed})."
        )
    if found.clipped >= len(found.recording):
        say("Pressures were at a limit throughout: the reference is out of reach.")
    elif found.clipped > max((far.samples for far in found.beyond.values()), default=0):
        cost = (
            f"; RMSE there is {numeral(found.clipping_cost, 3)} {measure} above that of the others"
        )
        costs = found.clipping_cost > 0
        say(f"Pressures were at a limit in {found.clipped} steps{cost if costs else ''}.")
    for name, far in found.beyond.items():
        say(
            f"{far.samples} samples of the reference {name} are out of reach ({numeral(far.low, 4)} to "
            f"{numeral(far.high, 4)} {measure}); RMSE over the others is "
            f"{numeral(far.rmse_elsewhere, 3)} {measure}."
        )
    say(
        f"Controller: {1e6 * found.step_time[0]:.0f} µs a step (median), "
        f"{1e6 * found.step_time[1]:.0f} µs (99.9 %)."
    )
    if out is not None:
        say(f"Written: {out}")


def _plant(
    rig: str | None, twin: Path | None, limits: list[str], rest_length: float | None
) -> Plant:
    """Return what the loop is closed on."""
    from mckibben.blocks.saving import load
    from mckibben.control import Twin
    from mckibben.rigs import load_rig

    if (rig is None) == (twin is None):
        raise DataError(
            "the compensator is tried on one plant",
            remedy="give --plant model.json, a model of your own muscle, or --rig NAME",
        )
    if twin is None:
        if limits or rest_length is not None:
            option, own = ("--limits", "limits") if limits else ("--rest-length", "a rest length")
            raise DataError(f"a rig has {own} of its own", remedy=f"leave {option} out")
        return load_rig(str(rig))
    given = {}
    for channel, numbers in limits_in(limits).items():
        low, high, *rest = numbers
        if low is None or high is None or rest:
            raise DataError(
                "limits of a plant are two numbers",
                channel=channel,
                remedy=f"write --limits {channel}=LOW:HIGH; --slew says how fast pressures change",
            )
        given[channel] = (low, high)
    return Twin(load(twin), limits=given, name=twin.stem, rest_length=rest_length)


def _figures(tracked: Tracked | None) -> dict[str, object] | None:
    """Return what no compensation gives, for JSON."""
    if tracked is None:
        return None
    return {
        "rmse": dict(tracked.rmse),
        "largest": dict(tracked.largest),
        "clipped": tracked.clipped,
    }
