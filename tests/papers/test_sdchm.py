"""The soft arm's re-run: on the paper's rig, and on recordings of another arm."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mckibben import Recording
from mckibben.papers.experiment import Reproduction, reproduce
from mckibben.papers.sdchm.loops import (
    BALANCE,
    OURS,
    PUBLISHED,
    SDIHC,
    SDIHC_OURS,
    single_task,
    widths,
)
from mckibben.papers.sdchm.protocol import strength
from mckibben.papers.sdchm.run import DAMPED, LINEAR
from mckibben.rigs import load_rig
from tests.papers.test_figures import pictures
from tests.report.legible import assert_readable

OUTPUTS = ("displacement_1", "displacement_2", "displacement_3")


def rows(found: Reproduction, key: str) -> dict[str, dict[str, Any]]:
    """Return the rows of a table by their first cells."""
    (table,) = (table for table in found.tables if table.key == key)
    return {str(row[0]): dict(zip(table.columns, row, strict=True)) for row in table.rows}


def test_widths_are_of_the_own_range_and_of_the_range_that_moves() -> None:
    time = np.asarray(np.arange(0.0, 150.0, 0.05), dtype=np.float64)
    reference = single_task(OUTPUTS, OUTPUTS[0], time, 0.7).reference
    late = 2 * np.pi * 0.02 * time - 0.1
    channels = {f"reference_{y}": reference[y] for y in OUTPUTS}
    channels |= {OUTPUTS[0]: 3 * np.sin(late), OUTPUTS[1]: np.sin(late), OUTPUTS[2]: 0 * time}
    found = widths(Recording(channels, 0.05), OUTPUTS[0], OUTPUTS)
    width = 100 * np.sin(0.1)
    assert found["e_w of y1 [%]"] == pytest.approx(width, rel=0.01)
    assert found["cross-motion of y2 [%]"] == pytest.approx(width * 2 / 12, rel=0.01)
    assert found["cross-motion of y3 [%]"] == 0.0


def test_loads_are_in_proportion_to_the_muscles() -> None:
    rig = load_rig("soft-arm")
    smaller = rig.changed({"range.pressure.high": 1.25, "muscle.diameter": 15.0})
    assert (strength(rig), strength(smaller)) == (1.0, 0.125)


@pytest.mark.long
def test_on_the_rig_of_the_paper() -> None:
    """Along the patterns the order is the paper's; what is printed has no damping elsewhere."""
    found = reproduce("sdchm", quick=True, jobs=1)
    for picture in pictures(found):
        assert_readable(picture)
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
