"""Re-run of a paper's experiment, with its report."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from mckibben.checkpoints import Checkpoints
from mckibben.errors import DataError, DataWarning
from mckibben.files.sources import inside
from mckibben.options import ReadOptions
from mckibben.outputs import results_in
from mckibben.papers.experiment import (
    Progress,
    Reproduction,
    Table,
    recognised_table,
    reproduce,
)
from mckibben.papers.paper import paper
from mckibben.papers.recognising import recognise
from mckibben.reading import read_files
from mckibben.recording import Recording, notes_by_file
from mckibben.report.reproduction import reproduction_page
from mckibben.rigs import Rig, load_rig
from mckibben.system import threads, workers
from mckibben.system.atomic import to_json


def rerun(
    name: str,
    data: Path | None = None,
    reading: ReadOptions | None = None,
    *,
    rig: str | Path | Rig | None = None,
    out: Path | None = None,
    quick: bool = False,
    seed: int = 0,
    jobs: int | None = None,
    force: bool = False,
    progress: Progress | None = None,
    recognised: Callable[[Table], None] | None = None,
    command: str = "",
) -> Reproduction:
    """Re-run a paper's experiment on a rig or on a folder of recordings, and write its report.

    It runs in a process of its own, which can be ended whatever it is at. Parameters are those of
    `reproduce`; ``out`` is the folder for ``report.html`` and ``tables.json``, and ``recognised`` is
    called with the table of which run each recording is, before anything is fitted; ``command`` repeats
    it.
    """
    paper(name)
    runs = None if data is None else _recordings(data, reading)
    if runs is not None:
        matches = recognise(name, runs)  # refuses what is missing, too
        if recognised is not None:
            recognised(recognised_table(matches))
    arguments: dict[str, Any] = {
        "name": name,
        "rig": None if rig is None else load_rig(rig),
        "data": runs,
        "quick": quick,
    }
    arguments |= {"seed": seed, "jobs": jobs, "folder": out}
    inputs = [] if data is None else [data]
    with results_in(
        out, ["report.html", "tables.json"], inputs=inputs, force=force, kind="reproduce"
    ) as results:
        with workers.Workers(1, cores=jobs or threads.cores()) as pool:
            (outcome,) = pool.results(
                _again,
                [arguments],
                lambda index, *news: progress(*news) if progress and news else None,
            )
        result: Reproduction = outcome.result()
        if results is not None:
            results.write_text("report.html", reproduction_page(result, command))
            results.write_text("tables.json", to_json(result.to_dict()) + "\n")
            results.commit()
        Checkpoints(out).clear()
    return result


def _again(common: None, arguments: dict[str, Any], tell: Callable[..., None]) -> Reproduction:
    """Re-run a paper in a worker process."""
    return reproduce(**arguments, clear=False, progress=tell)


def _recordings(folder: Path, reading: ReadOptions | None) -> list[Recording]:
    """Return the recordings of a folder, each named as its file."""
    if not folder.is_dir():
        raise DataError("there is no such folder", file=folder, remedy="name one with recordings")
    runs: list[Recording] = []
    for path in inside(folder):
        with warnings.catch_warnings():  # which are said once for all files
            warnings.simplefilter("ignore", DataWarning)
            parts = read_files(path, None, reading)
        for place, part in enumerate(parts, start=1):
            name = f"{path.stem}-{place}" if len(parts) > 1 else path.stem
            runs.append(replace(part.with_meta(name=name), start_time=0.0))
    files: dict[str, list[str]] = {}
    for file, notes in notes_by_file(runs).items():
        for note in notes:
            files.setdefault(note, []).append(file)
    for note, names in files.items():
        more = f" and {len(names) - 1} more" if len(names) > 1 else ""
        warnings.warn(DataWarning(f"{names[0]}{more}: {note}"), stacklevel=2)
    return runs
