"""The re-run of the activation-pressure paper, on small data, against what it prints."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.cli.conftest import Cli
from tests.cli.conftest import cli as cli  # a fixture

pytestmark = pytest.mark.long


def table(found: dict[str, Any], title: str) -> list[dict[str, Any]]:
    rows: list[list[dict[str, Any]]] = [
        table["rows"] for table in found["tables"] if table["title"].startswith(title)
    ]
    assert len(rows) == 1, title
    return rows[0]


def cells(rows: list[dict[str, Any]], whose: str) -> list[float]:
    return [row[name] for row in rows for name in row if name.startswith(whose)]


def test_the_static_profile_is_as_printed_and_both_models_predict(cli: Cli, tmp_path: Path) -> None:
    result = cli("reproduce", "activation-pressure", "--quick", "-o", tmp_path / "run", "--json")
    assert result.code == 0, result.err
    found = json.loads(result.out)

    points = table(found, "Characteristic points")
    assert len(points) == 6
    for row in points:
        assert row["e_3"] < row["e_1"] < row["e_2"] < row["e_4"], row
        assert row["y_3 [bar]"] < row["y_1 [bar]"] < row["y_2 [bar]"] < row["y_4 [bar]"], row
    for printed, here in zip(points[::2], points[1::2], strict=True):
        assert (printed["whose"], here["whose"]) == ("printed", "here")
        assert here["static RMSE [bar]"] < 1.1 * printed["static RMSE [bar]"] + 0.1
        for quantity in ("e_3", "e_1", "e_2", "e_4"):
            assert here[quantity] == pytest.approx(printed[quantity], abs=0.025), quantity
    for boundary in ("y_3 [bar]", "y_4 [bar]"):
        values = [row[boundary] for row in points[1::2]]
        assert max(values) - min(values) < 1e-9
        assert values[0] == pytest.approx(points[0][boundary], abs=0.1)

    for title, worst in (("sines", 10.0), ("random waves", 10.0)):
        assert max(cells(table(found, f"RMSE [% of range] on {title}"), "the paper's")) < worst
        assert max(cells(table(found, f"RMSE [% of range] on {title}"), "ours")) < 6.0
        assert min(cells(table(found, f"Correlation on {title}"), "the paper's")) > 0.875
    rates = {row["quantity"]: row for row in table(found, "Extracted hysteresis")}
    assert rates["slope of gamma [1/Hz]"]["printed"] == pytest.approx(0.267, abs=0.001)
    assert 0.1 < rates["slope of gamma [1/Hz]"]["here"] < 0.4

    assert json.loads((tmp_path / "run" / "tables.json").read_text()) == found
