"""Attacked: a comparison, by workers that lie, vanish or are absent; and processes that are spawned."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from mckibben import compare
from mckibben.comparison import cluster, trying
from mckibben.comparison.planning import plan_of
from mckibben.comparison.results import Leaderboard
from mckibben.comparison.trying import Item, Part, Tried
from mckibben.system.workers import WorkerError, Workers, answered
from tests.report.studies_by_hand import measured

DATA = measured(300), measured(300, seed=1, name="another day")
HONEST = trying.try_part


class Unreadable:
    """It can be sent, and not be made again."""

    def __init__(self, *_: Any) -> None:
        pass

    def __reduce__(self) -> Any:
        return _burst, ()


class Unsendable:
    """It cannot be sent, for a reason that pickle does not know."""

    def __reduce__(self) -> Any:
        raise ValueError("no")


class WordlessError(Exception):
    """An error that cannot even be put in words."""

    def __str__(self) -> str:
        raise RuntimeError("no words")

    def __reduce__(self) -> Any:
        return _burst, ()


def _burst() -> Any:
    raise RuntimeError("burst")


ANSWERS = {"unreadable": Unreadable, "unsendable": Unsendable}


def answer(common: Any, item: str, tell: Any) -> Any:
    """Be a worker that answers anything."""
    if item in ANSWERS:
        return ANSWERS[item]()
    if item == "wordless":
        raise WordlessError
    if item == "dies":
        os._exit(3)
    if item == "sleeps":
        time.sleep(30)
    return item


def test_whatever_a_process_answers_every_item_has_an_outcome() -> None:
    items = ["fine", "unreadable", "unsendable", "wordless", "dies", "well"]
    with Workers(2) as workers:
        found = {outcome.index: outcome for outcome in workers.results(answer, items)}
    assert sorted(found) == list(range(6))
    assert [found[k].value for k in (0, 5)] == ["fine", "well"]
    for k in range(1, 5):
        assert isinstance(found[k].error, WorkerError)
    assert "cannot be sent: ValueError: no" in str(found[2].error)
    assert "WordlessError" in str(found[3].error)


LIES: dict[str, Callable[[Any], Any]] = {
    "none": lambda honest: honest,
    "nonsense": lambda honest: "nonsense",
    "another model": lambda honest: replace(honest, row=replace(honest.row, model="pi")),
    "outputs left out": lambda honest: replace(honest, outputs=honest.outputs[:1]),
    "other outputs": lambda honest: replace(
        honest, outputs=(*honest.outputs[:-1], honest.outputs[-1] + 1.0)
    ),
    "no number": lambda honest: replace(
        honest, row=replace(honest.row, test=replace(honest.row.test, rmse=float("nan")))
    ),
    "nothing": lambda honest: Tried(),
}


def lie(data: Any, part: Any, tell: Any) -> Any:
    """Try a part, and lie about it as its settings say."""
    settings = dict(part.item.settings)
    kind = settings.pop("lie", "nonsense" if part.name == "eupi" else "none")
    return LIES[kind](HONEST(data, replace(part, item=replace(part.item, settings=settings)), tell))


def test_what_is_not_of_the_part_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trying, "try_part", lie)
    data = plan_of(
        *DATA,
        inputs="pressure",
        outputs="displacement",
        models=["eupi"],
        settings=None,
        n_folds=0,
        seed=0,
    ).data
    parts = [Part("eupi", Item("eupi", {"lie": kind}), (), whole=True) for kind in LIES]
    first, *others = trying.outcomes(data, parts, 1)
    assert first.result().row.model == "eupi"
    assert len(others) == len(LIES) - 1
    for outcome in others:
        assert "not what came of eupi" in str(outcome.error)


def caught(board: Leaderboard) -> None:
    """Assert that the honest model is ranked and the other is not."""
    honest, liar = board.rows
    assert board.best is honest
    assert honest.model == "pi"
    assert "not what came of eupi" in str(liar.reason)


def test_a_process_that_lies_keeps_the_rest_of_the_ranking(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(trying, "try_part", lie)
    caught(compare(*DATA, models=["pi", "eupi"], jobs=2, n_folds=0))


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
    assert "ran away" in str(eupi.invalid)


@pytest.fixture(scope="module")
def dask() -> Iterator[Any]:
    """Start a cluster of one worker in this process, which is talked to over a socket."""
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=1,
        threads_per_worker=2,
        processes=False,
        protocol="tcp",
        dashboard_address=None,
    ) as found:
        yield found


@pytest.mark.filterwarnings("ignore")
def test_a_cluster_that_lies_keeps_the_rest_of_the_ranking(
    dask: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trying, "try_part", lie)
    with cluster.on_cluster(dask.scheduler_address):
        caught(compare(*DATA, models=["pi", "eupi"], n_folds=0))


@pytest.mark.filterwarnings("ignore")
def test_a_cluster_that_answers_anything_or_vanishes_is_told(
    dask: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "ABSENCE", 1.0)
    items = ["fine", "unreadable", "unsendable", "wordless", "sleeps", "sleeps"]
    with cluster.on_cluster(dask.scheduler_address):
        found = {}
        for outcome in cluster.outcomes_outside(answer, None, items):
            found[outcome.index] = outcome
            if len(found) == 4:
                threading.Thread(target=dask.scale, args=(0,), daemon=True).start()
    assert sorted(found) == list(range(6))
    assert found[0].value == "fine"
    for k in range(1, 6):
        assert isinstance(found[k].error, WorkerError)
    assert "no workers any more" in str(found[5].error)


def test_answers_to_nothing_asked_and_twice_are_passed_over(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    given = answered(answer, None, "fine", lambda *_: None)

    def answers(*_: Any) -> Iterator[tuple[int, object]]:
        yield from [(1, given), (1, given), (7, given), (-1, given), (0, "no bytes")]
        raise ConnectionError("gone")

    monkeypatch.setattr(cluster, "_from_backend", answers)
    found = {o.index: o for o in cluster.outcomes_outside(answer, None, ["a", "b", "c"])}
    assert found[1].value == "fine"
    assert "cannot be read" in str(found[0].error)
    assert "ConnectionError: gone" in str(found[2].error)
    assert len(found) == 3


SPAWNED = """
import multiprocessing
from tests.attacks.test_workers import board_of
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
