"""Folders of recordings to one page: splits, tasks, figures, bad descriptions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mckibben import GPI, DataError, Recording, compare, write
from mckibben.measured.page import page
from mckibben.measured.running import outcomes
from mckibben.measured.sets import parted, sets_in, split_of
from mckibben.signals import irregular_triangle
from tests.cli.conftest import Cli

TIME = np.arange(0, 30, 0.02)
MODELS = ["pi", "gpi"]


def recorded(seed: int) -> Recording:
    u = irregular_triangle(TIME, 12, 5.0, seed=seed)
    noise = 0.02 * np.random.default_rng(seed).standard_normal(u.size)
    return Recording({"pressure": u, "displacement": GPI.example().simulate(u) + noise}, 0.02)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two sets: one muscle without a description; one whose voltages and split are described."""
    plain, volts = tmp_path / "data" / "plain", tmp_path / "data" / "volts"
    plain.mkdir(parents=True)
    volts.mkdir()
    write(recorded(1), plain / "run.csv")
    for seed in (2, 3, 4):
        run = recorded(seed)
        rows = np.column_stack([TIME, (run["pressure"] + 1.0) / 2.0, run["displacement"]])
        text = "t,A0,y\n" + "\n".join(",".join(f"{v:.9g}" for v in row) for row in rows)
        (volts / f"run{seed}.csv").write_text(text + "\n")
    (volts / "channels.toml").write_text(
        """
        [time]
        column = "t"
        unit = "s"
        [channels.pressure]
        column = "A0"
        unit = "bar"
        gain = 2.0
        offset = -1.0
        [channels.displacement]
        column = "y"
        unit = "mm"
        [split]
        title = "By volts"
        about = "A sensor of volts."
        [[split.tasks]]
        name = "last run"
        test = ["run4"]
        models = ["pi", "gpi"]
        [[split.tasks.published]]
        what = "Somebody's"
        rmse = 0.5
        [[split.tasks]]
        name = "in turn"
        leave_out = ["run2", "run3"]
        models = ["pi"]
        [[split.tasks]]
        name = "cut"
        files = ["run2"]
        cut = 0.6
        models = ["pi"]
        """
    )
    return tmp_path / "data"


def test_an_optional_task_is_there_with_its_files_and_what_is_not_periodic_stays_whole(
    tmp_path: Path,
) -> None:
    write(recorded(1), tmp_path / "waves.csv")
    (tmp_path / "channels.toml").write_text(
        """
        [split]
        period = 500
        periodic = ["waves"]
        [[split.tasks]]
        name = "sweep"
        optional = true
        test = ["sweep"]
        """
    )
    (waves,) = sets_in(tmp_path)
    assert list(waves.tasks()) == []
    write(recorded(2), tmp_path / "sweep.csv")
    assert [task.name for task in waves.tasks()] == ["sweep"]
    assert sorted(len(run) for run in waves.recordings()) == [500, 500, 500, 1500]


def test_every_task_is_the_comparison_it_says(folder: Path) -> None:
    plain, volts = sets_in(folder)
    done = {one.label: one for one in outcomes([volts], jobs=1)}
    assert list(done) == [
        "By volts: last run",
        "By volts: in turn, without run2",
        "By volts: in turn, without run3",
        "By volts: cut",
    ]
    runs = {run.name: run for run in volts.recordings()}
    np.testing.assert_allclose(runs["run2"]["pressure"], recorded(2)["pressure"], atol=1e-7)
    expected = compare([runs["run2"], runs["run3"]], [runs["run4"]], models=MODELS, jobs=1)
    board = done["By volts: last run"].board
    assert board is not None
    assert [r.test_error for r in board.rows] == [r.test_error for r in expected.rows]
    assert done["By volts: last run"].span == pytest.approx(np.ptp(runs["run4"]["displacement"]))
    train, test = parted(volts.split.tasks[2], list(runs.values()), volts.folder)
    assert [len(run) for run in (*train, *test)] == [900, 600]
    assert plain.title == "plain"


def test_a_set_that_cannot_be_read_is_said_and_the_rest_goes_on(folder: Path) -> None:
    (folder / "plain" / "run.csv").write_text("pressure_bar,displacement_mm\n1,2\n1,x\n")
    done = list(outcomes(sets_in(folder), models=["pi"], jobs=1))
    assert done[0].board is None
    assert "run.csv" in done[0].reason
    assert all(one.board is not None for one in done[1:])
    whole = page(done, "it")
    assert {one.heading for one in whole.sections} > {"plain", "By volts"}
    for text in (whole.markdown(), whole.html()):
        assert "run.csv" in text
        assert "Somebody" in text


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"cuts": 0.5}, "split.cuts"),
        ({"tasks": [{"cut": 1.5}]}, "split.tasks.0.cut"),
        ({"tasks": [{"cut": 0.5, "test": ["a"]}]}, "test, leave_out and cut"),
        ({"tasks": []}, "split.tasks"),
        ({"tasks": [{"name": "a"}, {"name": "a"}]}, "name"),
        ({"resample": -1.0}, "split.resample"),
        ({"resample": float("nan")}, "split.resample"),
    ],
)
def test_what_cannot_be_a_split_is_refused_by_its_name(given: dict[str, object], said: str) -> None:
    with pytest.raises(DataError, match=r"channels\.toml") as caught:
        split_of(given)
    assert said in str(caught.value)


def test_each_pattern_has_to_match_something(folder: Path) -> None:
    text = (folder / "volts" / "channels.toml").read_text().replace('"run4"', '"run4", "run9"')
    (folder / "volts" / "channels.toml").write_text(text)
    _, volts = sets_in(folder)
    with pytest.raises(DataError, match=r"run9.*run2, run3, run4"):
        parted(volts.split.tasks[0], volts.recordings(), volts.folder)


def test_results_among_recordings_are_refused(cli: Cli, folder: Path) -> None:
    before = sorted(folder.rglob("*"))
    for out in (folder, folder / "volts", folder / "measured"):
        result = cli("measured", folder, "-o", out, "--models", "pi", "--jobs", "1")
        assert result.code == 2
        assert str(folder) in result.err
    assert sorted(folder.rglob("*")) == before
