"""Sampling: time, samples a branch, noise and steps of the sensor."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mckibben.excitation.gap import Gap, counted, value
from mckibben.excitation.seen import Seen, scatter, some

FEWEST = 8
"""Samples below which a branch has no shape."""

LEAP = 0.1
"""Share of its range by which an output leaps from one sample to the next."""

LOUD = 0.03
"""Noise of a sample as a share of the range, from which it hides small loops."""

COARSE = 1 / 50
"""Step of a sensor as a share of the range, from which it hides small loops."""

CLEARLY = 3.0
"""Times as much as inputs, in shares of their ranges, that an output scatters by noise of its own."""

VALUES = 5000
"""Samples in which a step is looked for."""


def sampling(seen: Seen) -> Iterator[Gap]:
    """Give recordings without time, with too few samples a branch, and outputs that are hard to read."""
    if not seen.timed:
        yield Gap(
            "time",
            "Neither creep nor rate dependence can be told: the recordings have no time.",
            "Record with a time column, or say the rate with --rate; hold for 30 s here and there.",
            "all that depends on time (lags, damping, creep), which is left out of models",
            0.8,
        )
    yield from _few(seen)
    for name in seen.outputs:
        if seen.moving and seen.scales[name].moves:
            yield from _hidden(seen, name)


def _few(seen: Seen) -> Iterator[Gap]:
    # where outputs go smoothly nothing is missed, however fast inputs jump
    if not any(_jumps(seen, name) for name in seen.outputs):
        return
    for name in seen.moving:
        branches = seen.branches[name]
        travel = np.array([branch.travel for branch in branches])
        samples = np.array([branch.samples for branch in branches])
        if not travel.size or travel[samples < FEWEST].sum() <= 0.5 * travel.sum():
            continue
        n = float(np.median(samples))
        steps = {recording.sample_time for recording in seen.recordings}
        step = max(step for step in steps if step) if any(steps) else None
        now = "" if step is None else f" (every {value(step * n / (5 * FEWEST), 's')})"
        yield Gap(
            "sampling",
            f"How the output gets from one turning point to the next cannot be told: half of the "
            f"branches of {name} have {counted(int(n), 'sample')} or fewer.",
            f"Record {5 * FEWEST} samples a branch or more{now}.",
            "shape of branches and loops (envelopes, small thresholds), lags",
            0.5,
            {"samples": n},
            (name,),
        )


def _jumps(seen: Seen, name: str) -> bool:
    """Tell whether an output covers most of its way in leaps, from one sample to the next."""
    leaps = np.concatenate([np.abs(np.diff(recording[name])) for recording in seen.recordings])
    return bool(leaps[leaps > LEAP * seen.scales[name].span].sum() > 0.5 * leaps.sum())


def _hidden(seen: Seen, name: str) -> Iterator[Gap]:
    span, unit = seen.scales[name].span, seen.unit(name)
    noise = _noise(seen, name)
    if noise > LOUD * span:
        yield Gap(
            "noise",
            f"Loops and creep below {value(2 * noise, unit)} are hidden in single samples: the noise of "
            f"{name} is {value(noise, unit)}, {value(100 * noise / span)} % of its range.",
            f"Record each cycle {max(4, round((noise / (LOUD / 3 * span)) ** 2))} times, or with a "
            "quieter sensor.",
            "small thresholds and weights, minor loops, creep",
            0.45,
            {"noise": noise, "share": noise / span},
            (name,),
        )
    step = _step(seen, name)
    if step > COARSE * span:
        yield Gap(
            "resolution",
            f"Movements below {value(step, unit)} cannot be told: {name} comes in steps of that size, "
            f"{value(100 * step / span)} % of its range.",
            f"Record {name} with a finer range of its sensor or converter "
            f"({value(span / 500, unit)} or less).",
            "small thresholds, creep, behaviour just after a reversal",
            0.45,
            {"step": step, "share": step / span},
            (name,),
        )


def _noise(seen: Seen, name: str) -> float:
    """Return the noise of an output, however large, or 0 where it cannot be told from motion.

    Where an input scatters as much, the output may well follow it.
    """
    found = []
    for recording in some(seen.recordings):
        if len(recording) < 32:
            continue
        one, is_noise = scatter(recording[name])
        follows = max(scatter(recording[u])[0] / seen.scales[u].span for u in seen.moving)
        noisy = is_noise and one / seen.scales[name].span > CLEARLY * follows
        found.append(one / (0.6745 * np.sqrt(20.0)) if noisy else 0.0)
    return float(np.median(found)) if found else 0.0


def _step(seen: Seen, name: str) -> float:
    """Return the least step between values of an output that many samples share, or 0."""
    values = np.concatenate([r[name][:: max(1, len(r) // VALUES)] for r in seen.recordings])
    known = np.unique(values)
    if known.size < 3 or known.size > values.size / 5:
        return 0.0
    gaps = np.diff(known)
    return float(np.quantile(gaps[gaps > 1e-9 * seen.scales[name].span], 0.1))
