"""The folder of a comparison's or a study's results, written as they come."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING

from mckibben import registry
from mckibben.atomic import write_json, write_text
from mckibben.report.page import write_report

if TYPE_CHECKING:
    from mckibben.comparison.results import Leaderboard, Study

PAGE_SHARE = 0.1
"""Share of the time that may go into pages which the next model makes old."""


def write_leaderboard(board: Leaderboard, folder: Path) -> None:
    """Write ``leaderboard.json`` and ``leaderboard.csv``."""
    write_json(folder / "leaderboard.json", board.to_dict())
    write_text(folder / "leaderboard.csv", board.to_frame().to_csv(index=False))


class StudyFolder:
    """A study's results: what the muscle does, leaderboard, models, inverse and report.

    Parameters
    ----------
    folder : Path
        Exists.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._saved: set[str] = set()
        self._next_page = 0.0
        for name in registry.names("estimators"):  # of an earlier study
            (folder / "models" / f"{name}.json").unlink(missing_ok=True)
        (folder / "inverse.json").unlink(missing_ok=True)

    def take(self, study: Study, *, last: bool = False) -> None:
        """Write what is new; the page only when it is due, or the last."""
        folder, board = self._folder, study.leaderboard
        if not board.rows:
            write_json(folder / "characterization.json", study.characterization.to_dict())
        (folder / "models").mkdir(exist_ok=True)
        for row in board.rows:
            if row.block is not None and row.model not in self._saved:
                row.block.save(folder / "models" / f"{row.model}.json")
                self._saved.add(row.model)
        write_leaderboard(board, folder)
        if study.inverse is not None:
            study.inverse.inverse.save(folder / "inverse.json")
        started = time.monotonic()
        if last or not board.pending or started >= self._next_page:
            write_report(study, folder / "report.html")
            ended = time.monotonic()
            first = not board.rows  # the page of the first model is never waited for
            self._next_page = ended if first else ended + (ended - started) / PAGE_SHARE
