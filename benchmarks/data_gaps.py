"""Data gaps named in recordings of virtual plants, complete or without one kind of excitation.

    python benchmarks/data_gaps.py [--seeds N] [PLANT ...]

Every plant of tests/plants is recorded with all kinds of excitation (random motion of all inputs and
loads at two speeds, the same again, and holds), and without each kind. A table says in how many the gap
is named that was made (nothing, of complete ones), and what else is named.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter, defaultdict
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

from tests.diagnosis.lacking import lacking
from tests.plants import PLANTS

from mckibben.diagnosis.data_gaps import data_gaps


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("plants", nargs="*", default=list(PLANTS))
    parser.add_argument("--seeds", type=int, default=3)
    given = parser.parse_args()
    cases, right = Counter[str](), Counter[str]()
    others: defaultdict[str, Counter[str]] = defaultdict(Counter)
    for plant in given.plants:
        bench = PLANTS[plant](0).bench
        for seed in range(given.seeds):
            for name, gap, runs, tests in lacking(plant, seed):
                gaps = data_gaps(runs, bench.pressures, bench.outputs, tests=tests)
                found = {one.what for one in gaps}
                cases[name] += 1
                right[name] += gap in found if gap else not found
                others[name].update(found - {gap})
    print(f"{'without':20} {'right':>5} {'of':>4}   also named")
    for name, count in cases.items():
        also = ", ".join(f"{what} {n}" for what, n in others[name].most_common())
        print(f"{name:20} {right[name]:5} {count:4}   {also or '-'}")
    made = [name for name in cases if name != "nothing"]
    print(f"{'gaps':20} {sum(right[x] for x in made):5} {sum(cases[x] for x in made):4}")


if __name__ == "__main__":
    main()
