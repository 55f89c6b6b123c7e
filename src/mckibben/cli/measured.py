"""mckibben measured: every model on folders of recordings, and one page."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mckibben.cli.options import Force, Jobs, Json, Models, Quick, Seed, chosen_models
from mckibben.cli.output import make_folder, print_json, progress_bar, say
from mckibben.cli.stopping import forget_kept, stoppable
from mckibben.report import words
from mckibben.system.locks import alone

if TYPE_CHECKING:
    from mckibben.measured.running import Outcome

PAGE, ROWS = "measured.md", "measured.csv"


def measured(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="FOLDER",
            help="A folder for every set of recordings, each with its channels.toml.",
        ),
    ],
    out: Annotated[
        Path, typer.Option("-o", "--out", help="Folder for measured.md and measured.csv.")
    ] = Path("measured"),
    only: Annotated[
        list[str] | None, typer.Option("--only", metavar="SET", help="A set's folder; repeatable.")
    ] = None,
    models: Models = "all",
    quick: Quick = False,
    seed: Seed = 0,
    jobs: Jobs = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Compare all models on all sets of recordings in a folder, by fixed splits, on one page.

    The table [split] in a set's channels.toml says what is fitted and what is tested; without it the
    last quarter is tested. Ctrl-C stops at once; what is finished is kept, and the same command goes on.
    """
    from mckibben.errors import DataError
    from mckibben.measured.page import page, table
    from mckibben.measured.running import outcomes
    from mckibben.measured.sets import sets_in
    from mckibben.outputs import Results
    from mckibben.system import workers

    sets = sets_in(folder)
    names = [one.name for one in sets]
    if unknown := [name for name in only or [] if name not in names]:
        raise DataError(
            f"there is no set {unknown[0]!r} in it",
            file=folder,
            remedy=f"use one of {', '.join(names)}",
        )
    asked = [one for one in sets if only is None or one.name in only]
    if out.resolve().is_relative_to(folder.resolve()):
        raise DataError(
            f"it is inside {folder}, where the next run would read results as recordings",
            file=out,
            remedy="give a folder elsewhere with -o",
        )
    target = make_folder(out)
    if jobs != 1:
        workers.prepare()
    with alone(target), stoppable(target):
        results = Results(target, inputs=[one.folder for one in asked], force=force)
        results.claim([PAGE, ROWS])
        found: list[Outcome] = []
        with progress_bar("measured", plainly=True) as tell:
            for one in outcomes(
                asked,
                models=chosen_models(models, quick),
                seed=seed,
                jobs=jobs,
                folder=target,
                tell=tell,
            ):
                found.append(one)
                _say(one, quiet=as_json)
        command = "mckibben measured FOLDER" + (f" --models {models}" if models != "all" else "")
        results.write_text(PAGE, page(found, command + (" --quick" if quick else "")))
        results.write_text(ROWS, table(found).to_csv(index=False))
        if as_json:
            print_json({one.label: _told(one) for one in found})
        else:
            say(f"Written: {target / PAGE}, {target / ROWS}")
        forget_kept(target)
        if all(one.failed for one in found):
            raise DataError(
                "nothing could be compared",
                file=folder,
                remedy=f"see the reasons in {target / PAGE}",
            )


def _say(one: Outcome, *, quiet: bool) -> None:
    if not quiet:
        say(f"{one.label}: {one.failed or (words.chosen(one.board) if one.board else '')}")


def _told(one: Outcome) -> dict[str, object]:
    if one.board is None:
        return {"reason": one.reason}
    return one.board.to_dict() | {"range": one.span, "seconds": one.seconds}
