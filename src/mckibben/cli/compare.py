"""mckibben compare: models chosen and tested on recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mckibben.cli.comparing import Asked
from mckibben.cli.grouping import spread
from mckibben.cli.leaderboards import print_leaderboard, told
from mckibben.cli.options import Files, Reading
from mckibben.cli.output import make_folder, print_json, say
from mckibben.cli.stopping import demand_a_model, forget_kept, stop_short, stoppable
from mckibben.system.locks import alone


@spread
def compare(
    files: Files,
    asked: Asked,
    reading: Reading,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="Folder for leaderboard.json and .csv.")
    ] = None,
) -> None:
    """Fit models, choose by cross-validation, test on data used for neither; all free-running.

    A folder stands for all recordings in it. Recordings of several muscles (pressure_1 ...,
    displacement_1 ...) get models that couple them, and with --load force models are told the load.
    Ctrl-C stops at once; with -o what is finished is kept, and
    the same command goes on from there.
    """
    from mckibben.report.results_folder import LEADERBOARD, write_leaderboard

    folder = None if out is None else make_folder(out)
    with alone(folder), stoppable(folder):
        begun = asked.begin(files, reading, folder, lambda models: LEADERBOARD)
        from mckibben.comparison.leaderboard import Leaderboard
        from mckibben.comparison.ranking import compare as rank

        def keep(board: Leaderboard) -> None:
            if begun.results is not None:
                write_leaderboard(board, begun.results)

        if begun.results is not None:
            begun.results.clear()
        with asked.telling("comparing") as tell:
            board = rank(*begun.recordings, **begun.given, progress=told(tell), found=keep)
        keep(board)
        if asked.as_json:
            print_json(board.to_dict())
        else:
            print_leaderboard(board)
            if folder is not None:
                say(f"Written: {folder / 'leaderboard.json'}, {folder / 'leaderboard.csv'}")
        stop_short(board)
        forget_kept(folder)
        demand_a_model(board)
