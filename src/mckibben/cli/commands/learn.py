"""Learn from repetitions of one motion: correct the reference of a compensator by their errors.

Record the motion with the compensator, with columns of the reference (reference_displacement) and of the
measured output; learn; run what was written; and so on, each time with all recordings, in order. The
command track does this on a virtual rig or a model, with --repetitions.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from mckibben.cli.output import show
from mckibben.cli.parameters import Argument, Files, Force, Json, command
from mckibben.options import LearnOptions, Option, ReadOptions


@command
def learn(
    compensator: Annotated[Path, Argument("COMPENSATOR", "That of the first recording (JSON).")],
    files: Files,
    options: LearnOptions,
    reading: ReadOptions,
    out: Annotated[Path, Option("Compensator to run next (JSON).", "FILE", "-o")],
    force: Force = False,
    as_json: Json = False,
) -> None:
    from mckibben import workflow
    from mckibben.report import results, text

    found = workflow.learn(compensator, files, options, reading=reading, out=out, force=force)
    show(found, lambda: text.lines(results.learned(found)), as_json, written=[out])
