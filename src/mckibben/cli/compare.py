"""mckibben compare: models ranked on recordings."""

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
from mckibben.cli.output import make_folder, print_json, progress_bar


def compare(
    files: Files,
    test: Test = None,
    input: Input = "pressure",  # noqa: A002
    output: Output = "displacement",
    models: Models = "all",
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="Folder for leaderboard.json and .csv.")
    ] = None,
    settings: Settings = None,
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
    """Fit and rank models: cross-validated, tested on data not used to fit, free-running."""
    chosen = chosen_models(models)
    given = settings_of_all(settings, chosen)
    reading = Reading(column, unit, rate, gaps, resample)
    train = reading.read(files, [input, output])
    tests = reading.read(test or [], [input, output])
    from mckibben.cli.leaderboards import print_leaderboard, write_leaderboard
    from mckibben.comparison.cluster import on_cluster
    from mckibben.comparison.ranking import compare as rank

    folder = None if out is None else make_folder(out)
    with on_cluster(dask), progress_bar("comparing") as tell:
        board = rank(
            train,
            tests,
            input=input,
            output=output,
            models=chosen,
            settings=given,
            seed=seed,
            jobs=jobs,
            progress=lambda model, share: tell(share, f"{model} done"),
        )
    if folder is not None:
        write_leaderboard(board, folder)
    if as_json:
        print_json(board.to_dict())
        return
    print_leaderboard(board)
    if folder is not None:
        print(f"Written: {folder / 'leaderboard.json'}, {folder / 'leaderboard.csv'}")
