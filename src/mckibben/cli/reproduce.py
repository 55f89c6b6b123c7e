"""mckibben reproduce: a paper's experiment again, its printed tables beside ours."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mckibben.cli.options import Force, Jobs, Json, Reading, Seed
from mckibben.cli.output import make_folder, print_json, print_table, progress_bar, say
from mckibben.cli.stopping import forget_kept, stoppable
from mckibben.errors import DataError
from mckibben.numerals import numeral
from mckibben.system.locks import alone

if TYPE_CHECKING:
    from mckibben.papers.reproduction import Reproduction
    from mckibben.recording import Recording


def reproduce(
    name: Annotated[str | None, typer.Argument(help="Paper, by short name; see --list.")] = None,
    listed: Annotated[bool, typer.Option("--list", help="List the papers.")] = False,
    quick: Annotated[bool, typer.Option("--quick", help="Leave out what takes long.")] = False,
    train: Annotated[
        Path | None,
        typer.Option("--train", metavar="FILE", help="field-models only: your calibration run."),
    ] = None,
    test: Annotated[
        Path | None,
        typer.Option("--test", metavar="FILE", help="field-models only: your test run."),
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
    from mckibben import registry
    from mckibben.outputs import Results
    from mckibben.system import threads, workers

    folder = None if out is None else make_folder(out)
    with alone(folder), stoppable(folder):
        registry.load("papers", name)
        results = None
        if folder is not None:
            inputs = [file for file in (train, test) if file is not None]
            results = Results(folder, inputs=inputs, force=force)
            results.claim(["report.html", "tables.json"])
        own = _own(name, train, test)
        given = {"name": name, "quick": quick, "seed": seed, "jobs": jobs, "folder": folder} | own
        # in a process of its own, which can be ended whatever it is at
        with (
            progress_bar(f"{name}:", plainly=True) as tell,
            workers.Workers(1, cores=jobs or threads.cores()) as one,
        ):
            told = _once_a_word(tell)
            (outcome,) = one.results(_again, [given], told)
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


def _again(common: None, given: dict[str, Any], tell: Callable[..., None]) -> Reproduction:
    """Run a paper again in a worker's process."""
    from mckibben.papers.reproduction import reproduce as run

    return run(**given, clear=False, progress=tell)


def _once_a_word(tell: Callable[[float, str], None]) -> Callable[..., None]:
    """Return what passes on progress when there is news."""
    last = ""

    def told(index: int, *what: Any) -> None:
        nonlocal last
        if what and what[1] != last:
            last = what[1]
            tell(*what)

    return told


def _own(name: str, train: Path | None, test: Path | None) -> dict[str, Recording]:
    """Return the user's own recordings, or nothing for the rig's."""
    if train is None and test is None:
        return {}
    if name != "field-models" or train is None or test is None:
        raise DataError(
            "--train and --test go together, and with field-models only",
            remedy="give both files, or neither",
        )
    reading = Reading()
    (first, *_), (second, *_) = (
        reading.read([file], ["pressure", "displacement"]) for file in (train, test)
    )
    return {"train": first, "test": second}


def _list(as_json: bool) -> None:
    from mckibben import registry

    papers = {name: _source(name) for name in registry.names("papers")}
    if as_json:
        print_json(papers)
        return
    print_table(["paper", "what it is"], [[name, source] for name, source in papers.items()])


def _source(name: str) -> str:
    from mckibben import registry

    doc = registry.load("papers", name).__doc__ or ""
    return str(doc.strip().splitlines()[0])


def _cell(cell: str | float | None) -> str:
    if cell is None:
        return "-"
    return numeral(cell, 4) if isinstance(cell, float) else str(cell)


def _print(found: Reproduction) -> None:
    for table in found.tables:
        say(f"\n{table.title}")
        rows = [[_cell(cell) for cell in row] for row in table.rows]
        print_table(table.columns, rows)
        if table.note:
            say(table.note)
    say()
    for sentence in found.summary:
        say(sentence)
    for note in found.notes:
        say(f"Note: {note}")
