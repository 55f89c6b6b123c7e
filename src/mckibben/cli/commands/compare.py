"""Fit models, choose one by cross-validation, and test it on separate data. Errors are free-run.

A folder includes all recordings in it. Recordings of several muscles (pressure_1 ...,
displacement_1 ...) are fitted by models that couple them; with --load force, the load is an input.
Ctrl-C stops; with -o, the same command resumes.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from mckibben.cli.output import show
from mckibben.cli.parameters import Files, Force, Json, Quick, Test, chosen_models, command
from mckibben.cli.stopping import stop_short, stoppable
from mckibben.options import CompareOptions, Option, ReadOptions

NO_MODEL = 1
"""Exit code if no model could be fitted."""


@command
def compare(
    files: Files,
    options: CompareOptions,
    reading: ReadOptions,
    test: Test = (),
    quick: Quick = False,
    out: Annotated[
        Path | None, Option("Folder for leaderboard.json and .csv.", "DIR", "-o")
    ] = None,
    force: Force = False,
    as_json: Json = False,
) -> int:
    from mckibben import workflow
    from mckibben.report import results, text

    chosen = replace(options, models=chosen_models(options.models, quick))
    with stoppable(out):
        board = workflow.compare(
            files, test, chosen, reading=reading, out=out, force=force, progress=True
        )
        stop_short(board, out)
    written = [out / "leaderboard.json", out / "leaderboard.csv"] if out else []
    show(board, lambda: text.lines(results.leaderboard(board)), as_json, board.notes, written)
    failed = sum(map(len, board.failures.values()))
    return NO_MODEL if board.rows and failed == len(board.rows) else 0
