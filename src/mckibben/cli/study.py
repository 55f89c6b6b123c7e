"""mckibben study: the main job, from recordings to a report."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mckibben.cli.options import (
    Columns,
    Dask,
    Files,
    GapPolicy,
    Gaps,
    Input,
    Jobs,
    Json,
    Models,
    Output,
    Rate,
    Reading,
    Resample,
    Seed,
    Settings,
    Test,
    Units,
    chosen_models,
    settings_of_all,
)
from mckibben.cli.output import figure, make_folder, print_json, progress_bar


def study(
    files: Files,
    test: Test = None,
    input: Input = "pressure",  # noqa: A002
    output: Output = "displacement",
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for the results.")] = Path(
        "study"
    ),
    models: Models = "all",
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
    as_json: Json = False,
) -> None:
    """Say what the muscle does, rank every model, invert the best, and write a report.

    A folder stands for all recordings in it. Recordings of several muscles (pressure_1 ...,
    displacement_1 ...) get models that couple them, and a closed loop on a virtual rig. With --load
    force, models that are told the load are ranked against one model for every load.
    """
    import warnings

    from mckibben.errors import DataError, DataWarning

    chosen = chosen_models(models)
    reading = Reading(column, unit, rate, gaps, resample)
    files, validation, held_back = _expanded(files, test or [])
    if load is not None or _of_muscles(reading, files):
        from mckibben.cli.study_muscles import study_muscles

        runs, checks, tests = (
            reading.read(some, None, informative=False) for some in (files, validation, held_back)
        )
        study_muscles(runs, checks, tests, out, chosen, settings, rig, load, seed, as_json)
        return
    if rig is not None:
        raise DataError("--rig is for recordings of several muscles", remedy="leave it out")
    files, test = [*files, *validation], held_back
    given = settings_of_all(settings, chosen)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", DataWarning)
        train = reading.read(files, [input, output])
        tests = reading.read(test or [], [input, output])
    notes = [str(warning.message) for warning in caught]
    for note in notes:
        typer.echo(f"Note: {note}", err=True)
    folder = make_folder(out)

    from mckibben.cli.leaderboards import print_leaderboard, write_leaderboard
    from mckibben.comparison.cluster import on_cluster
    from mckibben.comparison.studying import study as find
    from mckibben.report import write_report

    with on_cluster(dask), progress_bar("studying") as tell:
        found = find(
            train,
            tests,
            input=input,
            output=output,
            models=chosen,
            settings=given,
            seed=seed,
            jobs=jobs,
            progress=lambda model, share: tell(share, f"{model} done"),
            notes=notes,
        )
    board = found.leaderboard
    write_leaderboard(board, folder)
    (folder / "models").mkdir(exist_ok=True)
    for row in board.rows:
        if row.block is not None:
            row.block.save(folder / "models" / f"{row.model}.json")
    if found.inverse is not None:
        found.inverse.inverse.save(folder / "inverse.json")
    else:
        (folder / "inverse.json").unlink(missing_ok=True)
    write_report(found, folder / "report.html")
    if as_json:
        print_json(
            {
                "folder": str(folder),
                "characterization": found.characterization.to_dict(),
                "leaderboard": board.to_dict(),
                "inverse": None
                if found.inverse is None
                else {
                    "model": found.inverse.model,
                    "error": found.inverse.error,
                    "reachable": list(found.inverse.reachable),
                },
            }
        )
        return
    for sentence in found.characterization.sentences:
        print(sentence)
    print()
    print_leaderboard(board)
    print()
    if found.inverse is None:
        print("No model here has an inverse.")
    else:
        low, high = found.inverse.reachable
        print(
            f"Inverse of {found.inverse.model}: follows any reference from {figure(low, 4)} to "
            f"{figure(high, 4)} {board.unit} on the model itself, largest error "
            f"{found.inverse.error:.1e} of that range."
        )
    print(
        f"Written: {folder / 'report.html'}, leaderboard.csv, leaderboard.json, models, inverse.json"
    )


def _expanded(files: list[Path], test: list[Path]) -> tuple[list[Path], list[Path], list[Path]]:
    """Return files to fit, to validate and to test, folders replaced by what is in them."""
    from mckibben.cli.study_muscles import roles

    train: list[Path] = []
    validation: list[Path] = []
    tests: list[Path] = []
    for file in files:
        if not file.is_dir():
            train.append(file)
            continue
        by_role = roles(file)
        train += by_role.get("train", [])
        validation += by_role.get("validation", [])
        tests += by_role.get("test", [])
    for file in test:
        tests += (
            [path for paths in roles(file).values() for path in paths] if file.is_dir() else [file]
        )
    return train, validation, tests


def _of_muscles(reading: Reading, files: list[Path]) -> bool:
    """Tell whether the first file is of several muscles; what is wrong with it is said later."""
    import warnings

    from mckibben.cli.study_muscles import is_of_muscles
    from mckibben.errors import MckibbenError

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return is_of_muscles(reading.read(files[:1], None, informative=False))
        except (MckibbenError, OSError):
            return False
