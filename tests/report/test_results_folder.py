"""Results are on disk as they come."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

from mckibben.outputs import Results
from mckibben.report import StudyFolder
from tests.report.studies_by_hand import study


def test_results_are_written_as_they_come(tmp_path: Path) -> None:
    whole = study()
    board = whole.leaderboard
    Results(tmp_path).write_text("inverse.json", "of an earlier study")
    folder = StudyFolder(tmp_path)
    assert not (tmp_path / "inverse.json").exists()
    names = tuple(row.model for row in board.rows)
    early = replace(
        whole,
        leaderboard=replace(board, rows=(), pending=names),
        predictions={},
        inverse=None,
    )
    folder.take(early)
    assert json.loads((tmp_path / "characterization.json").read_text())
    first = (tmp_path / "report.html").read_text()
    one = replace(early.leaderboard, rows=board.rows[:1], pending=names[1:])
    folder.take(replace(early, leaderboard=one, predictions=whole.predictions))
    second = (tmp_path / "report.html").read_text()
    assert second != first  # the first model's page is not waited for
    assert [path.stem for path in (tmp_path / "models").iterdir()] == [names[0]]
    two = replace(early.leaderboard, rows=board.rows[:2], pending=names[2:] or ("more",))
    folder.take(replace(early, leaderboard=two, predictions=whole.predictions))
    assert (tmp_path / "report.html").read_text() == second  # but the next ones' are
    rows = json.loads((tmp_path / "leaderboard.json").read_text())["rows"]
    assert len(rows) == 2
    folder.take(whole)
    assert (tmp_path / "report.html").read_text() not in (first, second)
    assert (tmp_path / "inverse.json").exists()
