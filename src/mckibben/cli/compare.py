"""mckibben compare: models chosen and tested on recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

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
from mckibben.cli.output import make_folder, print_json, progress_bar, say
from mckibben.cli.stopping import forget_kept, stop_short, stoppable


def compare(
    files: Files,
    test: Test = None,
    input: Input = "pressure",  # noqa: A002
    output: Output = "displacement",
    models: Models = "all",
    quick: Quick = False,
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
    samples: Samples = None,
    allow_shared: AllowShared = False,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Fit models, choose by cross-validation, test on data used for neither; all free-running.

    A folder stands for all recordings in it. Ctrl-C stops at once; with -o what is finished is kept, and
    the same command goes on from there.
    """
    from mckibben import workers
    from mckibben.files.folders import expanded
    from mckibben.outputs import Results
    from mckibben.report.results_folder import LEADERBOARD, write_leaderboard

    folder = None if out is None else make_folder(out)
    with stoppable(folder):
        if jobs != 1 and dask is None:
            workers.prepare()
        chosen = chosen_models(models, quick)
        given = settings_of_all(settings, chosen)
        reading = Reading(column, unit, rate, gaps, resample)
        fitted, checked, held_back = expanded(files, test or [])
        results = None
        if folder is not None:
            results = Results(folder, inputs=[*fitted, *checked, *held_back], force=force)
            results.claim(LEADERBOARD)
        train = reading.read([*fitted, *checked], [input, output])
        tests = reading.read(held_back, [input, output])
        from mckibben.cli.leaderboards import print_leaderboard
        from mckibben.comparison.cluster import on_cluster
        from mckibben.comparison.ranking import compare as rank

        if results is not None:
            results.clear()
        with on_cluster(dask), progress_bar("comparing", plainly=True) as tell:
            board = rank(
                train,
                tests,
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
                progress=told(tell),
                found=None if results is None else lambda board: write_leaderboard(board, results),
            )
        if results is not None:
            write_leaderboard(board, results)
        if as_json:
            print_json(board.to_dict())
        else:
            print_leaderboard(board)
            if folder is not None:
                say(f"Written: {folder / 'leaderboard.json'}, {folder / 'leaderboard.csv'}")
        stop_short(board)
        forget_kept(folder)
