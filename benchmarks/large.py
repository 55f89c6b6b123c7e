"""Measure long and many recordings: seconds, and memory of all processes together.

Run: python benchmarks/large.py [--samples 10000000] [--recordings 200]
         [--only long|many]
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

from mckibben import GPI, Recording, write
from mckibben.signals import irregular_triangle

FEW = ("pi", "gpi")
SEVERAL = ("pi", "mpi", "gpi", "bouc-wen")


def recording(n: int, sample_time: float, seed: int) -> Recording:
    """Return a play-type muscle under irregular triangles, with noise."""
    time_ = np.arange(n) * sample_time
    u = irregular_triangle(time_, max(10, round(time_[-1] / 10)), 5.0, seed=seed)
    noise = 0.02 * np.random.default_rng(seed).standard_normal(n)
    return Recording(
        {"pressure": u, "displacement": GPI.example().simulate(u) + noise}, sample_time
    )


def measured(what: str, *words: str | Path) -> None:
    """Run a command and print its wall time, and the most memory that all its processes had."""
    started = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        process = subprocess.Popen(
            [sys.executable, "-m", "mckibben", *map(str, words), "-o", folder],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )
        most = 0
        said: list[bytes] = []
        assert process.stderr is not None
        reader = threading.Thread(target=lambda: said.extend(process.stderr or ()))
        reader.start()
        while process.poll() is None:
            most = max(most, memory(process.pid))
            time.sleep(0.1)
        reader.join()
    seconds = time.perf_counter() - started
    ended = "" if process.returncode == 0 else f", FAILED: {b''.join(said[-2:]).decode()}"
    print(f"  {what:>48}: {seconds:6.1f} s, {most / 1e9:.2f} GB{ended}", flush=True)


def memory(session: int) -> int:
    """Return the memory that the processes of a session hold, shared pages counted once [bytes]."""
    total = 0
    for place in Path("/proc").iterdir():
        if place.name.isdigit():
            try:
                if int((place / "stat").read_text().rsplit(")", 1)[1].split()[3]) == session:
                    lines = (place / "smaps_rollup").read_text().splitlines()
                    total += 1024 * int(next(x.split()[1] for x in lines if x.startswith("Pss:")))
            except (OSError, StopIteration, IndexError):
                continue
    return total


def main() -> None:
    """Print everything."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=10_000_000)
    parser.add_argument("--recordings", type=int, default=200)
    parser.add_argument("--only", choices=("long", "many"))
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        if given.only != "many":
            long = folder / "long.csv"
            write(recording(given.samples, 0.001, 0), long)
            print(f"one recording of {given.samples} samples, {long.stat().st_size / 1e6:.0f} MB")
            measured("compare --models pi,gpi", "compare", long, "--models", ",".join(FEW))
            measured("study --quick", "study", long, "--quick")
            long.unlink()
        if given.only == "long":
            return
        many = folder / "many"
        many.mkdir()
        for seed in range(given.recordings):
            write(recording(2000, 0.02, seed), many / f"run-{seed:03}.csv")
        words = ("compare", many, "--models", ",".join(SEVERAL))
        print(f"{given.recordings} recordings of 2000 samples, {len(SEVERAL)} models")
        for jobs in (1, os.cpu_count() or 1):
            measured(f"--jobs {jobs}", *words, "--jobs", str(jobs))


if __name__ == "__main__":
    main()
