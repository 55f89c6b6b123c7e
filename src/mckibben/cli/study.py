"""mckibben study: the main job, from recordings to a report."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mckibben.cli.leaderboards import told
from mckibben.cli.options import (
    AllowShared,
    Columns,
    Dask,
    Files,
    Force,
    GapPolicy,
    Gaps,
    Input,
    Jobs,
    Json,
    Models,
    Output,
    Quick,
    Rate,
    Reading,
    Resample,
    Samples,
    Seed,
    Settings,
    Test,
    Units,
    chosen_models,
    settings_of_all,
)
from mckibben.cli.output import figure, make_folder, print_json, progress_bar, say
from mckibben.cli.stopping import forget_kept, stop_short, stoppable
from mckibben.errors import DataError

if TYPE_CHECKING:
    from mckibben.comparison.results import Study


def study(
    files: Files,
    test: Test = None,
    input: Input = "pressure",  # noqa: A002
    output: Output = "displacement",
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for the results.")] = Path(
        "study"
    ),
    models: Models = "all",
    quick: Quick = False,
    settings: Settings = None,
    rig: Annotated[
        str | None, typer.Option("--rig", help="Several muscles: rig to close a loop on.")
    ] = None,
    load: Annotated[
        str | None,
        typer.Option(
            "--load", metavar="CHANNEL", help="Load that varies: one model for all loads."
        ),
    ] = None,
    seed: Seed = 0,
    jobs: Jobs = None,
    dask: Dask = None,
    column: Columns = None,
    unit: Units = None,
    rate: Rate = None,
    gaps: GapPolicy = Gaps.ERROR,
    resample: Resample = None,
    samples: Samples = None,
    allow_shared: AllowShared = False,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Say what the muscle does, choose a model by cross-validation, test, invert, and write a report.

    Results are written as they come. Ctrl-C stops at once, and the same command goes on from there.

    A folder stands for all recordings in it. Recordings of several muscles (pressure_1 ...,
    displacement_1 ...) get models that couple them, and a closed loop on a virtual rig. With --load
    force, models that are told the load are ranked against one model for every load.
    """
    from mckibben import registry, workers
    from mckibben.files.folders import expanded
    from mckibben.outputs import Results
    from mckibben.report.results_folder import study_files

    folder = make_folder(out)
    with stoppable(folder):
        if jobs != 1 and dask is None:
            workers.prepare()
        chosen = chosen_models(models, quick)
        reading = Reading(column, unit, rate, gaps, resample)
        train, validation, tests = expanded(files, test or [])
        kept = Results(folder, inputs=[*train, *validation, *tests], force=force)
        names = registry.names("estimators") if isinstance(chosen, str) else chosen
        kept.claim(study_files(names))
        if load is not None or _of_muscles(reading, train):
            from mckibben.cli.study_muscles import study_muscles

            runs, checks, held_back = (
                reading.read(some, None, informative=False) for some in (train, validation, tests)
            )
            study_muscles(
                *(runs, checks, held_back, kept, chosen, settings, rig, load, seed, jobs),
                *(as_json, allow_shared),
            )
            return
        if rig is not None:
            raise DataError("--rig is for recordings of several muscles", remedy="leave it out")
        given = settings_of_all(settings, chosen)
        from mckibben.recording import notes_by_file

        recordings = reading.read([*train, *validation], [input, output])
        held_out = reading.read(tests, [input, output])
        notes = notes_by_file([*recordings, *held_out])

        from mckibben.comparison.cluster import on_cluster
        from mckibben.comparison.studying import study as find
        from mckibben.report import StudyFolder

        results = StudyFolder(kept)

        def found(so_far: Study) -> None:
            results.take(so_far)
            if not so_far.leaderboard.rows and not as_json:
                _say(so_far, folder)

        with on_cluster(dask), progress_bar("studying", plainly=True) as tell:
            done = find(
                recordings,
                held_out,
                input=input,
                output=output,
                models=chosen,
                settings=given,
                seed=seed,
                jobs=jobs,
                most_samples=samples,
                allow_shared=allow_shared,
                folder=folder,
                clear=False,
                progress=told(tell, "inverting and drawing"),
                found=found,
            )
        if done.leaderboard.stopped:
            results.take(done, last=True)
        if as_json:
            print_json(_described(done, folder) | {"notes": notes})
        else:
            _conclude(done, folder)
        stop_short(done.leaderboard)
        forget_kept(folder)


def _say(study: Study, folder: Path) -> None:
    """Print what the muscle does, before any model is fitted."""
    for sentence in study.characterization.sentences:
        say(sentence)
    say(f"Drawn: {folder / 'report.html'}, which grows with every model fitted.\n", flush=True)


def _conclude(study: Study, folder: Path) -> None:
    from mckibben.cli.leaderboards import print_leaderboard

    print_leaderboard(study.leaderboard)
    say()
    if study.inverse is not None:
        low, high = study.inverse.reachable
        say(
            f"Inverse of {study.inverse.model}: follows any reference from {figure(low, 4)} to "
            f"{figure(high, 4)} {study.leaderboard.unit} on the model itself, largest error "
            f"{study.inverse.error:.1e} of that range."
        )
    elif study.leaderboard.not_recommended:
        say("No inverse is written, since no model is recommended.")
    elif not study.leaderboard.stopped:
        say("No model here has an inverse.")
    say(
        f"Written: {folder / 'report.html'}, leaderboard.csv, leaderboard.json, models"
        + ("" if study.inverse is None else ", inverse.json")
    )


def _described(study: Study, folder: Path) -> dict[str, Any]:
    inverse = study.inverse
    return {
        "folder": str(folder),
        "characterization": study.characterization.to_dict(),
        "leaderboard": study.leaderboard.to_dict(),
        "inverse": None
        if inverse is None
        else {
            "model": inverse.model,
            "error": inverse.error,
            "reachable": list(inverse.reachable),
        },
    }


def _of_muscles(reading: Reading, files: list[Path]) -> bool:
    """Tell whether the first file is of several muscles; what is wrong with it is said later."""
    from mckibben.cli.study_muscles import is_of_muscles
    from mckibben.errors import MckibbenError

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return is_of_muscles(reading.read(files[:1], None, informative=False))
        except (MckibbenError, OSError):
            return False
