"""Write the tables of leaderboard.md from leaderboard.csv: python docs/measured/leaderboard.py."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pandas as pd

from mckibben.measured.sets import KNOWN, split_of
from mckibben.numerals import numeral

HERE = Path(__file__).parent

TABLES = "<!-- tables -->\n"
"""End of the page's introduction."""


def table(lines: pd.DataFrame) -> str:
    """Return the table of a task, sorted by error."""
    unit = lines["unit"].iloc[0]
    rows = [
        f"| model | free-run error [{unit}] | of range [%] | width reproduced [%] | settings |",
        "|---|---:|---:|---:|---|",
    ]
    for line in lines.sort_values("rmse").itertuples():
        cells = [numeral(value, 3) for value in (line.rmse, line.percent)]
        width = numeral(line.width, 3)
        rows.append(f"| {line.model} | {' | '.join(cells)} | {width} | {line.how} |")
    return "\n".join(rows)


def main() -> None:
    """Rewrite the tables of the page, and leave its introduction."""
    page = HERE / "leaderboard.md"
    lines = pd.read_csv(HERE / "leaderboard.csv").fillna({"task": "", "how": ""})
    parts = [page.read_text(encoding="utf-8").partition(TABLES)[0] + TABLES]
    for name, own in lines.groupby("set", sort=True):
        split = split_of(tomllib.loads((KNOWN / f"{name}.toml").read_text()).get("split"))
        parts.append(f"## {split.title or name}\n\n`{name}`")
        for task in split.tasks:
            of_task = own[own["task"] == task.name]
            if not of_task.empty:
                parts.append(
                    f"### {task.name}\n\n{table(of_task)}" if task.name else table(of_task)
                )
    page.write_text("\n\n".join(part.strip() for part in parts) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
