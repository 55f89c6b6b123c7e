"""The folder of a comparison's or a study's results, updated while it runs."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from mckibben.diagnosis.check import Validation
from mckibben.diagnosis.review import Refit
from mckibben.outputs import Results
from mckibben.report.check_page import check_json
from mckibben.report.commands import model_file
from mckibben.report.page import page
from mckibben.system.atomic import to_json

if TYPE_CHECKING:
    from collections.abc import Iterable

    from mckibben.comparison.leaderboard import Leaderboard
    from mckibben.studying.study import Study

PAGE_SHARE = 0.1
"""Share of the time that may go into pages which the next model makes old."""

LEADERBOARD = ("leaderboard.json", "leaderboard.csv")


def study_files(models: Iterable[str]) -> list[str]:
    """Return the files that a study of these models may write."""
    rest = (
        "report.html",
        "characterization.json",
        "inverse.json",
        "inverse_expected.json",
        "validation.json",
        "banded.json",
        "review.json",
        "refit.json",
    )
    return [*LEADERBOARD, *rest, *map(model_file, models)]


def write_leaderboard(board: Leaderboard, results: Results) -> None:
    """Write ``leaderboard.json`` and ``leaderboard.csv``."""
    results.write_text("leaderboard.json", to_json(board.to_dict()) + "\n")
    results.write_text("leaderboard.csv", board.to_frame().to_csv(index=False))


class StudyFolder:
    """A study's results: characterization, leaderboard, models, inverse and report.

    Parameters
    ----------
    results : Results
        Where they are written.
    command : str
        How the study is repeated on the command line.
    title : str
        Of the report; default the recording's name.
    """

    def __init__(self, results: Results, command: str = "", *, title: str = "") -> None:
        self._results, self._command, self._title = results, command, title
        self._saved: set[str] = set()
        self._next_page = 0.0

    def take(self, study: Study, *, last: bool = False) -> None:
        """Write new results; the page only when it is due, or at the end."""
        write, board = self._results.write_text, study.leaderboard
        if not board.rows and study.characterization is not None:
            measures = study.characterization.to_dict()
            write("characterization.json", to_json(measures) + "\n")
        if not board.rows and study.review is not None:
            write("review.json", to_json(study.review.to_dict()) + "\n")
            if isinstance(study.review.refit, Refit):
                write("refit.json", study.review.refit.model.to_text())
        for row in board.rows:
            if row.block is not None and row.model not in self._saved:
                write(model_file(row.model), row.block.to_text())
                self._saved.add(row.model)
        write_leaderboard(board, self._results)
        compensation = study.inverse
        if compensation is not None:
            write("inverse.json", compensation.inverse.to_text())
        if compensation is not None or last:
            facts = {"model": None} if compensation is None else compensation.to_dict()
            facts |= {"passed_over": dict(study.passed_over)}
            write("inverse_expected.json", to_json(facts) + "\n")
        best = board.best
        if best is not None and not board.pending:
            validation = {"not_checked": study.check}
            if isinstance(study.check, Validation):
                validation = check_json(study.check, model_file(best.model))
            content = study.to_dict()
            validation |= {name: content[name] for name in ("description", "data_gaps")}
            write("validation.json", to_json(validation) + "\n")
            if best.banded is not None:
                write("banded.json", best.banded.to_text())
        started = time.monotonic()
        if last or not board.pending or started >= self._next_page:
            write("report.html", page(study, self._command, title=self._title))
            ended = time.monotonic()
            first = not board.rows  # the page of the first model is never waited for
            self._next_page = ended if first else ended + (ended - started) / PAGE_SHARE
