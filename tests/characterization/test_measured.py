"""Characterization of measured muscles, where their recordings are at hand."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from numpy.typing import NDArray

from mckibben import Recording
from mckibben.characterization import characterize
from tests.recordings import MEASURED

Array = NDArray[np.float64]


def run(u: Array, y: Array, step: float | None) -> Recording:
    """Return a recording of pressure and displacement."""
    return Recording({"pressure": u, "displacement": y}, step)


def read(name: str, pressure: str, displacement: str) -> tuple[Array, Array, Array]:
    """Return time (or sample numbers), pressure and displacement of a real recording."""
    path = MEASURED / f"{name}.csv"
    if not path.exists():
        pytest.skip("the measured recordings are not here")
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    columns = [np.array([float(row[name]) for row in rows]) for name in (pressure, displacement)]
    timed = "time_s" in rows[0]
    t = [float(row["time_s"]) if timed else number for number, row in enumerate(rows)]
    return np.array(t, dtype=float), *columns  # type: ignore[return-value]


def test_a_real_quasi_static_muscle() -> None:
    _, u, y = read("festo_dmsp10_static/festo_dmsp10_static", "pressure_bar", "displacement_mm")
    found = characterize(run(u, y, None))
    assert found.n_cycles == 3
    assert [14 < cycle.width < 17 for cycle in found.cycles] == [True] * 3
    assert found.gain is not None
    assert 8 < found.gain < 12
    assert found.sentences[0].startswith("Wide (16 %)")


def test_real_levels_are_too_coarse_for_a_loop_but_show_the_gap() -> None:
    t, u, y = read("festo_dmsp10_levels/festo_dmsp10_levels", "pressure_bar", "displacement_mm")
    found = characterize(run(u, y, float(t[1] - t[0])))
    assert found.input_noise is None
    assert found.n_reversals > 100
    assert found.cycles == ()
    assert found.loop_width is found.dead_zone_upper is found.closure_error is None
    assert found.branch_gap == pytest.approx(1.4, abs=0.5)
    assert found.has_loop


@pytest.mark.parametrize(
    "name", ["sample1_load200g", "sample2_load200g", "sample2_load400g", "sample3_load400g"]
)
def test_real_cavatappi_muscles_have_very_wide_loops(name: str) -> None:
    t, psi, y = read(f"cavatappi_loads/{name}", "pressure_psi", "position_mm")
    grid = np.arange(t[0], t[-1], 1e-3)
    u = 0.0689476 * np.interp(grid, t, psi)
    found = characterize(run(u, np.interp(grid, t, y), 1e-3))
    assert 3 <= found.n_cycles <= 7
    assert found.loop_width is not None
    assert 50 < found.loop_width < 90
    assert found.sentences[0].startswith("Very wide")


def test_a_real_recording_in_pieces() -> None:
    t, psi, y = read("cavatappi_loads/sample1_load200g", "pressure_psi", "position_mm")
    cuts = np.flatnonzero(np.diff(t) > 0.0015) + 1
    pieces = zip(np.split(psi, cuts), np.split(y, cuts), strict=True)
    found = characterize([run(u, x, 1e-3) for u, x in pieces if u.size > 9])
    assert found.n_cycles == 0
    assert found.loop_width is None
    assert found.branch_gap is not None
    assert "no whole cycle" in found.sentences[-1]
