"""Whatever a process answers, the rest of a comparison is ranked."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from mckibben import compare
from mckibben.comparison import trying
from tests.report.studies_by_hand import measured

DATA = measured(300), measured(300, seed=1, name="another day")
HONEST = trying.try_part


def nonsense(data: Any, part: Any, tell: Any) -> Any:
    """Try a part, and answer nonsense for one model."""
    return "nonsense" if part.name == "eupi" else HONEST(data, part, tell)


def test_a_process_that_lies_keeps_the_rest_of_the_ranking(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(trying, "try_part", nonsense)
    board = compare(*DATA, models=["pi", "eupi"], jobs=1, n_folds=0)
    honest, liar = board.rows
    assert board.best is honest
    assert (honest.model, liar.model) == ("pi", "eupi")
    assert liar.reason


def test_a_cross_validation_that_ran_away_is_not_chosen_by(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def run_away(data: Any, part: Any, tell: Any) -> Any:
        tried = HONEST(data, part, tell)
        return replace(tried, squares=((float("nan"),),)) if part.name == "eupi" else tried

    monkeypatch.setattr(trying, "try_part", run_away)
    board = compare(*DATA, models=["pi", "eupi"], jobs=1)
    assert board.best is not None
    assert board.best.model == "pi"
    (eupi,) = (row for row in board.rows if row.model == "eupi")
    assert eupi.validation_rmse is None
    assert eupi.invalid


SPAWNED = """
import multiprocessing
from tests.comparison.test_answers import board_of
from mckibben.system.workers import context

if __name__ == "__main__":
    multiprocessing.set_start_method("spawn")
    assert context().get_start_method() == "spawn"
    print(board_of(2))
"""


def board_of(jobs: int) -> str:
    """Return a small comparison in words."""
    board = compare(*DATA, models=["pi", "eupi"], jobs=jobs, n_folds=2)
    return str([(row.model, row.reason, row.validation_rmse, row.test) for row in board.rows])


@pytest.mark.long
def test_a_comparison_is_the_same_with_processes_that_are_spawned(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(SPAWNED)
    home = Path(__file__).parents[2]
    done = subprocess.run(
        [sys.executable, script],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(home), *sys.path])},
    )
    assert done.stdout.strip() == board_of(1)
