"""mckibben invert: turn a model into its compensator."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mckibben.cli.grouping import spread
from mckibben.cli.invert_predictive import write_predictive
from mckibben.cli.options import Fields, Force, Json, Reading, Seed, loaded
from mckibben.cli.output import print_json, say
from mckibben.numerals import numeral

if TYPE_CHECKING:
    from mckibben.blocks.base import Block
    from mckibben.blocks.fields import Channel
    from mckibben.recording import Recording


class Wanted(StrEnum):
    """What is to be given."""

    input = "input"
    force = "force"


@spread
def invert(
    reading: Reading,
    model: Annotated[Path, typer.Argument(help="Model file (JSON).")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Inverse to write (JSON).")],
    wanted: Annotated[
        Wanted,
        typer.Option(
            "--for",
            help="What it gives: the model's input, or the force on muscles whose displacements and "
            "pressures are measured (of a balance).",
        ),
    ] = Wanted.input,
    adaptive: Annotated[
        bool,
        typer.Option(
            "--adaptive", help="Learn the model's parameters from what is measured meanwhile."
        ),
    ] = False,
    time: Annotated[
        float | None,
        typer.Option(help="With --adaptive: how long it takes to learn [s].  [default: 60]"),
    ] = None,
    noise: Annotated[
        float | None,
        typer.Option(
            help="With --adaptive: standard deviation of what is measured, in the unit of the model's "
            "output.  [default: a thousandth of what is reached]"
        ),
    ] = None,
    predictive: Annotated[
        bool, typer.Option("--predictive", help="Look ahead, so that limits cost less.")
    ] = False,
    horizon: Annotated[
        int | None, typer.Option(help="Samples it looks at (--predictive).  [default: 20]")
    ] = None,
    rate_limit: Annotated[
        float | None, typer.Option(help="Fastest change of a pressure [bar/s] (--predictive).")
    ] = None,
    pressures: Annotated[
        tuple[float, float] | None,
        typer.Option(help="Lowest and highest pressure [bar] (--predictive)."),
    ] = None,
    total_limit: Annotated[
        float | None, typer.Option(help="Highest sum of pressures [bar] (--predictive).")
    ] = None,
    flow_limit: Annotated[
        float | None,
        typer.Option(help="Fastest rise of all pressures together [bar/s] (--predictive)."),
    ] = None,
    learned: Annotated[
        list[Path] | None,
        typer.Option(
            "--learned",
            metavar="FILE",
            help="Of sdchm: train its network on recordings the other way round, as the paper's SDIHC, "
            "instead of solving the model's own; repeatable.",
        ),
    ] = None,
    fields: Fields = None,
    seed: Seed = 0,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Write the inverse of a saved model: desired output in, input out.

    Of a model of force, what is written gives the pressure by desired force and length. With
    --for force, what is written gives the force by measured displacements and pressures: simulate it.
    With --adaptive, what is written also takes what is measured, and learns from it while it runs.
    """
    import numpy as np

    from mckibben.blocks.adaptive import adaptive as learning
    from mckibben.blocks.coupled.load_estimate import load_of
    from mckibben.blocks.force.feedforward import ForceFeedforward
    from mckibben.blocks.inverse import drives
    from mckibben.errors import ModelError
    from mckibben.outputs import claim_model

    if not adaptive and (time is not None or noise is not None):
        raise ModelError("--time and --noise are of what learns", remedy="give --adaptive too")
    if adaptive and wanted is Wanted.force:
        raise ModelError(
            "--adaptive learns an inverse, not a force", remedy="leave out one of them"
        )
    if predictive and (adaptive or wanted is Wanted.force):
        raise ModelError(
            "--predictive plans a fixed model's inputs",
            remedy="leave out --adaptive or --for force",
        )
    limits = (horizon, rate_limit, pressures, total_limit, flow_limit)
    if not predictive and any(limit is not None for limit in limits):
        raise ModelError(
            "a horizon and limits are for compensators that look ahead", remedy="add --predictive"
        )
    if learned and (adaptive or predictive or wanted is Wanted.force):
        raise ModelError(
            "--learned is an inverse of its own",
            remedy="leave out --adaptive, --predictive or --for",
        )
    claim_model(out, inputs=[model, *(learned or [])], force=force)
    block = loaded(model, fields)
    if learned:
        _learned(block, reading.read(learned, None, informative=False), seed, out, as_json)
        return
    if predictive:
        write_predictive(
            block.inverse(),
            out,
            horizon=20 if horizon is None else horizon,
            rate=rate_limit,
            pressures=pressures,
            total=total_limit,
            flow=flow_limit,
            as_json=as_json,
        )
        return
    if wanted is Wanted.force:
        estimate = load_of(block)
        estimate.save(out)
        if as_json:
            print_json({"file": str(out), "inputs": [channel.name for channel in estimate.inputs]})
            return
        say(f"{_listed(estimate.outputs)} by {_listed(estimate.inputs)}, all measured.")
        say(f"Written: {out}")
        return
    feedforward = None if adaptive else ForceFeedforward.of(block)
    if feedforward is not None:
        feedforward.save(out)
        if as_json:
            print_json({"file": str(out), "reachable": {}})
            return
        say("Pressure by force and length, in closed form; track it where length is imposed.")
        say(f"Written: {out}")
        return
    if not block.undoing and drives(block.outputs[0]) and not drives(block.inputs[0]):
        block.save(out)
        if as_json:
            print_json({"file": str(out), "reachable": {}})
            return
        say(f"It already gives {_listed(block.outputs)} by {_listed(block.inputs)}.")
        say(f"Written: {out}")
        return
    inverse = (
        learning(block, 60.0 if time is None else time, noise) if adaptive else block.inverse()
    )
    inverse.save(out)
    low, high = block.reachable()
    reachable = {
        channel.name: [float(a), float(b)]
        for channel, a, b in zip(block.outputs, low, high, strict=True)
    }
    if not np.isfinite([*low, *high]).all():
        reachable = {}
    if as_json:
        print_json({"file": str(out), "reachable": reachable})
        return
    if not reachable:
        others = "the other muscles" if len(block.outputs) > 1 else "its load and past"
        say(f"What can be reached depends on {others}; track says what was clipped.")
    for channel in block.outputs if reachable else ():
        a, b = reachable[channel.name]
        say(
            f"Reachable whatever happened before: {channel.name} {numeral(a, 5)} to {numeral(b, 5)} "
            f"{channel.unit}; references beyond are clipped."
        )
    if adaptive:
        say(f"Learns from {_listed(inverse.inputs[-len(block.outputs) :])}, one a step.")
        say(f"Next: mckibben track {out} --plant {model} --reference FILE, or --rig NAME.")
    say(f"Written: {out}")


def _learned(
    block: Block, recordings: list[Recording], seed: int, out: Path, as_json: bool
) -> None:
    """Write the inverse with a learned network, and say how near to the recorded inputs it is."""
    import numpy as np

    from mckibben.cli.output import progress_bar
    from mckibben.estimators.coupled.fuzzy import Search, printed_swarm
    from mckibben.estimators.coupled.sdchm import SDCHMEstimator, learned_inverse
    from mckibben.estimators.optimisers.tracker import Tracker
    from mckibben.metrics import rmse

    search = Search("pso", SDCHMEstimator.search_samples, printed_swarm(), seed)
    with progress_bar("learning the inverse") as tell:
        tracker = Tracker(progress=lambda share, best: tell(share, f"best {numeral(best)}"))
        inverse = learned_inverse(block, recordings, search=search, tracker=tracker)
        tracker.end()
    inverse.save(out)
    found = [inverse.simulate(one) for one in recordings]
    errors = {
        c.name: rmse(
            *(np.concatenate([one[c.name] for one in some]) for some in (recordings, found))
        )
        for c in inverse.outputs
    }
    if as_json:
        print_json({"file": str(out), "rmse": errors})
        return
    for channel in inverse.outputs:
        say(
            f"{channel.name}: RMSE {numeral(errors[channel.name], 4)} {channel.unit} on the recordings."
        )
    say(f"Written: {out}")


def _listed(channels: Sequence[Channel]) -> str:
    return ", ".join(f"{channel.name} [{channel.unit}]" for channel in channels)
