"""What looking ahead gains where limits are active, and what it costs.

    python benchmarks/predictive.py            # minutes; wants gcc
    python benchmarks/predictive.py --quick

Prints tables: errors over those of the clipped inverse; time in C on this machine; instructions on an
emulated Cortex-M4F.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from mckibben import Block
from mckibben.arrays import Array
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.hysteresis.gpi import GPI
from mckibben.blocks.hysteresis.pi import PI
from mckibben.blocks.planning import clip_path
from mckibben.blocks.predictive import Predictive
from mckibben.exporting.c.emulation import emulate, missing_tools
from mckibben.exporting.c.project import export_c

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
    state = block.initial_state(held[0], sample_time=STEP)
    start = state[: block.forward_model.n_states].tolist()
    pressures = np.empty((len(held), n))
    block.bind(STEP, state, ahead, pressures)()
    driven = np.hstack([pressures, held[:, n:]])
    given = block.forward_model.simulate(driven, initial=start, sample_time=STEP)
    return np.asarray(given)[HORIZON:], float(state[-1] / len(held))


def clipped(inverse: Block, references: Array, **limits: float) -> Array:
    """Return what the model makes of the inverse's pressures, clipped to the limits one by one."""
    block = Predictive(inverse, **limits)  # type: ignore[arg-type]
    n, (low, high) = len(block.outputs), block.pressures
    held = np.concatenate([np.repeat(references[:1], HORIZON, axis=0), references])
    pressures = np.asarray(inverse.simulate(held, sample_time=STEP))
    pressures = pressures.reshape(-1, n)
    change = limits.get("rate_limit", np.inf) * STEP
    clip_path(np.concatenate([[change], low, high]), pressures.reshape(-1))
    start = block.initial_state(held[0], sample_time=STEP)[: block.forward_model.n_states].tolist()
    driven = np.hstack([pressures, held[:, n:]])
    given = block.forward_model.simulate(driven, initial=start, sample_time=STEP)
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
        "balance, 2 muscles": (Predictive(arm, rate_limit=8.0), two),
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
        for horizon in (HORIZON, 10):
            found = emulate(replace(block, horizon=horizon), sample_time=STEP)  # type: ignore[type-var]
            steps = found.instructions[1:]
            print(
                f"| {name} | {horizon} | {np.median(steps):.0f} | {steps.max():.0f} | {found.ram} | "
                f"{found.stack} | {found.flash} | {found.difference:.1e} |",
                flush=True,
            )


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    in_the_model()
    on_this_machine()
    on_a_microcontroller()
