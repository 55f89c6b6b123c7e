"""What a re-run of a paper holds: tables with the printed figures beside ours, and its figures."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import compress
from pathlib import Path
from typing import Any

import numpy as np

from mckibben import registry
from mckibben.arrays import Array
from mckibben.comparison.checkpoints import Checkpoints
from mckibben.system.progress import telling
from mckibben.system.threads import one_blas_thread

Cell = str | float | None
Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class Source:
    """A paper, and what it asks.

    Parameters
    ----------
    title : str
    question : str
        What its experiment answers, in one sentence.
    authors, published, doi : str
        Who, where and when; empty where that is not known.
    """

    title: str
    question: str
    authors: str = ""
    published: str = ""
    doi: str = ""


@dataclass(frozen=True)
class Points:
    """Which columns of a table are drawn, a point for each row.

    Parameters
    ----------
    measure : str
        What they all are, with its unit.
    columns : tuple of str
        Headings; those with "printed" in them are drawn as the paper's.
    bound : float or None
        What the paper says that its figures are below, where it prints no more.
    """

    measure: str
    columns: tuple[str, ...]
    bound: float | None = None


@dataclass(frozen=True)
class Table:
    """A table.

    Parameters
    ----------
    title : str
        What it shows, and which table of the paper it stands beside.
    columns : sequence of str
        Headings, with units.
    rows : sequence of sequence
        Words, numbers, or None where there is nothing to say.
    note : str
        How it was made; what "printed" refers to.
    drawn : Points or None
        What of it stands in the picture of printed and ours.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    note: str = ""
    drawn: Points | None = None

    def filled(self) -> Table:
        """Return the table without columns in which there is nothing to say."""
        kept = [any(cell is not None for cell in cells) for cells in zip(*self.rows, strict=True)]
        if all(kept):
            return self
        return replace(
            self,
            columns=tuple(compress(self.columns, kept)),
            rows=tuple(tuple(compress(row, kept)) for row in self.rows),
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the table as ``tables.json`` holds it."""
        rows = [dict(zip(self.columns, row, strict=True)) for row in self.rows]
        return {"title": self.title, "note": self.note, "rows": rows}


@dataclass(frozen=True)
class Figure:
    """Curves on one pair of axes.

    Parameters
    ----------
    title : str
        What it shows, and which figure of the paper it redraws.
    x_label, y_label : str
        With units.
    curves : mapping of str to (array, array)
        Name to x and y, in order of drawing.
    """

    title: str
    x_label: str
    y_label: str
    curves: Mapping[str, tuple[Array, Array]] = field(default_factory=dict)


@dataclass(frozen=True)
class Reproduction:
    """A paper's experiment, run again on its virtual rig.

    Parameters
    ----------
    name : str
        As registered.
    source : Source
        The paper.
    summary : sequence of str
        What came out, one sentence each.
    tables : sequence of Table
    figures : sequence of Figure
    notes : sequence of str
        What differs from the paper.
    quick : bool
        Whether what takes long was left out.
    """

    name: str
    source: Source
    summary: tuple[str, ...]
    tables: tuple[Table, ...]
    figures: tuple[Figure, ...]
    notes: tuple[str, ...]
    quick: bool = False

    def to_dict(self) -> dict[str, Any]:
        """Return all but the figures, as ``tables.json`` holds it."""
        return {
            "name": self.name,
            "title": self.source.title,
            "doi": self.source.doi,
            "quick": self.quick,
            "summary": list(self.summary),
            "tables": [table.to_dict() for table in self.tables],
            "notes": list(self.notes),
        }


def reproduce(
    name: str,
    *,
    quick: bool = False,
    seed: int = 0,
    jobs: int | None = None,
    folder: str | Path | None = None,
    clear: bool = True,
    progress: bool | Progress | None = None,
    **own: Any,
) -> Reproduction:
    """Run a paper's experiment again.

    Parameters
    ----------
    name : str
        As ``mckibben reproduce --list`` lists it.
    quick : bool
        Whether to leave out what takes long: under a minute then.
    seed : int
        Of everything random.
    jobs : int, optional
        Processes; default as many as there are cores.
    folder : path, optional
        Where recordings and models are kept until all is done, so that a re-run that was stopped and
        is called again goes on from there.
    clear : bool
        Whether to forget what was kept when all is done; else the caller does, once it has written
        what is returned, by ``Checkpoints(folder).clear()``.
    progress : bool or callable, optional
        Whether to show a bar; or who is told the share of the work done, and what is next.
    **own
        What the paper's function takes beside: ``train`` and ``test`` of ``field-models``.

    Raises
    ------
    ModelError
        If there is no paper of that name; the text lists those there are.
    """
    run = registry.load("papers", name)
    kept = Checkpoints(folder, name, quick, seed)
    with one_blas_thread(), telling(progress, name) as tell:
        found: Reproduction = run(
            quick=quick,
            seed=seed,
            jobs=jobs,
            tell=tell or (lambda share, text: None),
            kept=kept,
            **own,
        )
    if clear:
        kept.clear()
    tables = tuple(table.filled() for table in found.tables)
    return replace(found, tables=tables, quick=quick)


def rms(errors: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(errors**2)))


def thinned(values: Sequence[float] | Array, most: int = 4000) -> Array:
    """Return every k-th value, so that at most so many are left."""
    array = np.asarray(values, dtype=np.float64)
    return array[:: max(1, -(-array.size // most))]
