"""Measure speed, beside plain NumPy and C, and print one table.

Run: python benchmarks/run.py [--quick]
"""

from __future__ import annotations

import argparse
import os
import platform
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from mckibben import (
    GPI,
    PI,
    GPIEstimator,
    MPIEstimator,
    RDPIEstimator,
    Recording,
    compare,
    load_rig,
    registry,
)
from mckibben.blocks.core.block import Block
from mckibben.blocks.play_type.envelopes.tanh import Tanh
from mckibben.papers.multistate_friction.published import multistate_friction
from mckibben.rigs import record
from mckibben.signals import decaying_triangle
from mckibben.signals.protocol import protocol
from microcontroller import compositions
from references import Compiled, numpy_gpi, numpy_pi

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


def kernels(quick: bool) -> None:
    """Nanoseconds per operator and sample."""
    u = excitation(200_000)
    with tempfile.TemporaryDirectory() as folder:
        compiled = Compiled(Path(folder)) if Compiled.available() else None
        print(
            "\nkernels, 200 000 samples [ns per operator and sample]; one core, and 64 sets on all cores"
        )
        print(
            f"{'model':>6} {'operators':>9} {'mckibben':>9} {'64 at once':>10} {'C -O3':>7} {'NumPy':>7}"
        )
        for n in (10, 100):
            for block in models(n):
                scale = 1e9 / (u.size * n)
                ours = best_of(5, partial(block.simulate, u)) * scale
                many = batched(block, u) * scale / 64
                short = u[:: 20 if quick else 4]
                slow_run, c_run = (
                    (partial(numpy_pi, block), compiled and partial(compiled.pi, block))
                    if isinstance(block, PI)
                    else (partial(numpy_gpi, block), compiled and partial(compiled.gpi, block))
                )
                slow = best_of(1, partial(slow_run, short)) * 1e9 / (short.size * n)
                c = best_of(5, partial(c_run, u)) * scale if c_run else float("nan")
                print(f"{block.kind:>6} {n:>9} {ours:9.3f} {many:10.3f} {c:7.3f} {slow:7.1f}")
        _, gpi = models(10)
        envelopes = best_of(5, lambda: (gpi.rising(u), gpi.falling(u))) * 1e9 / u.size
        print(f"both tanh envelopes: {envelopes:.1f} ns a sample")


def batched(block: Block, u: Array) -> float:
    """Return the time of 64 parameter sets at once [s], on all cores."""
    sets = np.repeat(block.pack()[np.newaxis], 64, axis=0)
    return best_of(3, lambda: block.simulate_many(sets, u))


def fits(quick: bool) -> None:
    """Time and error of GPI identification, beside particle swarms on all parameters."""
    u = excitation(10_000)
    _, truth = models(11)
    creep = 0.15 * np.sin(np.linspace(0, 9, u.size))
    noise = 0.02 * np.random.default_rng(0).standard_normal(u.size)
    recording = Recording({"pressure": u, "displacement": truth.simulate(u) + creep + noise}, 0.01)
    estimator = GPIEstimator(n_operators=10)
    seconds = best_of(3, lambda: estimator.fit(recording))
    print("\nGPI, N = 10, on 10 000 samples of progressive amplitude")
    print(
        f"  variable projection, multi-start: {seconds:.2f} s, RMSE {estimator.diagnostics_.rmse:.4f} mm"
    )
    swarms: list[tuple[str, dict[str, Any]]] = [
        ("c1 = c2 = 2, inertia .9 to .4", {}),
        (
            "c1 = c2 = 0.5, inertia .7",
            {"pso_c1": 0.5, "pso_c2": 0.5, "pso_inertia_start": 0.7, "pso_inertia_end": 0.7},
        ),
    ]
    for name, settings in swarms:
        ends, started = [], time.perf_counter()
        for seed in range(5 if quick else 20):
            swarm = GPIEstimator(n_operators=10, method="pso", seed=seed, **settings).fit(recording)
            ends.append(swarm.diagnostics_.rmse)
        each = (time.perf_counter() - started) / len(ends)
        print(
            f"  swarm 20 x 50 on all 17, {name}: {each:.2f} s each, RMSE best {min(ends):.4f}, median "
            f"{np.median(ends):.4f} mm of {len(ends)} seeds"
        )
    for other in (MPIEstimator(), RDPIEstimator()):
        seconds = best_of(1, partial(other.fit, recording))
        print(f"  {type(other).__name__}: {seconds:.2f} s, RMSE {other.diagnostics_.rmse:.4f} mm")


def field() -> None:
    """Time of every model's fit, and of all of them in one comparison, on 10 000 samples."""
    t = 0.01 * np.arange(20_000)
    rig = load_rig("mas20-hanging")
    rig.reset(seed=0)
    whole = rig.run(
        Recording({"pressure": decaying_triangle(t, 10.0, 5.5, 1.0, n_cycles=20)}, 0.01)
    )
    train, test = whole.slice(0, 10_000), whole.slice(10_000, 20_000)
    print("\nevery model of compare, hanging muscle, 10 000 samples at 100 Hz")
    names = []
    for name in registry.names("estimators"):
        estimator = registry.load("estimators", name)()
        if estimator.objection([train, test], "pressure", "displacement"):
            continue
        names.append(name)
        started = time.perf_counter()
        fitted = estimator.fit(train)
        seconds = time.perf_counter() - started
        print(f"  {name:>14}: {seconds:6.2f} s, RMSE {fitted.diagnostics_.rmse:.3f} mm")
    started = time.perf_counter()
    board = compare(train, test)
    print(f"  compare, all {len(board.rows)}: {time.perf_counter() - started:.0f} s")
    print("\nsimulation of 200 000 samples [ms]")
    u = excitation(200_000)
    for name in ("bouc-wen", "gbw", "duhem", "maxwell-slip", "preisach"):
        block = registry.load("estimators", name)().fit(train).model_
        print(f"  {name:>14}: {1e3 * best_of(3, partial(block.simulate, u)):.1f}")
    friction = multistate_friction()
    inputs = np.column_stack([200 - 3 * u, u])
    seconds = best_of(3, partial(friction.simulate, inputs, sample_time=0.01))
    print(f"  {'multistate-11':>14}: {1e3 * seconds:.1f}")


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
    kernels(quick)
    fits(quick)
    field()
    streams()
    rigs(quick)


if __name__ == "__main__":
    main()
