"""mckibben study: the main job, from recordings to a report."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mckibben.cli.options import (
    Columns,
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
    seed: Seed = 0,
    jobs: Jobs = None,
    column: Columns = None,
    unit: Units = None,
    rate: Rate = None,
    gaps: GapPolicy = Gaps.ERROR,
    resample: Resample = None,
    as_json: Json = False,
) -> None:
    """Say what the muscle does, rank every model, invert the best, and write a report."""
    import warnings

    from mckibben.errors import DataWarning

    chosen = chosen_models(models)
    given = settings_of_all(settings, chosen)
    reading = Reading(column, unit, rate, gaps, resample)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", DataWarning)
        train = reading.read(files, [input, output])
        tests = reading.read(test or [], [input, output])
    notes = [str(warning.message) for warning in caught]
    for note in notes:
        typer.echo(f"Note: {note}", err=True)
    folder = make_folder(out)

    from mckibben.cli.leaderboards import print_leaderboard, write_leaderboard
    from mckibben.comparison.studying import study as find
    from mckibben.report import write_report

    with progress_bar("studying") as tell:
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
