"""Measure how long commands take to start, in fresh processes with compiled bytecode.

Run: python benchmarks/startup.py
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from statistics import median

RUNS = 5

COMPARE = """
import numpy as np, mckibben
time = np.arange(2000) / 50
u = 2.5 + 2.5 * np.sin(time) * np.linspace(1.0, 0.3, 2000)
run = {"pressure": u, "displacement": 3.0 * u + np.sin(0.3 * time)}
mckibben.compare(run, models=("pi", "gpi"), rate=50.0)
"""

COMMANDS = {
    'python -c "import mckibben"': (["-c", "import mckibben"], 0.05),
    'python -c "import mckibben; mckibben.PIEstimator()"': (
        ["-c", "import mckibben; mckibben.PIEstimator()"],
        0.6,
    ),
    "compare of two models on 2 000 samples": (["-c", COMPARE], 2.0),
    "mckibben info --models": (["-m", "mckibben", "info", "--models"], 1.5),
    "mckibben --help": (["-m", "mckibben", "--help"], 0.2),
}
"""By what is typed: arguments of Python that do the same, and the target of wall time [s]."""


def seconds(arguments: list[str]) -> tuple[float, float]:
    """Return the wall and processor time of a fresh process; beside other work they differ."""
    started, before = time.perf_counter(), os.times()
    subprocess.run([sys.executable, *arguments], stdout=subprocess.DEVNULL, check=True)
    wall, after = time.perf_counter() - started, os.times()
    busy = after.children_user + after.children_system
    return wall, busy - before.children_user - before.children_system


def main() -> None:
    """Print the medians of every command beside its target."""
    print(f"{'command, medians [s]':<52} {'wall':>6} {'target':>6} {'processor':>9}")
    for name, (arguments, target) in COMMANDS.items():
        seconds(arguments)  # writes the bytecode, and brings files into memory
        wall, busy = map(median, zip(*(seconds(arguments) for _ in range(RUNS)), strict=True))
        print(f"{name:<52} {wall:6.2f} {target:6.2f} {busy:9.2f}")


if __name__ == "__main__":
    main()
