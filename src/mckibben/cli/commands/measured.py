"""Compare all models on all data sets in a folder, with fixed splits, in one report.

The table [split] in a set's channels.toml defines the training and test data; without it the last
quarter is tested. After Ctrl-C, the same command resumes.

Models of other software are scored by their predictions: --splits writes the training and test data of
each task, and --score prints the metrics of predictions, as lines of docs/measured/leaderboard.csv.
"""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from mckibben.cli.output import say, show
from mckibben.cli.parameters import Force, Json, Quick, command, named_models, typed_command
from mckibben.cli.stopping import stoppable
from mckibben.options import Argument, Jobs, Option, Seed
from mckibben.parsers import names
from mckibben.system.progress import telling

if TYPE_CHECKING:
    from mckibben.measured.running import Outcome


@command
def measured(
    folder: Annotated[
        Path,
        Argument("FOLDER", "Folder of sets of recordings, each a folder with its channels.toml."),
    ],
    out: Annotated[Path, Option("Folder for the report and measured.csv.", "DIR", "-o")] = Path(
        "measured"
    ),
    only: Annotated[tuple[str, ...], Option("Name of a set's folder; repeatable.", "SET")] = (),
    models: Annotated[
        str | tuple[str, ...], Option("Models by short name.", "all|quick|NAME,...", parse=names)
    ] = "all",
    quick: Quick = False,
    splits: Annotated[
        Path | None, Option("Only write the training and test data of each task, to DIR.", "DIR")
    ] = None,
    score: Annotated[
        tuple[Path, ...], Option("Only score predictions in a CSV file; repeatable.", "FILE")
    ] = (),
    seed: Seed = 0,
    jobs: Jobs = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    from mckibben.errors import DataError
    from mckibben.measured.page import FILES, measure
    from mckibben.measured.scoring import HEAD, entries, write_splits
    from mckibben.measured.sets import chosen_in
    from mckibben.report import words

    if splits is not None or score:
        sets = chosen_in(folder, only)
        if splits is not None:
            write_splits(sets, splits)
        scores = [entry for file in score for entry in entries(file, sets)]
        lines = [HEAD, *(entry.line() for entry in scores)] if scores else []
        show([asdict(entry) for entry in scores], lambda: lines, as_json, written=[splits])
        return

    def report(outcome: Outcome) -> None:
        if not as_json:
            chosen = words.chosen(outcome.board) if outcome.board else ""
            say(f"{outcome.label}: {outcome.failed or chosen}")

    with stoppable(out), telling(True, "measured", lines=True) as progress:
        outcomes = measure(
            folder,
            out,
            only=only,
            models=named_models(models, quick),
            seed=seed,
            jobs=jobs,
            force=force,
            command=typed_command(),
            progress=progress,
            found=report,
        )
    written = [out / name for name in FILES]
    results = {outcome.label: outcome.to_dict() for outcome in outcomes}
    show(results, list, as_json, written=written)
    if all(outcome.failed for outcome in outcomes):
        raise DataError(
            "nothing could be compared", file=folder, remedy=f"see the reasons in {written[0]}"
        )
