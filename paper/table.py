"""Write the table of the paper from the leaderboard: python paper/table.py."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from mckibben.numerals import numeral

HERE = Path(__file__).parent
BOARD = HERE.parent / "docs" / "measured" / "leaderboard.csv"

ROWS = {
    ("cavatappi_loads", "sample 1, 200 g"): "Coiled muscle, sample 1",
    ("cavatappi_loads", "sample 2, 200 and 400 g"): "Coiled muscle, sample 2",
    ("cavatappi_loads", "sample 3, 200 and 400 g"): "Coiled muscle, sample 3",
    ("festo_dmsp10_levels", ""): "DMSP-10, random levels",
    ("festo_dmsp10_static", ""): "DMSP-10, staircase",
    ("festo_isometric_20mm", "12 cm, run 3"): "DMSP-20, force, 12 cm",
    ("festo_isometric_20mm", "30 cm, run 3"): "DMSP-20, force, 30 cm",
    ("sma_wing", ""): "Shape-memory wing",
    ("soft_arm_three_muscles", ""): "Soft arm, three muscles",
    ("bouc_wen_benchmark", "black"): "Bouc-Wen benchmark, multisine",
    ("bouc_wen_benchmark", "black, sine sweep"): "Bouc-Wen benchmark, sine sweep",
    ("silverbox", "multisine"): "Silverbox, multisine",
    ("cascaded_tanks", ""): "Tanks",
}
"""Set and task -> what it is called."""

BEGIN, END = "<!-- table -->\n", "<!-- docs/measured/leaderboard.csv"


def best(lines: pd.DataFrame) -> str:
    """Return the cells of the model of least error."""
    first = lines.sort_values("rmse").iloc[0]
    return f"{first.model.removeprefix('mckibben ')} | {numeral(float(first.percent), 3)}"


def main() -> None:
    """Rewrite the table, and leave the rest of the paper."""
    board = pd.read_csv(BOARD).fillna({"task": ""})
    rows = [
        "| recordings | `mckibben` | error [%] | other library | error [%] |",
        "|---|---|---:|---|---:|",
    ]
    for (name, task), words in ROWS.items():
        lines = board[(board["set"] == name) & (board["task"] == task)]
        ours = lines["model"].str.startswith("mckibben ")
        rows.append(f"| {words} | {best(lines[ours])} | {best(lines[~ours])} |")
    paper = HERE / "paper.md"
    before, _, rest = paper.read_text(encoding="utf-8").partition(BEGIN)
    _, mark, after = rest.partition(END)
    paper.write_text(before + BEGIN + "\n".join(rows) + "\n" + mark + after, encoding="utf-8")


if __name__ == "__main__":
    main()
