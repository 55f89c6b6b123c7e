"""Compare all models on all sets of recordings in a folder, by fixed splits, on one page.

The table [split] in a set's channels.toml states what is fitted and what is tested; without it the
last quarter is tested. Ctrl-C stops at once, and the same command goes on from there.

Models of any other software enter by their predictions: --splits writes what each task trains and tests
on, --score prints both metrics of predictions, in lines for docs/measured/leaderboard.csv.
"""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from mckibben.cli.output import say, show
from mckibben.cli.parameters import Argument, Force, Json, Quick, chosen_models, command, repeated
from mckibben.cli.stopping import stoppable
from mckibben.options import Jobs, Option, Seed, names
from mckibben.system.progress import telling

if TYPE_CHECKING:
    from mckibben.measured.running import Outcome


@command
def measured(
    folder: Annotated[
        Path,
        Argument("FOLDER", "A folder for every set of recordings, each with its channels.toml."),
    ],
    out: Annotated[Path, Option("Folder for the page and measured.csv.", "DIR", "-o")] = Path(
        "measured"
    ),
    only: Annotated[tuple[str, ...], Option("A set's folder; repeatable.", "SET")] = (),
    models: Annotated[
        str | tuple[str, ...], Option("Models by short name.", "all|quick|NAME,...", parse=names)
    ] = "all",
    quick: Quick = False,
    splits: Annotated[
        Path | None, Option("Only write what each task trains and tests on, to DIR.", "DIR")
    ] = None,
    score: Annotated[
        tuple[Path, ...], Option("Only score a CSV of predictions; repeatable.", "FILE")
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
        scored = [one for file in score for one in entries(file, sets)]
        lines = [HEAD] * bool(scored) + [one.line() for one in scored]
        show([asdict(one) for one in scored], lambda: lines, as_json, written=[splits])
        return

    def done(one: Outcome) -> None:
        if not as_json:
            say(f"{one.label}: {one.failed or (words.chosen(one.board) if one.board else '')}")

    with stoppable(out), telling(True, "measured", lines=True) as tell:
        found = measure(
            folder,
            out,
            only=only,
            models=chosen_models(models, quick),
            seed=seed,
            jobs=jobs,
            force=force,
            command=repeated(),
            progress=tell,
            found=done,
        )
    written = [out / name for name in FILES]
    show({one.label: one.to_dict() for one in found}, list, as_json, written=written)
    if all(one.failed for one in found):
        raise DataError(
            "nothing could be compared", file=folder, remedy=f"see the reasons in {written[0]}"
        )
