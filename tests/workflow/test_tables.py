"""Every cell of every table equals the attribute that its heading names, in the unit beside it."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mckibben
from mckibben import Recording
from mckibben.blocks.equations import quantities
from mckibben.diagnosis.characterization import Characterization
from mckibben.report import text
from mckibben.report.builder import Table
from mckibben.report.columns import columns_of_board
from mckibben.report.results import FACES, board_table
from mckibben.signals.lags import lags
from mckibben.simulation import Simulation
from tests.workflow.calls import prepare


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    place, before = tmp_path_factory.mktemp("tables"), Path.cwd()
    prepare(place)
    os.chdir(place)
    yield place
    os.chdir(before)


def tables(found: Any) -> list[list[dict[str, str]]]:
    """Return the tables that a terminal prints of a result: rows of cells by heading."""
    return [
        printed(item)
        for item in FACES[found.face](found)
        if isinstance(item, Table)
    ]  # fmt: skip


def printed(table: Table) -> list[dict[str, str]]:
    """Return the rows of a table as a terminal prints them."""
    head, *lines = text.table(table).splitlines()
    starts = [head.index(one) for one in table.headings]
    ends = [start + len(one) for start, one in zip(starts, table.headings, strict=True)]
    rows = []
    for line in lines:
        words = [(m.start(), m.end(), m.group()) for m in re.finditer(r"\S+(?: \S+)*", line)]
        row = dict.fromkeys(table.headings, "")
        for start, end, word in words:  # the heading that it stands under
            over = [min(end, b) - max(start, a) for a, b in zip(starts, ends, strict=True)]
            row[table.headings[int(np.argmax(over))]] = word
        rows.append(row)
    return rows


def agrees(cell: str, value: Any) -> bool:
    """Return whether a cell shows a value, within the digits that it has."""
    if value is None or (isinstance(value, float) and not np.isfinite(value)):
        return cell in ("–", "-", "")
    if isinstance(value, str):
        return cell == value
    if isinstance(value, Sequence):
        return all(agrees(one, end) for one, end in zip(cell.split(" to "), value, strict=True))
    number = re.match(r"[-−]?[\d.]+(?:e[-+]?\d+)?", cell.replace("−", "-"))
    assert number is not None, cell
    digits = number[0].partition("e")[0].partition(".")[2]
    power = float(number[0].partition("e")[2] or 0)
    return abs(float(number[0]) - value) <= 0.51 * 10.0 ** (power - len(digits))


def expect(rows: Sequence[Mapping[str, str]], wanted: Sequence[Mapping[str, Any]]) -> None:
    """Compare printed rows with values by heading; every heading has one."""
    assert len(rows) == len(wanted)
    for row, values in zip(rows, wanted, strict=True):
        assert row.keys() == values.keys()
        for heading, cell in row.items():
            assert agrees(cell, values[heading]), (heading, cell, values[heading])


def test_recordings(folder: Path) -> None:
    found = mckibben.info(folder / "run.csv")
    run = found.recordings[0]
    late = {name: run.step * lag.samples for name, lag in lags(run).items()}
    wanted = [
        {"Channel": name, "Unit": run.units[name] or "–", "Lowest": float(x.min()),
         "Highest": float(x.max()), "Rate [Hz]": 1 / run.step, "Lag [s]": late.get(name, "–")}
        for name, x in run.channels.items()
    ]  # fmt: skip
    columns, channels = tables(found)[:2]
    expect(channels, wanted)
    seen = found.columns[str(folder / "run.csv")]
    assert [row["Column"] for row in columns] == [one.header for one in seen]
    assert [row["Read as"] for row in columns] == [one.channel or "–" for one in seen]
    assert [row["Unit"] for row in columns] == [one.unit or "–" for one in seen]
    frame = found.to_frame()
    assert list(frame["channel"]) == list(run.channels)
    assert list(frame["unit"]) == list(run.units.values())
    assert list(frame["min"]) == [x.min() for x in run.channels.values()]
    assert list(frame["max"]) == [x.max() for x in run.channels.values()]


def test_parameters_of_a_fit(folder: Path) -> None:
    found = mckibben.fit("gpi", folder / "run.csv")
    known, block = found.estimator.diagnostics_, found.model
    names, units = zip(*((one.name, one.unit) for one in quantities(block)), strict=True)
    values, errors = block.pack(), known.standard_errors
    (rows,) = tables(found)
    expect(rows, [
        {"Parameter": name, "Value": float(value), "Standard error": error, "Unit": unit}
        for name, value, error, unit in zip(names, values, errors, units, strict=True)
    ])  # fmt: skip
    frame = found.to_frame()
    assert list(frame["parameter"]) == list(names)
    assert list(frame["value"]) == list(values)
    np.testing.assert_array_equal(frame["standard_error"], errors)
    assert list(frame["unit"]) == list(units)
    said = str(found).splitlines()[0]
    for number, unit in ((known.rmse, "mm"), (known.seconds, "s")):
        near = re.findall(rf"([\d.]+) {unit}\b", said)
        assert any(agrees(one, float(number)) for one in near), said
    assert {known.n_samples, known.n_free} <= {*map(int, re.findall(r"\b\d+\b", said))}


def test_errors_of_a_simulation() -> None:
    channels: Any = {"pressure": np.arange(3.0), "displacement": np.arange(3.0) ** 2}
    run = Recording(channels, 0.1)
    errors = {"rmse": 2.003, "mae": 3.005, "max_error": 5.007, "r2": 0.7011,
              "coverage": 0.8713, "band_width": 1.319}  # fmt: skip
    found = Simulation(run, {"displacement": errors}, 0.9, ())
    (rows,) = tables(found)
    expect(rows, [{"output": "displacement [mm]", "RMSE": 2.003, "MAE": 3.005, "Largest": 5.007,
                   "R²": 0.7011}])  # fmt: skip
    said = " ".join(str(found).split())
    assert "90.0 %" in said
    assert "87.1 %" in said
    assert "1.32 mm" in said


def test_errors_of_loops(folder: Path) -> None:
    given: Any = {"plant": "model.json", "approach": 1.0}
    found = mckibben.track("inverse.json", "short.csv", **given)
    tracked = replace(found.tracked, rmse={"displacement": 2.003},
                      largest={"displacement": 3.005}, clipped=7)  # fmt: skip
    assert found.uncompensated.tracked is not None
    other = replace(found.uncompensated.tracked, rmse={"displacement": 11.013},
                    largest={"displacement": 13.017}, clipped=19)  # fmt: skip
    found = replace(found, tracked=tracked,
                    uncompensated=replace(found.uncompensated, tracked=other))  # fmt: skip
    wanted = [("feedforward", 2.003, 3.005, 7), ("no compensation", 11.013, 13.017, 19)]
    (rows,) = tables(found)
    expect(rows, [
        {"Controller": name, "Output": "displacement", "RMSE": rmse, "Largest": largest,
         "Unit": "mm", "Samples clipped": clipped}
        for name, rmse, largest, clipped in wanted
    ])  # fmt: skip
    frame = found.to_frame()
    assert [tuple(row) for row in frame[["controller", "rmse", "largest"]].to_numpy()] == [
        one[:3] for one in wanted
    ]


def test_repetitions(folder: Path) -> None:
    given: Any = {"repeats": True}
    found = mckibben.learn("inverse.json", ["log.csv", "log2.csv"], **given)
    found = replace(found, rmse={"displacement": (2.003, 3.005)})
    (rows,) = tables(found)
    expect(rows, [{"Repetition": 0, "RMSE displacement": 2.003},
                  {"Repetition": 1, "RMSE displacement": 3.005}])  # fmt: skip


def test_width_of_bands(folder: Path) -> None:
    found = mckibben.calibrate("model.json", "run.csv")
    found = replace(found, widths=(2.003,), over_constant=(0.7311,))
    (rows,) = tables(found)
    expect(rows, [{"Output": "displacement", "Level": 100 * found.band.level,
                   "Width of its band": 2.003, "Unit": "mm",
                   "Of one of constant width": 73.11}])  # fmt: skip


def test_causes_of_a_residual(folder: Path) -> None:
    found = mckibben.check("pi.json", ["run.csv", "two.csv"])
    (one,) = found.outputs
    assert any(cause.share != cause.size for cause in one.suspects)
    every = [each for each in (one.missing, one.suspects) if each]
    for rows, causes in zip(tables(found), every, strict=True):
        for row, cause in zip(rows, causes, strict=True):
            assert agrees(row["Share explained [%]"], 100.0 * cause.share)
            assert agrees(row[f"RMS [{one.unit}]"], cause.size)
    frame = found.to_frame()
    assert list(frame["share"]) == [cause.share for cause in one.suspects]
    assert list(frame["size"]) == [cause.size for cause in one.suspects]


NAMES = {"n_recordings": "recordings", "n_samples": "samples", "n_cycles": "cycles",
         "n_reversals": "reversals", "duration": "duration", "sample_time": "sample time",
         "input_noise": "noise of pressure", "output_noise": "noise of displacement",
         "loop_share": "variance explained", "p_loop": "p of loop", "loop_width": "loop width e_w",
         "mid_width": "branch distance at mid input", "asymmetry": "asymmetry",
         "width_centroid": "centre of width", "loop_area": "loop area",
         "loop_area_share": "loop area share", "branch_gap": "mean branch gap",
         "dead_zone_upper": "dead zone after upper reversals",
         "dead_zone_lower": "dead zone after lower reversals", "gain": "gain", "creep": "creep",
         "creep_time": "creep time", "drift": "drift", "rate_dependence": "rate dependence"}  # fmt: skip
UNITS = {"duration": "s", "sample_time": "s", "input_noise": "bar", "output_noise": "mm",
         "loop_width": "%", "mid_width": "mm", "asymmetry": "%", "loop_area": "bar mm",
         "loop_area_share": "%", "branch_gap": "mm", "dead_zone_upper": "bar",
         "dead_zone_lower": "bar", "gain": "mm/bar", "creep": "mm", "creep_time": "s", "drift": "mm",
         "rate_dependence": "%"}  # fmt: skip


def test_quantities_of_a_characterization(folder: Path) -> None:
    found = mckibben.characterize("run.csv")
    assert NAMES.keys() <= {one.name for one in fields(Characterization)}
    primes = [p for p in range(101, 400) if all(p % k for k in range(2, 20))]
    values: dict[str, Any] = {
        name: p if name.startswith("n_") else p / 100
        for name, p in zip(NAMES, primes, strict=False)
    }
    ends = {name: (v * 1.01, v * 1.07) for name, v in values.items() if not name.startswith("n_")}
    found = replace(found, **values, intervals=ends)
    (rows,) = tables(found)
    by_name = {row["Quantity"]: row for row in rows}
    for name, heading in NAMES.items():
        row = by_name[heading]
        assert agrees(row["Value"], values[name]), (name, row)
        assert row["Unit"] == UNITS.get(name, ""), (name, row)
        if name in ends and row["95 % interval"]:
            assert agrees(row["95 % interval"], ends[name]), (name, row)
    for which, of in (("lowest", min), ("highest", max)):
        for channel in ("input", "output"):
            row = by_name[f"{which} {getattr(found, channel)}"]
            assert agrees(row["Value"], of(getattr(found, f"{channel}_range")))
    frame = found.to_frame()
    for column in frame:
        assert list(frame[column]) == [getattr(one, column) for one in found.cycles]


PATHS = {
    "fit RMSE": ("train", "rmse"),"minus the chosen’s": ("test", "difference_to_chosen_interval"),
         "test RMSE": ("test", "rmse"), "95 % interval": ("test", "rmse_interval"),
         "rank": ("test", "rank"), "worst": ("test", "max_error"), "R²": ("test", "r2"),
         "width reproduced": ("memory", "gap_ratio"), "width held": ("memory", "hold_ratio"),
         "parameters": ("n_parameters",), "fit time": ("fit_seconds",), "step": ("step_ns",),
         "inverse": ("inverse",), "validation RMSE": ("validation_rmse",),
         "CV RMSE": ("validation_rmse",), "train RMSE": ("train", "rmse")}  # fmt: skip


def test_columns_of_a_leaderboard(folder: Path) -> None:
    given: Any = {"models": "pi,gpi", "jobs": 1}
    board = mckibben.compare("run.csv", "two.csv", **given)
    columns = columns_of_board(board)
    ranking = list(board.ranking)
    halves = [
        [one.key for one in some] for some in (columns[:6], columns[6:])
    ]  # of a wide terminal
    parts = [printed(board_table(board, ranking, keys)) for keys in halves]
    rows = [one | other for one, other in zip(*parts, strict=True)]
    frame = board.to_frame().to_dict("records")
    for shown, row, of_frame in zip(rows, ranking, frame, strict=True):
        assert shown["Model"].split()[0].rstrip("*") == row.model == of_frame["model"]
        given = row.to_dict()
        for column in columns:
            value: Any = given
            assert column.heading in PATHS, column.heading
            for name in PATHS[column.heading]:
                value = None if value is None else value.get(name)
            assert column.unit == {"R²": "%", "width reproduced": "%", "width held": "%", "rank": "",
                "parameters": "", "inverse": "", "fit time": "s", "step": "ns"}.get(
                    column.heading, "mm")  # fmt: skip
            if column.unit == "%" and value is not None:
                value = 100.0 * value
            if column.heading == "R²" and value is not None and value < 0:
                continue  # "below 0"
            assert agrees(shown[column.label], value), (column.label, shown, value)


def test_steps_of_a_plan(folder: Path) -> None:
    given: Any = {"minutes": 1.0}
    found = mckibben.plan("run.csv", **given)
    (rows,) = tables(found)
    expect(rows, [
        {"Seconds": [one.start, one.stop], "What": one.what, "Closes": ", ".join(one.gaps) or "–"}
        for one in found.steps
    ])  # fmt: skip
    assert [one.start for one in found.steps] == sorted(one.start for one in found.steps)
