"""Excitations by seed, protocols, turning points, and what is done to recordings."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from mckibben import Recording, signals
from mckibben.registry import load, names
from tests.golden.case import Case, Tree
from tests.golden.models import path
from tests.golden.running import same, stored

FILTERED = 1e-11
"""Of what SciPy filters: its last bits are those of its version."""

TIME = np.arange(400) * 0.05

SHAPES: dict[str, dict[str, Any]] = {
    "binary-steps": {"high": 4.0, "low": 1.0, "hold": 0.5, "ramp": 0.1, "seed": 3},
    "chirp": {"start_frequency": 0.1, "end_frequency": 2.0, "high": 4.0, "low": 1.0},
    "constant": {"value": 2.5},
    "decaying-sine": {"period": 4.0, "high": 5.0, "low": 0.5, "n_cycles": 4},
    "decaying-triangle": {"period": 4.0, "high": 5.0, "low": 0.5, "n_cycles": 4},
    "irregular-triangle": {"n_turns": 12, "high": 5.0, "low": 0.5, "seed": 3},
    "multisine": {"period": 5.0, "max_frequency": 2.0, "high": 5.0, "low": 0.5},
    "progressive-sine": {"period": 4.0, "high": 5.0, "low": 0.5, "n_cycles": 4},
    "progressive-triangle": {"period": 4.0, "high": 5.0, "low": 0.5, "n_cycles": 4},
    "pulls": {"high": 50.0, "n_pulls": 2, "duration": 6.0, "low": 5.0},
    "ramps": {"instants": "1/5/9/18", "values": "0/4/4/1"},
    "random-wave": {"max_frequency": 1.0, "high": 5.0, "low": 0.5, "seed": 3},
    "sine": {"period": 4.0, "peaks": "2/4/5", "low": 0.5},
    "staircase": {"levels": "1/3/2/5", "hold": 4.0, "ramp": 0.5},
    "triangle": {"period": 4.0, "peaks": "2/4/5", "low": 0.5},
}

VARIED: dict[str, dict[str, Any]] = {
    "chirp": {"law": "logarithmic"},
    "multisine": {"phases": "random", "seed": 7},
    "random-wave": {"min_frequency": 0.3},
}
"""What else some are asked for."""


def one(values: np.ndarray, every: int = 5) -> Tree:
    return stored(values[:, np.newaxis], every)


def excitation(name: str, folder: Path) -> Tree:
    """Return a signal, with other settings, and from another seed."""
    del folder
    settings = SHAPES[name]
    found = {"settings": settings, "signal": one(signals.build(name, TIME, **settings))}
    if name in VARIED:
        found["varied"] = one(signals.build(name, TIME, **settings | VARIED[name]))
    seeded = settings | VARIED.get(name, {})
    if "seed" in seeded:
        first, again = (signals.build(name, TIME, **seeded) for _ in range(2))
        other = signals.build(name, TIME, **seeded | {"seed": 4})
        found |= {"again": same(first, again), "another seed": one(other)}
    return found


def protocol(name: str, folder: Path) -> Tree:
    """Return the sums of a printed protocol's runs, by role, and some of the runs."""
    del folder
    printed = load("protocols", name)()
    roles: dict[str, dict[str, Any]] = {}
    for run in printed.runs:
        of_role = roles.setdefault(run.role, {"runs": 0, "samples": 0, "lead": 0.0, "sums": {}})
        of_role["runs"] += 1
        of_role["samples"] += len(run.inputs)
        of_role["lead"] += run.lead
        for channel in run.inputs.channels:
            before = of_role["sums"].get(channel, 0.0)
            of_role["sums"][channel] = before + math.fsum(run.inputs[channel])
    some = printed.runs[:: max(len(printed.runs) // 6, 1)]
    return {
        "rig": printed.rig,
        "roles": roles,
        "runs": {
            run.name: {
                "role": run.role,
                "sample time": run.inputs.sample_time,
                "settings": dict(run.settings),
                "labels": dict(run.labels),
                "sums": {c: math.fsum(run.inputs[c]) for c in run.inputs.channels},
            }
            for run in some
        },
    }


def measured(noise: float = 0.004) -> Recording:
    """Return pressure and displacement that lags behind it, with noise."""
    rng = np.random.default_rng(5)
    n, shape = 600, np.interp(np.arange(600) / 4, np.arange(150), path(0, 150))
    displacement = 8.0 * np.convolve(shape, np.ones(9) / 9, mode="same") ** 1.5
    return Recording(
        {
            "pressure": 5.0 * shape + noise * rng.standard_normal(n),
            "displacement": displacement + 0.02 * rng.standard_normal(n) + 0.001 * np.arange(n),
        },
        0.02,
        start_time=1.0,
    )


def turning(folder: Path) -> Tree:
    """Return turning points, branches, cycles and noise of clean and noisy signals."""
    del folder
    noisy = measured()["pressure"]
    return {
        name: {
            "reversals": signals.reversals(x),
            "of large swings": signals.reversals(x, 1.5),
            "branches": np.array(signals.branches(x)),
            "cycles": [[part.start, part.stop] for part in signals.cycles(x)],
            "noise": round(signals.noise_level(x), 12),
        }
        for name, x in {
            "clean": 5.0 * path(0, 180),
            "noisy": noisy,
            "noisier": measured(0.05)["pressure"],
            "falling first": -noisy,
            "triangle": signals.build("triangle", TIME, period=4.0, peaks="2/4/5"),
            "flat": np.ones(20),
        }.items()
    }


def traces(recording: Recording) -> Tree:
    kept = {c: one(recording[c], max(len(recording) // 40, 1)) for c in recording.channels}
    return kept | {
        "samples": len(recording),
        "sample time": recording.sample_time,
        "start": recording.start_time,
    }


def treated(folder: Path) -> Tree:
    """Return what cutting, thinning, filtering and splitting make of a recording."""
    del folder
    run = measured()
    at = round(0.75 * len(run))
    first, rest = run.slice(0, at), run.slice(at, len(run))
    thinned, tested, _ = signals.made_manageable([run, first], [rest], "pressure", most=200)
    return {
        "cut": traces(signals.cut(run, 2.0, 7.5)),
        "low_pass": traces(signals.low_pass(run, 3.0)),
        "low_pass of one": traces(signals.low_pass(run, 3.0, ["displacement"])),
        "detrend": traces(signals.detrend(run, ["displacement"])),
        "coarser": traces(signals.resample(run, 0.05)),
        "much coarser": traces(signals.resample(run, 0.31)),
        "finer": traces(signals.resample(run, 0.007)),
        "zeroed": traces(signals.zeroed(run, ["displacement"], "pressure")),
        "coarsened": traces(signals.coarsened(run, 7, "pressure")),
        "first": traces(first),
        "rest": traces(rest),
        "blocks of cycles": [list(block) for block in signals.split_cycles(run, "pressure", 4)],
        "made manageable": [traces(part) for part in (*thinned, *tested)],
        "for drawing": [
            one(series, 1)
            for series in signals.decimate_minmax(
                np.arange(len(run)), run["pressure"], run["displacement"], max_points=60
            )
        ],
    }


def cases() -> Iterator[Case]:
    """Yield a case for every excitation and protocol, and on what is done to signals."""
    for name in names("signals"):
        yield Case(f"signals/{name}", f"signals.build({name!r}, ...)", partial(excitation, name))
    for name in names("protocols"):
        yield Case(f"signals/protocol-{name}", f"protocol {name}", partial(protocol, name))
    yield Case("signals/turning-points", "reversals, branches, cycles, noise_level", turning)
    yield Case(
        "signals/treated",
        "cut, resample, low_pass, detrend, coarsened, ...",
        treated,
        {"*": FILTERED},
    )
