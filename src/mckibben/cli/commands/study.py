"""Characterize a muscle, choose a model by cross-validation, test and invert it, and write a report.

A folder includes all recordings in it. Recordings of several muscles (pressure_1 ...,
displacement_1 ...) get models that couple them, and a closed loop on a virtual rig. With --load
force, models that are given the load are ranked against one model for every load.

With --compensator or --model, recordings with a reference (reference_displacement, setpoint, ...)
are logs of a loop: the report states the predicted and the achieved error, what part is due to model,
actuator, delay, noise, drift and limits, and the same kind of model refitted (refit.json).

Ctrl-C stops at once, and the same command goes on from there.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from mckibben.cli.output import say, show
from mckibben.cli.parameters import (
    Files,
    Force,
    Json,
    Quick,
    Test,
    chosen_models,
    command,
    repeated,
)
from mckibben.cli.stopping import stop_short, stoppable
from mckibben.options import Option, ReadOptions, StudyOptions

if TYPE_CHECKING:
    from mckibben.studying.study import Study


@command
def study(
    files: Files,
    options: StudyOptions,
    reading: ReadOptions,
    test: Test = (),
    quick: Quick = False,
    out: Annotated[Path, Option("Folder for the results.", "DIR", "-o")] = Path("study"),
    force: Force = False,
    as_json: Json = False,
) -> None:
    from mckibben import workflow
    from mckibben.outputs import unfinished
    from mckibben.recording import notes_by_file
    from mckibben.report import results, text

    def begun(so_far: Study) -> None:
        if not so_far.leaderboard.rows and not as_json:
            for line in text.lines(results.study_started(so_far)):
                say(line)
            live = unfinished(out) / "report.html"
            say(f"Report so far, updated with every model: {live}\n", flush=True)

    with stoppable(out):
        found = workflow.study(
            files,
            test,
            replace(options, models=chosen_models(options.models, quick)),
            reading=reading,
            out=out,
            force=force,
            command=repeated(),
            progress=True,
            found=begun,
        )
        stop_short(found.leaderboard, out)
    about = {"folder": str(out)} | found.to_dict()
    about["notes"] = notes_by_file([*found.train, *found.test])
    show(
        about if as_json else found,
        lambda: text.lines(results.study(found)),
        as_json,
        found.leaderboard.notes,
        written=[out / "report.html"],
    )
