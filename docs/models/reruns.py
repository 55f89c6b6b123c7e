"""The papers' experiments again, as one page of tables.

for paper in field-models multistate-friction activation-pressure sdchm mpi-narmax; do
mckibben reproduce $paper --quick --json -o runs/$paper > runs/$paper.json
done
python docs/models/reruns.py runs > docs/models/reruns.md
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

ORDER = ("field-models", "multistate-friction", "activation-pressure", "sdchm", "mpi-narmax")


ABOUT = """Each paper's protocol on a virtual rig: what the paper prints beside what its methods, and
ours, give there. The rigs are not the papers' hardware: ranks and ratios can be compared, digits
cannot. These are the quick runs; without `--quick` they take longer.
"""


def cell(value: Any) -> str:
    """Return a value as a table shows it."""
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:.3g}"
    return str(value).replace("|", "\\|")


def table(rows: list[dict[str, Any]]) -> list[str]:
    """Return rows as a table."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    lines = ["| " + " | ".join(names) + " |", "|" + "---|" * len(names)]
    return lines + ["| " + " | ".join(cell(row.get(name)) for name in names) + " |" for row in rows]


def main(folder: Path) -> None:
    """Print the page."""
    print("# The papers' experiments again\n")
    print(ABOUT)
    for paper in ORDER:
        found = json.loads((folder / f"{paper}.json").read_text(encoding="utf-8"))
        print(f"## {found['title']}\n\n`mckibben reproduce {paper} --quick`\n")
        for sentence in found["summary"]:
            print(f"- {sentence}")
        for one in found["tables"]:
            print(f"\n### {one['title']}\n")
            print("\n".join(table(one["rows"])))
            if one.get("note"):
                print(f"\n{one['note']}")
        print()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
