"""What mckibben invert writes with limits: a compensator that looks ahead."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from mckibben.cli.output import print_json, say
from mckibben.errors import ModelError

if TYPE_CHECKING:
    from mckibben.blocks.base import Block


def write_predictive(
    inverse: Block,
    out: Path,
    *,
    horizon: int,
    rate: float | None,
    pressures: tuple[float, float] | None,
    total: float | None,
    flow: float | None,
    as_json: bool,
) -> None:
    """Write a predictive compensator around an inverse, and say what it needs."""
    from mckibben.blocks.predictive import MOST, Predictive

    for name, value in (("rate-limit", rate), ("total-limit", total), ("flow-limit", flow)):
        if value is not None and not 0 < value <= MOST:
            raise ModelError(
                f"--{name} is {value}", remedy=f"give a positive number up to {MOST:g}"
            )
    if not 1 <= horizon <= 200:
        raise ModelError(f"--horizon is {horizon}", remedy="give 1 to 200 samples")
    if pressures is not None and not float("-inf") < pressures[0] < pressures[1] < float("inf"):
        raise ModelError(f"--pressures are {pressures}", remedy="give the lowest, then the highest")
    block = Predictive(
        inverse,
        horizon=horizon,
        rate_limit=rate,
        pressure_range=pressures,
        total_limit=total,
        flow_limit=flow,
    )
    block.save(out)
    if as_json:
        print_json({"file": str(out), "samples_ahead": block.samples_ahead})
        return
    if rate is None and flow is None and total is None:
        say("Only pressures are limited: looking ahead gains little. Give --rate-limit BAR/S.")
    say(f"Give it every reference {block.samples_ahead} samples before it is due; track does.")
    say(f"Written: {out}")
