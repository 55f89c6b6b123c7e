"""mckibben study: the main job, from recordings to a report."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mckibben.cli.comparing import Asked
from mckibben.cli.grouping import spread, typed
from mckibben.cli.leaderboards import print_leaderboard, told
from mckibben.cli.options import Files, Reading
from mckibben.cli.output import make_folder, print_json, say
from mckibben.cli.stopping import forget_kept, stop_short, stoppable
from mckibben.numerals import numeral
from mckibben.system.locks import alone

if TYPE_CHECKING:
    from mckibben.studying.study import Study


@spread
def study(
    files: Files,
    asked: Asked,
    reading: Reading,
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for the results.")] = Path(
        "study"
    ),
    rig: Annotated[
        str | None, typer.Option("--rig", help="Several muscles: rig to close a loop on.")
    ] = None,
    compensator: Annotated[
        Path | None,
        typer.Option(help="A loop's log: the inverse that ran, to say why it was off."),
    ] = None,
    model: Annotated[
        Path | None, typer.Option(help="A loop's log: the model that ran, or its inverse did.")
    ] = None,
) -> None:
    """Say what the muscle does, choose a model by cross-validation, test, invert, and write a report.

    Results are written as they come. Ctrl-C stops at once, and the same command goes on from there.

    A folder stands for all recordings in it. Recordings of several muscles (pressure_1 ...,
    displacement_1 ...) get models that couple them, and a closed loop on a virtual rig. With --load
    force, models that are told the load are ranked against one model for every load.

    With --compensator or --model, recordings with a reference (reference_displacement, setpoint, ...)
    are logs of a loop: what error was predicted, what was achieved, and what of it is due to model,
    actuator, delay, noise, drift and limits; and the same kind of model refitted to them (refit.json).
    """
    from mckibben.blocks.saving import load as saved
    from mckibben.report.results_folder import study_files

    folder = make_folder(out)
    with alone(folder), stoppable(folder):
        ran = [None if path is None else saved(path) for path in (model, compensator)]
        given = [path for path in (model, compensator) if path is not None]
        begun = asked.begin(files, reading, folder, study_files, beside=given)
        from mckibben.diagnosis.review import REFERENCE
        from mckibben.recording import notes_by_file
        from mckibben.report import StudyFolder
        from mckibben.report.commands import Typed
        from mckibben.studying.study import study as find

        wished = any(name.startswith(REFERENCE) for run in begun.every for name in run.channels)
        if wished and not given and not asked.as_json:
            say("A reference is recorded: --compensator inverse.json, shows why it was missed.")
        results = StudyFolder(
            begun.results or folder,
            Typed(
                study=[
                    *("study", *map(str, files), *typed(asked), *typed(reading), "-o", str(out)),
                    *([] if rig is None else ["--rig", rig]),
                    *([] if compensator is None else ["--compensator", str(compensator)]),
                    *([] if model is None else ["--model", str(model)]),
                ],
                reading=typed(reading),
            ),
        )

        def found(so_far: Study) -> None:
            results.take(so_far)
            if not so_far.leaderboard.rows and not asked.as_json:
                _say(so_far, folder)

        with asked.telling("studying") as tell:
            done = find(
                *begun.recordings,
                **begun.given,
                model=ran[0],
                compensator=ran[1],
                rig=rig,
                progress=told(tell, "inverting and drawing"),
                found=found,
            )
        if done.leaderboard.stopped:
            results.take(done, last=True)
        if asked.as_json:
            notes = {"notes": notes_by_file(begun.every)}
            print_json({"folder": str(folder)} | done.to_dict() | notes)
        else:
            _conclude(done, folder)
        stop_short(done.leaderboard)
        forget_kept(folder)


def _say(study: Study, folder: Path) -> None:
    """Print what the muscle and a loop do, before any model is fitted."""
    from mckibben.diagnosis.refit import Refit
    from mckibben.report import words

    if study.characterization is not None:
        for sentence in words.characterization_sentences(study.characterization):
            say(sentence)
    if study.review is not None:
        say()
        for sentence in words.reviewed(study.review):
            say(sentence)
        if isinstance(study.review.refit, Refit):
            say(f"Written: {folder / 'refit.json'}")
            if study.review.refit.recommended:
                say(f"Next: mckibben invert {folder / 'refit.json'} -o inverse2.json")
        say()
    say(f"Report: {folder / 'report.html'}, updated with every model.\n", flush=True)


def _conclude(study: Study, folder: Path) -> None:
    from mckibben.report import words

    print_leaderboard(study.leaderboard)
    say()
    for question, answer in words.answers(study):
        say(f"{question} {answer}")
    if said := words.inverse(study):
        say(said)
    if study.not_looped:
        say(f"No loop was closed: {study.not_looped}")
    for name, tracked in study.loops.items():
        errors = ", ".join(numeral(error, 2) for error in tracked.rmse.values())
        say(f"{name} on {study.plant}: RMSE {errors} {study.leaderboard.unit}.")
    best = study.leaderboard.best
    written = [
        str(folder / "report.html"),
        *("leaderboard.csv", "leaderboard.json", "models"),
        *([] if best is None else ["validation.json"]),
        *([] if best is None or best.banded is None else ["banded.json"]),
        *([] if study.inverse is None else ["inverse.json"]),
        *([] if study.review is None else ["review.json"]),
    ]
    say(f"Written: {', '.join(written)}")
