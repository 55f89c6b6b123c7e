"""The columns of a leaderboard: what is shown of rows, wherever they are shown."""

from __future__ import annotations

from typing import Any

from mckibben.comparison.columns import columns_of
from mckibben.papers.reproduction import Table

ROW: dict[str, Any] = {
    "model": "pi",
    "validation_rmse": 0.123456,
    "test": {"rmse": 0.25, "r2": 0.98765, "rmse_interval": [0.2, 0.31], "rank": 1},
    "train": None,
    "memory": {"gap_ratio": 0.96, "hold_ratio": 2.45e-14},
    "n_parameters": 12,
}


def shown(row: dict[str, Any], unit: str = "mm") -> dict[str, str]:
    return {column.label: column.text(row) for column in columns_of([row], unit)}


def test_figures_have_units_and_digits_and_rounding_errors_are_nothing() -> None:
    assert shown(ROW) == {
        "CV RMSE [mm]": "0.123",
        "test RMSE [mm]": "0.250",
        "95 % interval [mm]": "0.200 to 0.310",
        "rank": "1",
        "R² [%]": "98.77",
        "gap kept [%]": "96",
        "kept in a hold [%]": "0",
        "parameters": "12",
    }


def test_a_share_of_the_variance_below_nothing_has_no_size() -> None:
    row = ROW | {"test": {"rmse": 0.25, "r2": -24.99}}
    assert shown(row)["R² [%]"] == "below 0"


def test_without_a_unit_there_are_no_brackets() -> None:
    assert "CV RMSE" in shown(ROW, "")


def test_a_column_stays_where_any_row_has_a_figure() -> None:
    failed = {"model": "gpi", "status": "failed", "reason": "too short"}
    columns = columns_of([failed, ROW], "mm")
    assert [column.text(failed) for column in columns] == ["-"] * len(columns)
    assert columns_of([failed], "mm") == ()


def test_each_of_several_outputs_has_its_error() -> None:
    outputs = {"left": {"rmse": 0.1}, "right": {"rmse": 0.4}}
    row = ROW | {"outputs": outputs}
    found = {c.key: c.text(row) for c in columns_of([row], "mm", tuple(outputs), "fit")}
    assert (found["left"], found["right"]) == ("0.100", "0.400")
    assert "chosen" not in found  # without an error on the data fitted, which it is chosen by


def test_tables_are_shown_without_empty_columns() -> None:
    table = Table("t", ("model", "printed", "here"), (("a", None, 1.0), ("b", None, None)))
    assert table.filled().columns == ("model", "here")
    assert table.filled().rows == (("a", 1.0), ("b", None))
