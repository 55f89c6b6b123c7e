"""Measure how long commands take to start, in fresh processes with compiled bytecode.

Run: python benchmarks/startup.py
"""

from __future__ import annotations

import subprocess
import sys
import time
from statistics import median

RUNS = 5

COMMANDS = {
    'python -c "import mckibben; mckibben.GPIEstimator"': (
        ["-c", "import mckibben; mckibben.GPIEstimator"],
        1.0,
    ),
    "mckibben info --models": (["-m", "mckibben.cli.main", "info", "--models"], 1.5),
    "mckibben --help": (["-m", "mckibben.cli.main", "--help"], 0.5),
}
"""By what is typed: arguments of Python that do the same, and the target [s]."""


def seconds(arguments: list[str]) -> float:
    """Return the wall time of a fresh process."""
    started = time.perf_counter()
    subprocess.run([sys.executable, *arguments], stdout=subprocess.DEVNULL, check=True)
    return time.perf_counter() - started


def main() -> None:
    """Print the median of every command beside its target."""
    print(f"{'command':<52} {'median [s]':>10} {'target [s]':>10}")
    for name, (arguments, target) in COMMANDS.items():
        seconds(arguments)  # writes the bytecode, and brings files into memory
        print(f"{name:<52} {median(seconds(arguments) for _ in range(RUNS)):10.2f} {target:10.1f}")


if __name__ == "__main__":
    main()
