"""What looking ahead gains where limits are active, and what it costs.

    python benchmarks/predictive.py            # five minutes; wants gcc, and DAQP and OSQP if there
    python benchmarks/predictive.py --quick

Prints tables: errors over those of the clipped inverse, in the model and on virtual rigs; our solver
beside DAQP and OSQP; time in C on this machine; instructions on an emulated Cortex-M4F.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

import mckibben
from mckibben import Block, Recording
from mckibben.arrays import Array
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.play_type.gpi import GPI
from mckibben.blocks.play_type.pi import PI
from mckibben.blocks.predictive.plan import plan, plan_scratch
from mckibben.blocks.predictive.plan_one import plan_one
from mckibben.blocks.predictive.predictive import Predictive
from mckibben.blocks.predictive.supply import allowed, limit_rows
from mckibben.control import track
from mckibben.export.c.emulation import emulate, missing_tools
from mckibben.export.c.project import export_c
from mckibben.registry import load

STEP, LENGTH, HORIZON = 0.01, 800, 20
QUICK = "--quick" in sys.argv
SEEDS = range(3 if QUICK else 6)


def wander(rng: np.random.Generator, n: int, low: float, high: float, width: float) -> Array:
    """Return a smooth random path; ``width`` in samples tells how slow."""
    taps = np.exp(-0.5 * (np.arange(-4 * width, 4 * width + 1) / width) ** 2)
    noise = np.convolve(rng.standard_normal(n + 8 * int(width)), taps, "valid")[:n]
    return np.asarray(low + (high - low) * (0.5 + 0.5 * np.tanh(0.8 * noise / noise.std())))


def followed(
    inverse: Block, references: Array, horizon: int, **limits: float
) -> tuple[Array, float]:
    """Return what the model makes of a plan's pressures, and the share of samples planned."""
    block = Predictive(inverse, horizon=horizon, **limits)  # type: ignore[arg-type]
    n = len(block.outputs)
    held = np.concatenate([np.repeat(references[:1], HORIZON, axis=0), references])
    ahead = held.copy()
    places = np.minimum(np.arange(len(held)) + block.samples_ahead, len(held) - 1)
    ahead[:, :n] = held[places, :n]
    state = block.initial_state(held[0])
    start = state[: block.undone.n_states].tolist()
    pressures = np.empty((len(held), n))
    block.bind(STEP, state, ahead, pressures)()
    driven = np.hstack([pressures, held[:, n:]])
    given = block.undone.simulate(driven, initial=start, sample_time=STEP)
    return np.asarray(given)[HORIZON:], float(state[-1] / len(held))


def clipped(inverse: Block, references: Array, **limits: float) -> Array:
    """Return what the model makes of the inverse's pressures, clipped to the limits one by one."""
    block = Predictive(inverse, **limits)  # type: ignore[arg-type]
    n, rows = len(block.outputs), block.rows(STEP)
    held = np.concatenate([np.repeat(references[:1], HORIZON, axis=0), references])
    pressures = np.asarray(inverse.simulate(held, sample_time=STEP))
    for before, row in pairwise(pressures):
        allowed(rows, before, row)
    start = block.initial_state(held[0])[: block.undone.n_states].tolist()
    driven = np.hstack([pressures, held[:, n:]])
    given = block.undone.simulate(driven, initial=start, sample_time=STEP)
    return np.asarray(given)[HORIZON:]


def in_the_model() -> None:
    print("\n## In the model\n")
    print(
        "| model | limits | planned | clipped inverse | clipped, memory kept | ahead over clipped |"
    )
    print("|---|---|---:|---:|---:|---:|")
    for name, inverse, scheduled, limits in cases():
        ratios: list[float] = []
        clips: list[list[float]] = []
        shares = []
        for seed in SEEDS:
            rng = np.random.default_rng(seed)
            n = len(inverse.outputs)
            wished = [wander(rng, LENGTH, 0.4, 4.8, 12) for _ in range(n)]
            held = [np.full(LENGTH, value) for value in scheduled]
            table = np.stack([*wished, *held], axis=1)
            motion = np.asarray(inverse.inverse().simulate(table, sample_time=STEP)).reshape(-1, n)
            references = np.hstack([motion, table[:, n:]])
            runs = [clipped(inverse, references, **limits)]
            for horizon in (1, HORIZON):
                given, share = followed(inverse, references, horizon, **limits)
                runs.append(given)
            errors = [float(np.sqrt(np.mean((run - references[:, :n]) ** 2))) for run in runs]
            ratios.append(errors[2] / errors[0])
            clips.append(errors)
            shares.append(share)
        told = ", ".join(f"{key.removesuffix('_limit')} {value:g}" for key, value in limits.items())
        print(
            f"| {name} | {told} | {100 * np.median(shares):.0f} % | "
            f"{np.median(clips, axis=0)[0]:.3g} mm | {np.median(clips, axis=0)[1]:.3g} mm | "
            f"{np.median(ratios):.2f} ({min(ratios):.2f} to {max(ratios):.2f}) |",
            flush=True,
        )


def cases() -> Iterator[tuple[str, Block, tuple[float, ...], dict[str, float]]]:
    pi, gpi = PI.example().inverse(), GPI.example().inverse()
    arm = replace(Balance.example(), pressure_range=(0.0, 6.0))
    for rate in (16.0, 12.0, 8.0, 4.0):
        yield "pi", pi, (), {"rate_limit": rate}
        yield "gpi", gpi, (), {"rate_limit": rate}
        yield "balance, 2 muscles", arm, (1.0, 5.0), {"rate_limit": rate}
    for flow in (20.0, 14.0, 8.0):
        yield "balance, 2 muscles", arm, (1.0, 5.0), {"flow_limit": flow}
    yield "balance, 2 muscles", arm, (1.0, 5.0), {"total_limit": 6.0}
    yield (
        *("balance, 2 muscles", arm, (1.0, 5.0)),
        {"rate_limit": 12.0, "flow_limit": 14.0, "total_limit": 7.0},
    )


def on_rigs() -> None:
    print("\n## On virtual rigs, with models identified on one recording\n")
    print(
        "| rig | model | rate [bar/s] | at a limit | no limit | clipped | over it: horizon 20 | 40 |"
    )
    print("|---|---|---:|---:|---:|---:|---:|---:|")
    for rig_name in ("mas20-hanging",):
        rig = mckibben.load_rig(rig_name)
        step = rig.sample_time
        rng = np.random.default_rng(1)
        train = rig.run(recorded(wander(rng, 4000, 0.5, 5.0, 30), step), seed=1)
        for kind in ("gpi", "mpi", "balance"):
            model = (
                load("estimators", kind)().fit([train.select(["pressure", "displacement"])]).model_
            )
            for rate in (6.0, 3.0):
                rows = []
                for seed in SEEDS:
                    path = wander(np.random.default_rng(100 + seed), 1500, 0.6, 4.8, 20)
                    reference = rig.run(recorded(path, step), seed=50).select(["displacement"])
                    inverse = model.inverse()
                    plain = track(inverse, rig, reference, slew=rate, settle=1.0)
                    free = track(inverse, rig, reference, settle=1.0)
                    found = [free.rmse["displacement"], plain.rmse["displacement"]]
                    for horizon in (HORIZON, 2 * HORIZON):
                        block = Predictive(
                            inverse, horizon=horizon, rate_limit=rate, pressure_range=(0.0, 6.0)
                        )
                        tracked = track(block, rig, reference, slew=rate, settle=1.0)
                        found.append(tracked.rmse["displacement"] / found[1])
                    rows.append([plain.clipped / 1500, *found])
                share, free_error, clip, ahead, further = np.median(rows, axis=0)
                print(
                    f"| {rig_name} | {kind} | {rate:g} | {100 * share:.0f} % | "
                    f"{free_error:.3g} mm | {clip:.3g} mm | {ahead:.2f} | {further:.2f} |",
                    flush=True,
                )


def recorded(pressure: Array, step: float) -> Recording:
    return Recording({"pressure": pressure}, step, {"pressure": "bar"})


def solvers() -> None:
    print("\n## One plan of 20 samples\n")
    print("| muscles | limits a sample | ours | steps | DAQP | OSQP | difference from DAQP |")
    print("|---:|---:|---:|---:|---:|---:|---:|")
    for n in (1, 2, 3):
        rng = np.random.default_rng(n)
        rows = limit_rows(
            np.zeros(n), np.full(n, 5.0), 0.06, 2.5 * n, 0.05 * n if n > 1 else np.inf, np.ones(n)
        )
        times: dict[str, list[float]] = {"ours": [], "daqp": [], "osqp": []}
        steps, off = [], []
        for _ in range(40):
            slopes = rng.uniform(2.0, 6.0, (HORIZON, 1, 1)) * np.eye(n)
            slopes = slopes + 0.8 * (n > 1) * rng.standard_normal((HORIZON, n, n))
            nominal = 2.2 + np.cumsum(0.25 * rng.standard_normal((HORIZON, n)), axis=0)
            before = np.clip(nominal[0] + 0.1, 0.0, 2.4)
            found, scratch = nominal.copy(), np.zeros(plan_scratch(HORIZON, n, len(rows)))
            given = (rows, before, slopes.reshape(-1), nominal, np.zeros_like(nominal))
            solve_ours = plan_one if n == 1 else plan
            solve_ours(*given, found, scratch)
            started = time.perf_counter()
            steps.append(solve_ours(*given, found, scratch) or 0)
            times["ours"].append(time.perf_counter() - started)
            problem = dense(rows, before, slopes, nominal)
            for name, solve in (("daqp", by_daqp), ("osqp", by_osqp)):
                answer = solve(*problem)
                if answer is not None:
                    times[name].append(answer[1])
                    if name == "daqp":
                        off.append(float(np.abs(answer[0].reshape(found.shape) - found).max()))
        told = [f"{1e6 * np.median(t):.0f} µs" if t else "-" for t in times.values()]
        print(
            f"| {n} | {len(rows)} | {told[0]} | {np.median(steps):.0f}, at most {max(steps)} | "
            f"{told[1]} | {told[2]} | {max(off, default=np.nan):.1e} bar |",
            flush=True,
        )


def dense(rows: Array, before: Array, slopes: Array, nominal: Array) -> tuple[Array, ...]:
    """Return a plan's problem as min x H x / 2 + f x, A x <= b."""
    length, n = nominal.shape
    hessian, linear = np.zeros((length * n, length * n)), np.zeros(length * n)
    table, bounds = np.zeros((length * len(rows), length * n)), np.tile(rows[:, 1], length)
    for t in range(length):
        own = slice(t * n, t * n + n)
        hessian[own, own] = slopes[t].T @ slopes[t]
        linear[own] = -hessian[own, own] @ nominal[t]
        for i, row in enumerate(rows):
            table[t * len(rows) + i, own] = row[2:]
            if row[0] > 0 and t > 0:
                table[t * len(rows) + i, t * n - n : t * n] = -row[2:]
            elif row[0] > 0:
                bounds[i] += row[2:] @ before
    return hessian, linear, table, bounds


def by_daqp(
    hessian: Array, linear: Array, table: Array, bounds: Array
) -> tuple[Array, float] | None:
    try:
        import daqp
    except ImportError:
        return None
    started = time.perf_counter()
    kinds = np.zeros(len(bounds), dtype=np.int32)
    found = daqp.solve(hessian, linear, table, bounds, np.full(len(bounds), -1e30), kinds)
    return found[0], time.perf_counter() - started


def by_osqp(
    hessian: Array, linear: Array, table: Array, bounds: Array
) -> tuple[Array, float] | None:
    try:
        import osqp
    except ImportError:
        return None
    from scipy import sparse

    solver = osqp.OSQP()
    upper, rows = sparse.csc_matrix(np.triu(hessian)), sparse.csc_matrix(table)
    low = np.full(len(bounds), -np.inf)
    solver.setup(upper, linear, rows, low, bounds, verbose=False, eps_abs=1e-6, eps_rel=1e-6)
    found = solver.solve()
    return found.x, found.info.run_time


TIMING = """
#include <stdio.h>
#include <time.h>
#include <math.h>
#include "m.h"
int main(void) {
    static m_model model;
    double worst = 0, sum = 0;
    int n = 20000;
    m_init(&model);
    for (int i = 0; i < n; i++) {
        double in[M_N_INPUTS], out[M_N_OUTPUTS];
        for (int k = 0; k < M_N_INPUTS; k++)
            in[k] = LEVEL(k) + SWING(k) * sin(0.13 * i + k + sin(0.031 * i));
        struct timespec a, b;
        clock_gettime(CLOCK_THREAD_CPUTIME_ID, &a);
        m_step(&model, in, out);
        clock_gettime(CLOCK_THREAD_CPUTIME_ID, &b);
        double t = 1e6 * ((double)(b.tv_sec - a.tv_sec)) + 1e-3 * (double)(b.tv_nsec - a.tv_nsec);
        sum += t; if (t > worst) worst = t;
        printf("%.3f\\n", t);
    }
    return 0;
}
"""


def compensators() -> dict[str, tuple[Block, str]]:
    """Return what is timed, and the swing of its references."""
    arm = replace(Balance.example(), pressure_range=(0.0, 6.0))
    limits = {"rate_limit": 8.0, "flow_limit": 10.0, "total_limit": 7.0}
    ten = replace(
        GPI.example(),
        thresholds=tuple(0.1 * k for k in range(10)),
        weights=tuple(12.0 / (1 + k) for k in range(10)),
    )
    one = "-DLEVEL(k)=10.0 -DSWING(k)=6.0"
    two = "-DLEVEL(k)=((k)<2?14.0:(k)<3?1.0:5.0) -DSWING(k)=((k)<2?7.0:0.0)"
    return {
        "pi, 4 operators": (Predictive(PI.example().inverse(), rate_limit=6.0), one),
        "gpi, 10 operators": (Predictive(ten.inverse(), rate_limit=6.0), one),
        "balance, 2 muscles": (Predictive(arm, **limits), two),  # type: ignore[arg-type]
    }


def on_this_machine() -> None:
    print("\n## A step in C, double precision, on this machine\n")
    print("| model | median | 99.9 % | worst |")
    print("|---|---:|---:|---:|")
    for name, (block, swing) in compensators().items():
        with tempfile.TemporaryDirectory() as folder:
            place = export_c(block, Path(folder) / "m", name="m", sample_time=STEP)
            (place / "time.c").write_text(TIMING)
            sources = [str(path) for path in (place / "src").glob("*.c")]
            flags = ["-O2", "-std=gnu99", f"-I{place / 'src'}", *swing.split()]
            program = str(place / "time")
            made = ["gcc", *flags, *sources, str(place / "time.c"), "-lm", "-o", program]
            subprocess.run(made, check=True)
            text = subprocess.run([program], check=True, capture_output=True, text=True).stdout
        took = np.array(text.split(), dtype=float)
        print(f"| {name} | {np.median(took):.0f} µs | {np.quantile(took, 0.999):.0f} µs | "
              f"{took.max():.0f} µs |", flush=True)  # fmt: skip


def on_a_microcontroller() -> None:
    print("\n## Instructions a step, single precision, on an emulated Cortex-M4F\n")
    if missing_tools():
        print(f"without {', '.join(missing_tools())}: left out")
        return
    print("| model | horizon | median | at most | RAM [bytes] | stack | flash | off |")
    print("|---|---:|---:|---:|---:|---:|---:|---:|")
    for name, (block, _) in compensators().items():
        if block.needs_double:
            continue
        for horizon in (HORIZON, 10):
            found = emulate(replace(block, horizon=horizon), sample_time=STEP)  # type: ignore[type-var]
            steps = found.instructions[1:]
            print(
                f"| {name} | {horizon} | {np.median(steps):.0f} | {steps.max():.0f} | {found.ram} | "
                f"{found.stack} | {found.flash} | {found.difference:.1e} |",
                flush=True,
            )


PARTS: tuple[Callable[[], None], ...] = (
    solvers,
    on_this_machine,
    on_a_microcontroller,
    in_the_model,
    on_rigs,
)


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    for part in PARTS:
        part()
