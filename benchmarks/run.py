"""Measure speed, beside plain C, and print one table.

Run: python benchmarks/run.py [--quick]
"""

from __future__ import annotations

import argparse
import ctypes
import os
import platform
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numba
import numpy as np
from numpy.typing import NDArray

from mckibben import (
    GPI,
    PI,
    Recording,
    compare,
    load_rig,
    registry,
)
from mckibben.blocks.base import Block
from mckibben.blocks.hysteresis.envelopes import Tanh
from mckibben.channels import channels_of
from mckibben.rigs import record
from mckibben.signals import decaying_triangle
from mckibben.signals.protocol import protocol
from microcontroller import compositions

Array = NDArray[np.float64]


def processor() -> str:
    """Return the name of the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        return next(line.split(":")[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor()


def best_of(runs: int, function: Callable[[], object]) -> float:
    """Return the shortest time of several calls [s]; the first is not counted."""
    function()
    times = []
    for _ in range(runs):
        started = time.perf_counter()
        function()
        times.append(time.perf_counter() - started)
    return min(times)


def excitation(n: int) -> Array:
    """Return a sine whose amplitude grows over five cycles, from 0 to at most 5 bar."""
    t = np.linspace(0, 1, n)
    return 0.5 * (0.3 + 0.7 * np.floor(5 * t).clip(0, 4) / 4) * 5 * (1 - np.cos(10 * np.pi * t))


def models(n: int) -> tuple[PI, GPI]:
    """Return a PI and a GPI model with ``n`` operators each."""
    weights = tuple(np.linspace(2.0, 0.5, n).tolist())
    pi = PI(tuple(np.linspace(0, 2.4, n).tolist()), weights, 1.0, (0.0, 5.0))
    rising, falling = Tanh.examples()
    radii = tuple(np.linspace(0, 0.9, n).tolist())
    return pi, GPI(radii, weights, rising, falling, (0.0, 5.0))


class Compiled:
    """The loops of ``play.c``, compiled by gcc into a folder.

    Parameters
    ----------
    folder : Path
        Where the library is put.
    """

    def __init__(self, folder: Path) -> None:
        library = folder / "play.so"
        source = Path(__file__).with_name("play.c")
        command = ["gcc", "-O3", "-march=native", "-shared", "-fPIC", "-std=c99"]
        subprocess.run([*command, "-o", library, source, "-lm"], check=True)
        self._library = ctypes.CDLL(str(library))

    def run(self, block: PI | GPI, u: Array) -> Array:
        """Return the output of a PI model, or of a GPI model with tanh envelopes, but for its offset."""
        r, w = np.array(block.thresholds), np.array(block.weights)
        start = u[:1] if isinstance(block, PI) else block.rising(u[:1])
        s, y = start - r, np.empty_like(u)
        envelopes = [] if isinstance(block, PI) else [[*block.rising.pack(), *block.falling.pack()]]
        arrays = [r, w, s, *map(np.array, envelopes), u, y]
        pointers = [array.ctypes.data_as(ctypes.c_void_p) for array in arrays]
        sizes = ctypes.c_size_t(u.size), ctypes.c_size_t(r.size)
        getattr(self._library, block.kind)(*sizes, *pointers)
        return y


def kernels() -> None:
    """Nanoseconds per operator and sample."""
    u = excitation(200_000)
    print("\nkernels, 200 000 samples [ns per operator and sample]; 64 sets are on all cores")
    print(f"{'model':>6} {'operators':>9} {'mckibben':>9} {'64 at once':>10} {'C -O3':>7}")
    with tempfile.TemporaryDirectory() as folder:
        compiled = Compiled(Path(folder)) if shutil.which("gcc") else None
        for n in (10, 100):
            for block in models(n):
                scale = 1e9 / (u.size * n)
                ours = best_of(5, partial(block.simulate, u)) * scale
                many = batched(block, u) * scale / 64
                c = best_of(5, partial(compiled.run, block, u)) * scale if compiled else np.nan
                print(f"{block.kind:>6} {n:>9} {ours:9.3f} {many:10.3f} {c:7.3f}")


def batched(block: Block, u: Array) -> float:
    """Return the time of 64 parameter sets at once [s], on all cores."""
    sets = np.repeat(block.pack()[np.newaxis], 64, axis=0)
    return best_of(3, lambda: block.simulate_many(sets, u))


def field() -> None:
    """Time of every model's fit, and of all of them in one comparison, on 10 000 samples."""
    t = 0.01 * np.arange(20_000)
    rig = load_rig("mas20-hanging")
    rig.reset(seed=0)
    whole = rig.run(
        Recording({"pressure": decaying_triangle(t, 10.0, 5.5, 1.0, n_cycles=20)}, 0.01)
    )
    train, test = whole.slice(0, 10_000), whole.slice(10_000, 20_000)
    channels = channels_of([train, test], "pressure", "displacement")
    print("\nevery model of compare, hanging muscle, 10 000 samples at 100 Hz")
    names = []
    for name in registry.names("estimators"):
        estimator = registry.load("estimators", name)()
        if estimator.objection([train, test], channels):
            continue
        names.append(name)
        started = time.perf_counter()
        fitted = estimator.fit(train)
        seconds = time.perf_counter() - started
        print(f"  {name:>14}: {seconds:6.2f} s, RMSE {fitted.diagnostics_.rmse:.3f} mm")
    started = time.perf_counter()
    board = compare(train, test)
    print(f"  compare, all {len(board.rows)}: {time.perf_counter() - started:.0f} s")


def three_muscles() -> Iterator[tuple[str, Block, Array]]:
    """Give SDCHM of three muscles, and its inverse whose network is solved by Newton's method."""
    sdchm = dict(compositions())["SDCHM: three muscles, 81 rules"]
    t = 0.05 * np.arange(8000)
    pressures = [2.6 + 1.2 * np.sin(0.13 * (k + 1) * t + k) for k in range(3)]
    inputs = np.column_stack([*pressures, 1.2 + 0.8 * np.sin(0.05 * t)])
    yield "sdchm", sdchm, inputs
    yield "sdihc", sdchm.inverse(), np.column_stack([sdchm.simulate(inputs), inputs[:, 3]])


def streams() -> None:
    """Latency of one step from Python."""
    print("\nstream.step from Python [µs]")
    u = excitation(20_000)
    pi, gpi = models(10)
    for name, block, inputs in (
        ("pi", pi, u),
        ("pi inverse", pi.inverse(), pi.simulate(u)),
        ("gpi", gpi, u),
        ("gpi inverse", gpi.inverse(), gpi.simulate(u)),
        *three_muscles(),
    ):
        stream = block.stream()
        times = np.empty(len(inputs))
        for t, value in enumerate(inputs.tolist()):
            started = time.perf_counter_ns()
            stream.step(value)
            times[t] = time.perf_counter_ns() - started
        percentiles = np.percentile(times[100:] / 1e3, [50, 99, 99.9])
        print(
            f"  {name:>12}: "
            + ", ".join(f"p{p} {v:.1f}" for p, v in zip((50, 99, 99.9), percentiles, strict=True))
        )


def rigs(quick: bool) -> None:
    """Time of virtual experiments."""
    print("\nvirtual rigs")
    rig = load_rig("mas20-hanging")
    u = decaying_triangle(np.arange(20_000) / 100, 20.0, 5.5, 1.0, n_cycles=10)
    given = Recording({"pressure": u}, 0.01)
    rig.run(given)
    print(f"  mas20-hanging, 200 s at 100 Hz: {best_of(3, partial(rig.run, given)):.2f} s")
    training = [
        run.name for run in protocol("sdchm").select("train") if run.labels["stage"] == "network"
    ]
    runs = training[:8] if quick else training
    started = time.perf_counter()
    simulated = sum(recording.duration or 0.0 for _, recording in record("sdchm", runs=runs))
    seconds = time.perf_counter() - started
    print(f"  soft-arm, {len(runs)} training runs, {simulated:.0f} s in all: {seconds:.1f} s")
    rig.reset()
    steps = best_of(3, lambda: [rig.step([3.0]) for _ in range(1000)])
    print(f"  rig.step from Python, 10 ms of rig: {steps * 1e3:.0f} µs")


def main() -> None:
    """Print everything."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer repetitions")
    quick = parser.parse_args().quick
    print(f"{processor()}, {os.cpu_count()} cores; {platform.platform()}")
    print(f"Python {platform.python_version()}, numba {numba.__version__}, NumPy {np.__version__}")
    kernels()
    field()
    streams()
    rigs(quick)


if __name__ == "__main__":
    main()
