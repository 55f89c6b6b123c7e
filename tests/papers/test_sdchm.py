"""The soft arm's re-run: on the paper's rig, and on recordings of another arm."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mckibben import Recording
from mckibben.errors import DataError, DataWarning
from mckibben.papers.experiment import Reproduction, Runs, reproduce
from mckibben.papers.sdchm.loops import (
    BALANCE,
    EXTENSOR,
    OURS,
    PUBLISHED,
    SDIHC,
    SDIHC_OURS,
    held,
    widths,
)
from mckibben.papers.sdchm.protocol import TEST, quick
from mckibben.papers.sdchm.run import DAMPED, LINEAR, by_group, sort
from mckibben.rigs import load_rig, record
from mckibben.signals.protocol import Protocol, protocol

OUTPUTS = ("displacement_1", "displacement_2", "displacement_3")


def rows(found: Reproduction, key: str) -> dict[str, dict[str, Any]]:
    """Return the rows of a table by their first cells."""
    (table,) = (table for table in found.tables if table.key == key)
    return {str(row[0]): dict(zip(table.columns, row, strict=True)) for row in table.rows}


def unlabelled(plan: Protocol) -> list[Recording]:
    """Return a protocol's pressures as recordings, with noise; displacements are the pressures'."""
    rng = np.random.default_rng(0)
    made = []
    for run in plan.runs:
        names = run.inputs.channels
        channels = {n: run.inputs[n] + 0.01 * rng.standard_normal(len(run.inputs)) for n in names}
        moved = {f"displacement_{k}": 20.0 * channels[f"pressure_{k}"] for k in (1, 2, 3)}
        made.append(Recording(channels | moved, run.inputs.sample_time))
    return made


def test_sorting_gives_the_labels_of_the_protocol() -> None:
    plan = protocol("sdchm")
    found = sort(unlabelled(plan))
    for run, labels in zip(plan.runs, found, strict=True):
        assert labels is not None
        expected = dict(run.labels)
        if expected.get("extensor") == "moving":
            expected["p0"] = labels.labels["p0"]
        assert labels.labels == expected, run.name
    roles = {one.role for one in found if one and one.labels["stage"] == "network"}
    assert roles == {"train", "validation", "test"}
    ends = [one for one in found if one and one.labels["p0"] in (0.0, 2.5)]
    assert {one.role for one in ends if one.labels["stage"] == "network"} == {"train"}


def test_what_is_missing_is_named() -> None:
    plan = protocol("sdchm")
    alone = replace(plan, runs=tuple(run for run in plan.runs if run.labels["driven"] != "2"))
    with pytest.raises(DataError, match="pressure_2"):
        sort(unlabelled(alone))
    one, *rest = unlabelled(replace(plan, runs=plan.runs[:4]))
    with pytest.raises(DataError, match=EXTENSOR):
        sort([*rest, one.select([name for name in one.channels if name != EXTENSOR])])


def test_groups_are_lettered_as_in_the_paper() -> None:
    plan = protocol("sdchm")
    names = [run.name for run in plan.select(stage="prediction", p0=0.1)]
    data = unlabelled(replace(plan, runs=tuple(plan[name] for name in names)))
    labels = [one for one in sort(unlabelled(plan)) if one and one.labels["stage"] == "prediction"]
    runs = Runs(dict(zip(names, data, strict=True)), dict(zip(names, labels, strict=False)))
    groups = [group for _, group, *_ in by_group(runs, names)]
    assert [group[:3] for group in groups] == [f"({letter})" for letter in "abcdefghijkl"]
    assert (groups[1], groups[11]) == ("(b) p1, y2", "(l) p1 p2 p3, y3")


def test_widths_are_of_the_own_range_and_of_the_range_that_moves() -> None:
    time = np.asarray(np.arange(0.0, 150.0, 0.05), dtype=np.float64)
    reference = held(OUTPUTS, OUTPUTS[0], time, 0.7).reference
    late = 2 * np.pi * 0.02 * time - 0.1
    channels = {f"reference_{y}": reference[y] for y in OUTPUTS}
    channels |= {OUTPUTS[0]: 3 * np.sin(late), OUTPUTS[1]: np.sin(late), OUTPUTS[2]: 0 * time}
    found = widths(Recording(channels, 0.05), OUTPUTS[0], OUTPUTS)
    width = 100 * np.sin(0.1)
    assert found["e_w of y1 [%]"] == pytest.approx(width, rel=0.01)
    assert found["cross-motion of y2 [%]"] == pytest.approx(width * 2 / 12, rel=0.01)
    assert found["cross-motion of y3 [%]"] == 0.0


@pytest.mark.long
def test_on_the_rig_of_the_paper() -> None:
    """Along the patterns the order is the paper's; what is printed has no damping elsewhere."""
    found = reproduce("sdchm", quick=True, jobs=1)
    worst = {
        name: max(row[f"RMSE of y{k} [mm]"] for k in (1, 2, 3))
        for name, row in rows(found, "constant").items()
    }
    assert min(worst.values()) < 0.6 * worst[LINEAR] < 0.6 * worst[PUBLISHED]
    rmse = {name: row["RMSE of y1 [mm]"] for name, row in rows(found, "along").items()}
    assert rmse[OURS] < rmse[PUBLISHED] < 0.5 * rmse[DAMPED] < 0.5 * rmse[LINEAR]
    groups = rows(found, "groups")
    assert groups["(a) p1, y1"][f"RMSE [mm], {PUBLISHED}, printed"] == 1.17
    assert groups["(l) p1 p2 p3, y3"]["RMSE [mm], raw network, as published, printed"] == 13.64
    assert all(row[f"RMSE [mm], {OURS}"] < 1.5 for row in groups.values())
    gains = rows(found, "gains")
    assert [gains[g]["gain, printed"] for g in ("G21", "G31", "G23")] == [0.1521, 0.5368, 0.2153]
    tracked = rows(found, "tracking_1")
    assert tracked[SDIHC]["e_w of y1 [%], printed"] == 0.58
    assert tracked[SDIHC]["cross-motion of y2 [%], printed"] == 0.87
    for name, limit in ((SDIHC_OURS, 3.0), (BALANCE, 6.0)):
        assert max(rows(found, "task")[name][f"RMSE of y{k} [mm]"] for k in (1, 2, 3)) < limit
    assert {"coupling", "stiffness", "hysteresis", "prediction", "tracking", "task"} <= {
        figure.key for figure in found.figures
    }
    assert all(len(figure.panels) == 12 for figure in found.figures if figure.key == "coupling")


@pytest.mark.long
def test_on_recordings_of_another_arm() -> None:
    """Another length, diameter and range of pressure; fewer recordings; no labels but their channels."""
    sizes = {"muscle.length": 400.0, "muscle.diameter": 25.0, "extensor.length": 400.0}
    arm = load_rig("soft-arm").changed({"range.pressure.high": 2.0, **sizes})
    plan, _ = quick()
    chosen = ("network-p0-0.0", f"network-p0-{TEST[1]}", "network-p0-1.8", "coupling-drive-1")
    names = [run.name for run in plan.runs if run.name.startswith(chosen)]
    with pytest.warns(DataWarning, match="limited to 0 to 2 bar"):
        data = [
            Recording({name: one[name] for name in one.channels}, one.sample_time)
            for _, one in record(plan, arm, runs=names, jobs=1)
        ]
    found = reproduce("sdchm", data=data, quick=True, jobs=1)
    errors = {name: row["RMSE of y1 [mm]"] for name, row in rows(found, "along").items()}
    assert errors[BALANCE] < 0.3 * errors[LINEAR]
    assert {table.key for table in found.tables} == {
        *("coupling", "stiffness", "orders", "gains", "identification"),
        *("along", "groups", "levels"),
    }
    assert not any("random" in sentence for sentence in found.summary)
