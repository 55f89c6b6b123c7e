"""Design the next experiment: random motion within limits, and segments that close data gaps.

The motion starts and ends at rest.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from mckibben.cli.output import say, show
from mckibben.cli.parameters import Argument, Force, Json, command
from mckibben.options import Option, PlanOptions, ReadOptions


@command
def plan(
    options: PlanOptions,
    reading: ReadOptions,
    out: Annotated[Path, Option("File to write (.csv).", "FILE", "-o")],
    files: Annotated[
        tuple[Path, ...], Argument("[FILES]...", "What has been recorded; also of a plan before.")
    ] = (),
    force: Force = False,
    as_json: Json = False,
) -> None:
    from mckibben import workflow
    from mckibben.report import results, text

    found = workflow.plan(files, options, reading=reading, out=out, force=force)
    about = {"file": str(out)} | found.to_dict()
    show(about, lambda: text.lines(results.plan(found)), as_json, written=[out])
    if options.rig is not None and not as_json:
        say(f"Record it with: mckibben rig run {options.rig} --inputs {out} -o recorded.csv")
