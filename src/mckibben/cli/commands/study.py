"""Characterize a muscle, choose a model by cross-validation, test and invert it, and write a report.

A folder includes all recordings in it. Recordings of several muscles (pressure_1 ...,
displacement_1 ...) are fitted by models that couple them; a virtual rig then simulates the closed loop.
With --load force, models with the load as input are ranked.

With --compensator or --model, recordings with a reference (reference_displacement, setpoint, ...)
are logs of a closed loop: the report shows the predicted and the measured error, its parts due to model,
actuator, delay, noise, drift and limits, and a refit of the model (refit.json).

Ctrl-C stops; the same command resumes.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from mckibben.cli.output import say, show
from mckibben.cli.parameters import (
    Files,
    Force,
    Json,
    Test,
    command,
    typed_command,
)
from mckibben.cli.stopping import stop_short, stoppable
from mckibben.options import Option, ReadOptions, StudyOptions
from mckibben.printing import printable

if TYPE_CHECKING:
    from mckibben.studying.study import Study


@command
def study(
    files: Files,
    options: StudyOptions,
    reading: ReadOptions,
    test: Test = (),
    out: Annotated[Path, Option("Folder for the results.", "DIR", "-o")] = Path("study"),
    force: Force = False,
    as_json: Json = False,
) -> None:
    from mckibben import workflow
    from mckibben.files.notices import observed
    from mckibben.outputs import unfinished
    from mckibben.recording import notes_by_file
    from mckibben.report import results, text

    def on_update(so_far: Study) -> None:
        if not so_far.leaderboard.rows and not as_json:
            for line in text.lines(results.study_started(so_far)):
                say(line)
            live = unfinished(out) / "report.html"
            say(f"Report so far, updated with every model: {printable(live)}\n", flush=True)

    with stoppable(out), observed() as read:
        result = workflow.study(
            files,
            test,
            options,
            reading=reading,
            out=out,
            force=force,
            command=typed_command(),
            progress=True,
            found=on_update,
        )
        stop_short(result, out)
    content = {"folder": str(out)} | result.to_dict()
    content["notes"] = notes_by_file([*result.train, *result.test])
    show(
        content if as_json else result,
        lambda: text.lines_of_result(result),
        as_json,
        result.leaderboard.notes,
        written=[out / "report.html"],
        read=read,
    )
