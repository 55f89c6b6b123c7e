"""The five papers' experiments, run again quickly: every number of their tables within 1 %."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from tests.golden.case import Case, Tree
from tests.golden.commands import answered
from tests.golden.rounding import rounded

PAPERS: Mapping[str, bool] = {
    "activation-pressure": False,
    "field-models": False,
    "mpi-narmax": True,
    "multistate-friction": False,
    "sdchm": True,
}
"""Paper -> whether even its quick run takes more than 20 s."""

TIMES = ("[s]", "[µs]", "[ns]")
"""Ends of headings of what differs from run to run."""

UNDETERMINED = "tables/*/[rkda]"
"""Thresholds, weights and coefficients that no recording of one sine determines."""

DETERMINED = 0.05
"""Standard error of a parameter, relative to it, above which it is not compared."""


def rerun(paper: str, folder: Path) -> Tree:
    """Return the tables of a paper's quick run."""
    found = answered("reproduce", paper, "--quick", "--jobs", 1, "-o", folder / "out")
    return {
        "name": found["name"],
        "doi": found["doi"],
        "quick": found["quick"],
        "left": sorted(path.name for path in (folder / "out").iterdir()),
        "tables": [[_row(row) for row in table["rows"]] for table in found["tables"]],
    }


def _row(row: Mapping[str, Any]) -> dict[str, Tree]:
    error, value = row.get("standard error"), row.get("here")
    if error is not None and error > DETERMINED * abs(value or 0.0):
        return {"printed": row["printed"]}
    return {
        heading: _cell(cell)
        for heading, cell in row.items()
        if not heading.endswith(TIMES) and heading not in ("standard error", "from", "to")
    }


def _cell(cell: Any) -> Tree:
    """Return a number, or a name; of several words only that they are some."""
    if isinstance(cell, str):
        return "words" if len(cell.split()) > 1 else cell
    return rounded(cell)


def cases() -> Iterator[Case]:
    """Yield the papers."""
    for paper, slow in PAPERS.items():
        yield Case(
            f"papers/{paper}",
            f"mckibben reproduce {paper} --quick --json",
            partial(rerun, paper),
            {UNDETERMINED: None, "*parameters*": 0.0, "*": 0.01},
            slow=slow,
            one_machine=paper == "multistate-friction",  # whose searches end in several minima
        )
