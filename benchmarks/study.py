"""Measure how long the README's main job takes: quiet, beside other work, and with nothing compiled.

Run: python benchmarks/study.py [--cold] [--runs N]
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mckibben.example import TEST, TRAIN

ROOT = Path(__file__).resolve().parent.parent
EXAMPLES = (str(TRAIN), "--test", str(TEST))
BUSY_LOOPS = 2
TARGETS = {"all models": 32.0, "quick": 10.0, "first picture": 10.0, "cold": 65.0, "busy": 2.5}
"""Seconds on two quiet cores; busy: relative to quiet."""


def study(*words: str, cache: str | None = None) -> tuple[float, float]:
    """Return the seconds until the first page is on disk, and until the study is done."""
    environment = os.environ | ({} if cache is None else {"NUMBA_CACHE_DIR": cache})
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "report.html"
        command = [sys.executable, "-m", "mckibben", "study", *EXAMPLES, *words]
        started = time.perf_counter()
        process = subprocess.Popen(
            [*command, "-o", folder],
            cwd=ROOT,
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        while not page.exists() and process.poll() is None:
            time.sleep(0.02)
        first = time.perf_counter() - started
        if process.wait() != 0:
            raise SystemExit("the study failed")
        return first, time.perf_counter() - started


@contextmanager
def busy(n: int) -> Iterator[None]:
    """Keep so many cores busy."""
    loops = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(n)]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()


def told(what: str, times: list[tuple[float, float]], target: str) -> float:
    """Print median and range, and return the median."""
    whole = [seconds for _, seconds in times]
    first = statistics.median(seconds for seconds, _ in times)
    middle = statistics.median(whole)
    print(
        f"{what:>32}: {middle:5.1f} s ({min(whole):.1f} to {max(whole):.1f}; {target}), "
        f"first picture after {first:.1f} s",
        flush=True,
    )
    return middle


def main() -> None:
    """Print everything."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cold", action="store_true", help="with an empty kernel cache too")
    parser.add_argument("--runs", type=int, default=3)
    given = parser.parse_args()
    study("--quick")  # warms the kernel cache
    for name, words in (("--quick", ("--quick",)), ("all models", ())):
        target = TARGETS["quick" if words else "all models"]
        quiet = told(name, [study(*words) for _ in range(given.runs)], f"target {target:.0f} s")
        with busy(BUSY_LOOPS):
            loaded = [study(*words) for _ in range(given.runs)]
        ratio = told(f"{name}, {BUSY_LOOPS} busy loops", loaded, "target 2.5 x quiet") / quiet
        print(f"{'':>32}  {ratio:.1f} x quiet")
    if given.cold:
        with tempfile.TemporaryDirectory() as cache:
            told("all models, nothing compiled", [study(cache=cache)], "target 65 s")


if __name__ == "__main__":
    main()
