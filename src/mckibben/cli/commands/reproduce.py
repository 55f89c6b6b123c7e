"""Run a paper's protocol on its rig, with its methods and ours, and compare the tables.

Ctrl-C stops it. With -o, recordings and fits are saved, and the same command resumes.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from mckibben.cli.output import say, show
from mckibben.cli.parameters import Force, Json, command, typed_command
from mckibben.cli.stopping import stoppable
from mckibben.options import Argument, Option, ReadOptions, ReproduceOptions


@command
def reproduce(
    options: ReproduceOptions,
    reading: ReadOptions,
    name: Annotated[str | None, Argument("[PAPER]", "Short name; see --list.")] = None,
    listed: Annotated[bool, Option("List the papers.", flag="--list")] = False,
    data: Annotated[
        Path | None, Option("Your recordings of its runs, of any size and name.", "FOLDER")
    ] = None,
    out: Annotated[
        Path | None, Option("Folder for report.html and tables.json.", "DIR", "-o")
    ] = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    from mckibben import workflow
    from mckibben.errors import DataError
    from mckibben.papers.paper import papers
    from mckibben.report import results, text
    from mckibben.report.reproduction import tables

    if listed:
        papers_by_name = papers()
        content = [{"name": key} | paper.about() for key, paper in papers_by_name.items()]
        show(content, lambda: text.lines(results.papers(papers_by_name)), as_json)
        return
    if name is None:
        raise DataError("there is no paper to run again", remedy="name one, or give `listed`")
    with stoppable(out):
        result = workflow.reproduce(
            name, options, data=data, reading=reading, out=out, force=force, progress=True,
            command=typed_command(),
            recognised=lambda table: say("\n".join(text.lines(tables([table]))), error=True),
        )  # fmt: skip
    written = [out / "report.html", out / "tables.json"] if out else []
    show(result, lambda: text.lines_of_result(result), as_json, result.notes, written)
