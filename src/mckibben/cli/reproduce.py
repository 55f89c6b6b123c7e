"""mckibben reproduce: a paper's experiment again, its printed tables beside ours."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mckibben.cli.grouping import spread
from mckibben.cli.options import Force, Jobs, Json, Reading, Seed
from mckibben.cli.output import make_folder, print_json, print_table, progress_bar, say
from mckibben.cli.stopping import forget_kept, stoppable
from mckibben.errors import DataError
from mckibben.numerals import numeral
from mckibben.system.locks import alone

if TYPE_CHECKING:
    from mckibben.papers.experiment import Reproduction
    from mckibben.recording import Recording


@spread
def reproduce(
    reading: Reading,
    name: Annotated[str | None, typer.Argument(help="Paper, by short name; see --list.")] = None,
    listed: Annotated[bool, typer.Option("--list", help="List the papers.")] = False,
    quick: Annotated[bool, typer.Option("--quick", help="Leave out what takes long.")] = False,
    data: Annotated[
        Path | None,
        typer.Option(
            "--data",
            metavar="FOLDER",
            help="Your own recordings instead of the rig's; see docs/papers.",
        ),
    ] = None,
    rig: Annotated[
        str | None,
        typer.Option("--rig", help="Rig to record, and to close loops on. Default: the paper's."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="Folder for report.html and tables.json.")
    ] = None,
    seed: Seed = 0,
    jobs: Jobs = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Run a paper's protocol on its rig: its methods as published, ours, and its tables beside.

    Ctrl-C stops at once; with -o what is recorded and fitted is kept, and the same command goes on.
    """
    if listed:
        _list(as_json)
        return
    if name is None:
        raise DataError("there is no paper to run again", remedy="name one, or give --list")
    from mckibben.outputs import Results
    from mckibben.papers.paper import paper
    from mckibben.rigs import load_rig
    from mckibben.system import threads, workers

    paper(name)
    recordings = None if data is None else _recordings(data, reading)
    plant = None if rig is None else load_rig(rig)
    folder = None if out is None else make_folder(out)
    with alone(folder), stoppable(folder):
        results = None
        if folder is not None:
            results = Results(folder, inputs=[] if data is None else [data], force=force)
            results.claim(["report.html", "tables.json"])
        given: dict[str, Any] = {"name": name, "rig": plant, "data": recordings}
        given |= {"quick": quick, "seed": seed, "jobs": jobs, "folder": folder}

        def passed_on(index: int, *news: Any) -> None:
            if news:
                tell(*news)

        # in a process of its own, which can be ended whatever it is at
        with (
            progress_bar(f"{name}:", plainly=True) as tell,
            workers.Workers(1, cores=jobs or threads.cores()) as one,
        ):
            (outcome,) = one.results(_again, [given], passed_on)
            found: Reproduction = outcome.result()
        if results is not None:
            from mckibben.report.reproduction import reproduction_page
            from mckibben.system.atomic import to_json

            results.clear()
            results.write_text("report.html", reproduction_page(found))
            results.write_text("tables.json", to_json(found.to_dict()) + "\n")
        if as_json:
            print_json(found.to_dict())
        else:
            _print(found)
            if folder is not None:
                say(f"Written: {folder / 'report.html'}, {folder / 'tables.json'}")
        forget_kept(folder)


def _recordings(folder: Path, reading: Reading) -> list[Recording]:
    """Return the recordings of a folder, each named as its file."""
    from mckibben.files.sources import inside

    if not folder.is_dir():
        raise DataError("there is no such folder", file=folder, remedy="name one with recordings")
    found: list[Recording] = []
    for path in inside(folder):
        parts = reading.read([path], None, informative=False)
        for place, one in enumerate(parts, start=1):
            name = f"{path.stem}-{place}" if len(parts) > 1 else path.stem
            found.append(replace(one.with_meta(name=name), start_time=0.0))
    return found


def _again(common: None, given: dict[str, Any], tell: Callable[..., None]) -> Reproduction:
    """Run a paper again in a worker's process."""
    from mckibben.papers.experiment import reproduce as run

    return run(**given, clear=False, progress=tell)


def _list(as_json: bool) -> None:
    from mckibben.papers.paper import papers

    rows = [[each.number, name, each.title, each.question] for name, each in papers().items()]
    columns = ["number", "name", "title", "question"]
    if as_json:
        print_json([dict(zip(columns, row, strict=True)) for row in rows])
        return
    for number, name, title, question in rows:
        say(f"{number}. {name}: {title}\n   {question}")


def _print(found: Reproduction) -> None:
    from mckibben.report.reproduction import heading

    for table in found.tables:
        say(f"\n{heading(table, quick=found.quick)}")
        rows = [[c if isinstance(c, str) else numeral(c, 4) for c in row] for row in table.rows]
        print_table(table.columns, rows)
        if table.text.note:
            say(table.text.note)
    say()
    for sentence in found.summary:
        say(sentence)
    for note in found.notes:
        say(f"Note: {note}")
