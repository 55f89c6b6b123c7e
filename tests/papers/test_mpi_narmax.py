"""A muscle under a varying load: what the re-run claims."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mckibben.papers.experiment import reproduce
from mckibben.papers.mpi_narmax.run import ALL_RATES, AS_PRINTED, OURS, PLAIN
from mckibben.papers.paper import paper
from tests.papers.test_figures import pictures
from tests.report.legible import assert_readable

Rows = dict[str, dict[str, Any]]
Waves = dict[str, np.ndarray]

PRINTED = ("MPI-1", "MPI-2", "MPI-3")


def by_key(found: dict[str, Any], key: str) -> Rows:
    """Return the rows of a table by their names."""
    rows = next(table["rows"] for table in found["tables"] if table["key"] == key)
    return {str(next(iter(row.values()))): row for row in rows}


@pytest.mark.long
def test_the_force_beats_models_without_and_all_rates_make_the_better_front() -> None:
    whole = reproduce("mpi-narmax", quick=True)
    for picture in pictures(whole):
        assert_readable(picture)
    found = whole.to_dict()
    off = by_key(found, "errors")
    for where in ("status 4", "random", "held"):
        assert off[ALL_RATES][f"{where}, RMSE"] < 0.8 * off[AS_PRINTED][f"{where}, RMSE"]
    blind = [name for name in off if name[4].isdigit()]
    assert blind == [f"{name}{whose}" for name in PRINTED for whose in ("", ", ours")]
    best = min(off[name]["status 4, MAE"] for name in blind)
    assert best / off[ALL_RATES]["status 4, MAE"] > 3.0  # printed: 3.9 times
    for name in (PLAIN, OURS):
        assert off[name]["status 4, MAE"] < 0.33 * best
    held = by_key(found, "held")
    for name in blind:
        assert not any(value for key, value in held[name].items() if key.startswith("swing at"))
    maes = by_key(found, "mae")
    for status, column in paper("mpi-narmax").tables["mae"].printed.items():
        for name, value in column.items():
            assert maes[name][f"{status}, printed"] == value
    assert maes["MPI-1"]["status 3"] == pytest.approx(10.0609, rel=0.1)
    assert maes["MPI-2"]["status 3"] == pytest.approx(3.2333, rel=0.35)
    for k, name in enumerate(PRINTED, start=1):  # the printed form has more to choose
        assert maes[name][f"status {k}"] < maes[f"{name}, ours"][f"status {k}"]
    past = {key: row["past the fold [%]"] for key, row in by_key(found, "folded").items()}
    assert past["0.05"] == past["0.1"] == 0.0 < past["0.2"] < past["0.22"]
    constants = by_key(found, "constants")
    assert [row["r"] for row in constants.values()] == sorted(
        row["r"] for row in constants.values()
    )
    assert (constants["1"]["k, printed"], constants["10"]["a, printed"]) == (3.5838, 0.0)
    models = by_key(found, "models")
    assert 40 <= models["MPI-1"]["parameters"] <= 42
    force = by_key(found, "force")["status-4"]
    assert force["RMSE [N]"] < 0.1 * force["range [N]"]
