"""Errors of `air` on virtual regulators, in simulation and in a loop.

Run: python docs/models/air.py      writes docs/models/air.md
"""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mckibben import Recording, Series, load_rig
from mckibben.blocks.base import Block
from mckibben.control import track
from mckibben.registry import load

Array = NDArray[np.float64]

HEAD = """# Valve, regulator and air

```{index} !valve, !air, !regulator
```

Made by `python docs/models/air.py`; do not edit. `air` is fitted to one run of a virtual rig and
simulated on another with different random commands of the same kind. *Sensor* is the standard
deviation of noise and quantization. The table shows RMSE [bar] on the fitted run, on the other run,
and on the parts of the other run in which the model fills or vents (by more than 0.2 bar/s) or does
neither.
"""

LIMITS = """
With small steps near one pressure, the error on the fitted run is {least:.1f} times the sensor
noise. Over the whole range, the model has systematic errors. The air flow in the rigs follows ISO
6358: at large pressure differences it is choked, so that filling starts at a constant rate and
venting slows down towards atmospheric pressure. The volume of a moving muscle also changes. The
constant lags of `air` are a compromise; its standard errors do not include this error.

## In a loop

RMSE [mm] of open-loop tracking on the virtual rail, from voltage to displacement, for sines of
{stroke:.0f} mm: the inverse of `gpi` identified on the voltage; the inverse of `gpi` identified on
the measured pressure with `air` in series; and the latter with its reference 20 ms earlier than the
identified dead time of {dead:.0f} ms, to show the effect of a wrong preview.

| frequency [Hz] | `gpi` | `air` and `gpi` | 20 ms too early |
|---:|---:|---:|---:|
"""

COLUMNS = (
    *("rig", "commands", "sensor", "run fitted", "other run"),
    *("filling", "venting", "neither", "other run / sensor"),
)
STEP = {"rail": 0.001, "soft-arm": 0.01}
KINDS = ("levels", "small steps", "waves up to 1 Hz")
FREQUENCIES = (0.1, 0.5, 1.0, 2.0)
LOOP_STEP = 0.005


def commands(kind: str, low: float, high: float, step: float, seed: int) -> Array:
    """Return 20 s, or 60 s on coarse grids, of commands that begin at rest at the lowest."""
    rng = np.random.default_rng(seed)
    n = round((20 if step < 0.005 else 60) / step)
    span = high - low
    if kind == "levels":
        held = np.round(rng.uniform(0.1, 0.6, n) / step).astype(int)
        u = np.repeat(rng.uniform(low, high, n), held)[:n]
    elif kind == "small steps":
        places = 0.45 * span + np.cumsum(0.04 * span * rng.uniform(-1, 1, n))
        u = low + np.repeat(np.clip(places, 0.1 * span, 0.85 * span), round(0.15 / step))[:n]
        u[: n // 10] = np.linspace(low, u[n // 10], n // 10)
    else:
        t = np.arange(n) * step
        waves = zip(rng.uniform(0.05, 1.0, 12), rng.uniform(0, 2 * np.pi, 12), strict=True)
        u = np.sum([np.sin(2 * np.pi * f * t + phase) for f, phase in waves], axis=0)
        u = low + span * (u - u.min()) / np.ptp(u) * np.minimum(1.0, 2 * t)
    u[: round(0.1 / step)] = low
    return u


def run_of(name: str, kind: str, seed: int, step: float | None = None) -> Recording:
    """Return a run of a rig with commands and measurements."""
    rig, step = load_rig(name), step or STEP[name]
    if name == "rail":
        return rig.run(
            Recording({"voltage": commands(kind, 0.1, 9.5, step, seed)}, step), seed, held=True
        )
    given = {f"pressure_{k}": commands(kind, 0.0, 2.4, step, 10 * seed + k) for k in (1, 2, 3)}
    extensor = np.ones(len(given["pressure_1"]))
    measured = rig.run(Recording(given | {"pressure_extensor": extensor}, step), seed, held=True)
    commanded = {f"command_{channel}": values for channel, values in given.items()}
    return measured.with_channels(dict.fromkeys(commanded, "bar"), **commanded)


def rms(values: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def fitted(run: Recording, model: str, **settings: object) -> Block:
    """Return a model fitted to a run."""
    block: Block = load("estimators", model)(**settings).fit(run).model_
    return block


def row(name: str, kind: str) -> tuple[str, float]:
    """Return a line of the table, and the error on the run fitted over the noise."""
    given, wanted = (
        ("voltage", "pressure") if name == "rail" else ("command_pressure_1", "pressure_1")
    )
    train, test = (run_of(name, kind, seed) for seed in (1, 2))
    sensor = load_rig(name).sensor["pressure"]
    noise = float(np.hypot(sensor.noise, sensor.resolution / np.sqrt(12)))
    air = fitted(train, "air", input=given, output=wanted, longest_dead_time=0.1)
    own = rms(air.simulate(train)[wanted] - train[wanted])
    found = air.simulate(test)[wanted]
    error, rate = found - test[wanted], np.gradient(found, STEP[name])
    phases = [rate > 0.2, rate < -0.2, np.abs(rate) <= 0.2]
    cells = [noise, own, rms(error), *(rms(error[phase]) for phase in phases)]
    text = " | ".join(f"{cell:.4f}" for cell in cells)
    return f"| `{name}` | {kind} | {text} | {rms(error) / noise:.1f} |", own / noise


def loop() -> tuple[list[str], float, float]:
    """Return lines of RMSE by frequency, stroke and dead time [ms]."""
    run, rig = run_of("rail", KINDS[-1], 3, LOOP_STEP), load_rig("rail")
    air, muscle = fitted(run, "air", longest_dead_time=0.1), fitted(run, "gpi")
    direct, both = fitted(run, "gpi", input="voltage").inverse(), Series((air, muscle)).inverse()
    (low,), (high,) = muscle.reachable()
    lines = []
    for frequency in FREQUENCIES:
        t = np.arange(round(20 / LOOP_STEP)) * LOOP_STEP
        sine = low + (high - low) * (0.55 - 0.25 * np.cos(2 * np.pi * frequency * t))
        wanted = Recording({"displacement": sine}, LOOP_STEP)
        cells = []
        for block, early in ((direct, None), (both, None), (both, air.dead_time + 0.02)):
            came = track(block, rig, wanted, approach=5.0, settle=4.0, preview=early)
            cells.append(f"{came.rmse['displacement']:.2f}")
        lines.append(f"| {frequency:g} | {' | '.join(cells)} |")
    return lines, 0.5 * float(high - low), 1e3 * air.dead_time


def main() -> None:
    """Write the page."""
    warnings.simplefilter("ignore")
    lines = [
        HEAD,
        f"| {' | '.join(COLUMNS)} |",
        "|---|---|---:|---:|---:|---:|---:|---:|---:|",
    ]
    rows = [row(name, kind) for name in STEP for kind in KINDS]
    lines += [text for text, _ in rows]
    table, stroke, dead = loop()
    limits = LIMITS.format(least=min(ratio for _, ratio in rows), stroke=stroke, dead=dead)
    lines.append(limits.rstrip("\n"))
    lines += table
    Path(__file__).with_name("air.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
