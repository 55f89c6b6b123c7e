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
        from mckibben.recording import notes_by_file
        from mckibben.report import StudyFolder
        from mckibben.report.commands import Typed
        from mckibben.studying.log import REFERENCE
        from mckibben.studying.study import study as find

        wished = any(name.startswith(REFERENCE) for run in begun.every for name in run.channels)
        if wished and not given and not asked.as_json:
            say(
                "A reference is recorded: --compensator inverse.json, what ran, tells why it was missed."
            )
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
    from mckibben.report.words import gap_run, gap_sentence
    from mckibben.studying.refitting import Refit

    if study.characterization is not None:
        for sentence in study.characterization.sentences:
            say(sentence)
    for gap in study.untold:
        say(f"- {gap_sentence(gap)} {gap_run(gap)}")
    if study.review is not None:
        say()
        say(str(study.review))
        if isinstance(study.review.refit, Refit):
            say(f"Written: {folder / 'refit.json'}")
            if study.review.refit.recommended:
                say(f"Next: mckibben invert {folder / 'refit.json'} -o inverse2.json")
        say()
    say(f"Drawn: {folder / 'report.html'}, which grows with every model fitted.\n", flush=True)


def _conclude(study: Study, folder: Path) -> None:
    from mckibben.report.answers import answers
    from mckibben.report.wording import another_inverted

    print_leaderboard(study.leaderboard)
    say()
    for question, answer in answers(study):
        say(f"{question} {answer[0]}")
    if another := another_inverted(study):
        say(f"{another}.")
    check = study.inverse
    if check is not None and check.reachable is not None:
        low, high = check.reachable
        say(
            f"Inverse of {check.model}: follows any reference from {numeral(low, 4)} to "
            f"{numeral(high, 4)} {study.leaderboard.unit} on the model itself, largest error "
            f"{check.error:.1e} of that range."
        )
    elif check is not None:
        tested = study.test[0].name
        followed = f"what it makes of {study.input} in {tested}" if check.own else tested
        say(
            f"Inverse of {check.model}: follows {followed} on the model itself, largest "
            f"error {numeral(100 * check.error, 2)} % of its range."
        )
    elif study.leaderboard.not_recommended:
        say("No inverse is written, since no model is recommended.")
    elif not study.leaderboard.stopped:
        say("No model here has an inverse.")
    if check is not None and check.uncompensated_error is not None:
        say(
            f"Without compensation, {check.given} read off one slow rise, that is "
            f"{numeral(100 * check.uncompensated_error, 2)} %. On the muscle, the model's comes on top."
        )
    if study.not_looped:
        say(f"No loop was closed: {study.not_looped}")
    for name, tracked in study.loops.items():
        errors = ", ".join(numeral(error, 2) for error in tracked.rmse.values())
        say(f"Following a recorded motion on {study.plant}: {name}, RMSE {errors} mm.")
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
