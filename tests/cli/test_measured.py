"""Folders of recordings to one page: splits, tasks, figures, bad descriptions."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from mckibben import GPI, DataError, Recording, compare, read, write
from mckibben.measured.page import page
from mckibben.measured.running import outcomes
from mckibben.measured.scoring import KEYS, START_SAMPLES, entries
from mckibben.measured.sets import fit_and_test_data, sets_in, split_of
from mckibben.signals import irregular_triangle
from tests.cli.conftest import Cli
from tests.refusals import refused

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
    train, test = fit_and_test_data(volts.split.tasks[2], list(runs.values()), volts.folder)
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
        ({"tasks": [{"cut": 0.5, "test": ["a"]}]}, "leave_out"),
        ({"tasks": []}, "split.tasks"),
        ({"tasks": [{"name": "a"}, {"name": "a"}]}, "name"),
        ({"resample": -1.0}, "split.resample"),
        ({"resample": float("nan")}, "split.resample"),
    ],
)
def test_what_cannot_be_a_split_is_refused_by_its_name(given: dict[str, object], said: str) -> None:
    with refused(DataError, file="channels.toml", names=said):
        split_of(given)


def test_each_pattern_has_to_match_something(folder: Path) -> None:
    text = (folder / "volts" / "channels.toml").read_text().replace('"run4"', '"run4", "run9"')
    (folder / "volts" / "channels.toml").write_text(text)
    _, volts = sets_in(folder)
    with refused(DataError, file=folder / "volts", names=("run9", "run2", "run3", "run4")):
        fit_and_test_data(volts.split.tasks[0], volts.recordings(), volts.folder)


def test_results_among_recordings_are_refused(cli: Cli, folder: Path) -> None:
    before = sorted(folder.rglob("*"))
    for out in (folder, folder / "volts", folder / "measured"):
        result = cli("measured", folder, "-o", out, "--models", "pi", "--jobs", "1")
        assert result.code == 2
        assert str(folder) in result.err
    assert sorted(folder.rglob("*")) == before


def predictions(folder: Path, task: str, names: list[str], first: int = 0) -> pd.DataFrame:
    """Return the true outputs of recordings of the set "volts" as predictions."""
    (volts,) = (one for one in sets_in(folder) if one.name == "volts")
    frames = []
    for run in volts.recordings():
        if run.name in names:
            y = run["displacement"][first:]
            keys = {"set": "volts", "task": task, "recording": run.name, "row": np.arange(len(y))}
            frames.append(pd.DataFrame(keys | {"displacement": y}))
    return pd.concat(frames)


def scored(folder: Path, tmp_path: Path, given: pd.DataFrame) -> list[tuple[str, float, float]]:
    file = tmp_path / "mine.csv"
    given.to_csv(file, index=False)
    return [(one.task, one.rmse, one.width or 0.0) for one in entries(file, sets_in(folder))]


def test_exact_predictions_have_no_error_and_all_of_the_width(folder: Path, tmp_path: Path) -> None:
    every = [
        predictions(folder, "last run", ["run4"]),
        predictions(folder, "in turn", ["run2", "run3"]),
        predictions(folder, "cut", ["run2"], first=900),
    ]
    found = scored(folder, tmp_path, pd.concat(every))
    assert [task for task, *_ in found] == ["last run", "in turn", "cut"]
    for _, rmse, width in found:
        assert rmse == pytest.approx(0.0, abs=1e-9)
        assert width == pytest.approx(100.0)


def test_an_error_is_over_the_scored_rows_of_all_that_is_left_out(
    folder: Path, tmp_path: Path
) -> None:
    given = predictions(folder, "in turn", ["run2", "run3"])
    given.loc[given["row"] < START_SAMPLES, "displacement"] = np.nan  # not scored, may be absent
    given.loc[given["recording"] == "run3", "displacement"] += 0.3
    ((_, rmse, width),) = scored(folder, tmp_path, given)
    assert rmse == pytest.approx(0.3 / np.sqrt(2))
    assert width == pytest.approx(100.0)


def test_a_cut_recording_begins_anew_and_is_scored_as_others(folder: Path, tmp_path: Path) -> None:
    given = predictions(folder, "cut", ["run2"], first=900)
    given.loc[given["row"] == START_SAMPLES - 1, "displacement"] += 3.0
    given.loc[given["row"] == START_SAMPLES, "displacement"] += 1.0
    ((_, rmse, _),) = scored(folder, tmp_path, given)
    assert rmse == pytest.approx(1.0 / np.sqrt(600 - START_SAMPLES))


def test_the_metrics_are_those_of_the_comparison(folder: Path, tmp_path: Path) -> None:
    runs = [recorded(seed) for seed in (2, 3, 4)]
    row = compare(runs[:2], [runs[2]], models=["gpi"], jobs=1).rows[0]
    assert row.block is not None
    assert row.test is not None
    assert row.memory is not None
    given = predictions(folder, "last run", ["run4"])
    given["displacement"] = row.block.simulate(runs[2])["displacement"]
    ((_, rmse, width),) = scored(folder, tmp_path, given)
    assert rmse == pytest.approx(row.test.rmse, rel=0.05)  # without the start
    assert width == pytest.approx(100 * (row.memory.gap_ratio or 0.0), abs=2.0)
    line = np.polynomial.Polynomial.fit(runs[2]["pressure"], runs[2]["displacement"], 1)
    given["displacement"] = line(runs[2]["pressure"])
    ((_, _, none),) = scored(folder, tmp_path, given)
    assert none == pytest.approx(0.0, abs=1.0)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda rows: rows[rows["row"] != 700], "run4"),
        (lambda rows: rows.assign(displacement=np.inf), "run4"),
        (lambda rows: rows.drop(columns="displacement"), "displacement"),
        (lambda rows: rows.drop(columns="row"), "row"),
        (lambda rows: pd.concat([rows, rows[-1:]]), "twice"),
        (lambda rows: rows.assign(set="other"), "volts"),
        (lambda rows: rows.assign(task="other"), "tasks"),
    ],
)
def test_predictions_that_are_not_whole_are_refused(
    folder: Path, tmp_path: Path, change: Callable[[pd.DataFrame], pd.DataFrame], said: str
) -> None:
    with refused(DataError, file=tmp_path / "mine.csv", names=said):
        scored(folder, tmp_path, change(predictions(folder, "last run", ["run4"])))


def test_splits_are_written_and_predictions_of_them_scored_in_lines(
    cli: Cli, folder: Path, tmp_path: Path
) -> None:
    out = tmp_path / "splits"
    assert cli("measured", folder, "--only", "volts", "--splits", out).code == 0
    assert sorted(path.name for path in (out / "volts").iterdir()) == [
        *("cut", "in turn without run2", "in turn without run3", "last run"),
    ]
    (test,) = read(out / "volts" / "cut" / "test" / "run2.csv")
    assert len(test) == 600
    keys = {"set": "volts", "task": "cut", "recording": test.name, "row": np.arange(600)}
    file = tmp_path / "mine.csv"
    rows = pd.DataFrame(keys | {"displacement": test["displacement"] + 0.1})
    rows.to_csv(file, index=False)
    assert [*rows][:4] == [*KEYS]
    result = cli("measured", folder, "--only", "volts", "--score", file)
    assert result.code == 0
    head, line = result.out.splitlines()[:2]
    found = dict(zip(head.split(","), line.split(","), strict=True))
    assert (found["model"], found["set"], found["unit"]) == ("mine", "volts", "mm")
    assert float(found["rmse"]) == pytest.approx(0.1)
    assert float(found["width"]) == pytest.approx(100.0)
