"""Write the tables of leaderboard.md from leaderboard.csv: python docs/measured/leaderboard.py."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from mckibben.measured.sets import KNOWN, Published, split_of
from mckibben.numerals import numeral

HERE = Path(__file__).parent

TABLES = "<!-- tables -->\n"
"""End of the page's introduction."""


def table(lines: pd.DataFrame, published: Sequence[Published]) -> str:
    """Return the table of a task, sorted by error, with published figures in their place."""
    unit = lines["unit"].iloc[0]
    rows = [
        f"| model | free-run error [{unit}] | of range [%] | width reproduced [%] | settings |",
        "|---|---:|---:|---:|---|",
    ]
    found = []
    for line in lines.itertuples():
        cells = [numeral(value, 3) for value in (line.rmse, line.percent, line.width)]
        found.append((line.rmse, f"| {line.model} | {' | '.join(cells)} | {line.how} |"))
    for figure in published:
        source = f"[published]({figure.link})" if figure.link else "published"
        found.append(
            (figure.rmse, f"| *{figure.what}* | {numeral(figure.rmse, 3)} | | | {source} |")
        )
    return "\n".join([*rows, *(row for _, row in sorted(found))])


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
                rows = table(of_task, task.published)
                parts.append(f"### {task.name}\n\n{rows}" if task.name else rows)
    page.write_text("\n\n".join(part.strip() for part in parts) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
