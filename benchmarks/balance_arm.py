"""Targets of a soft arm of three muscles round an extensor, and of arms unlike the one learned from."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from functools import cache

import numpy as np

from balance_rows import BALANCE, Array, Fits, Row, missed
from mckibben import Recording, Series, load_rig
from mckibben.blocks.compose import PerChannel
from mckibben.blocks.core.block import Block
from mckibben.control import Tracked, track
from mckibben.papers.sdchm.compensation import CONTROL_TIME, loop_width, references, settle
from mckibben.papers.sdchm.protocol import PERIOD
from mckibben.papers.sdchm.recordings import EXTENSOR, OUTPUTS
from mckibben.rigs import Rig, record
from mckibben.signals import random_wave
from mckibben.signals.protocol import protocol

MIDDLE = 33.0
"""Where muscles are held [mm]."""

SWEEP, SWEEP_TIME = (0.5, 2.3), 50.0
"""Of the extensor's pressure while muscles are held: range [bar] and time [s]."""

FAST_STEP, FAST_TIME, FASTEST, AMPLITUDES = 0.005, 40.0, 1.0, (6.0, 3.0)
"""Of the fast references: control step and time [s], frequency [Hz], amplitudes [mm]."""

AIR_TIME, AIR_FREQUENCY, AIR_HIGH = 60.0, 1.5, 2.4
"""Of the run that air is fitted to: time [s], highest frequency [Hz], highest pressure [bar]."""

N_ARMS, SPREAD, PAYLOAD, CREEP = 20, 0.1, 2.0, 2.0
"""Arms unlike the nominal one; factor on muscles, most payload [kg], factor on creep."""

WITH_PATTERNS = "balance, whole protocol"


@cache
def arm_runs(seed: int, stages: tuple[str, ...], role: str) -> dict[str, Recording]:
    """Return runs of the protocol by name."""
    plan = protocol("sdchm")
    names = [r.name for r in plan.runs if r.role == role and r.labels["stage"] in stages]
    return {run.name: made for run, made in record(plan, runs=names, seed=seed, jobs=1)}


def joint(seed: int, role: str = "train") -> dict[str, Recording]:
    """Return the runs in which all pressures are random at once."""
    return arm_runs(seed, ("joint",), role)


def whole(seed: int) -> list[Recording]:
    """Return all that the protocol trains on: hysteresis of each muscle, patterns, joint runs."""
    return [*arm_runs(seed, ("hysteresis", "network"), "train").values(), *joint(seed).values()]


def models(fits: Fits, seed: int) -> dict[str, Block]:
    """Return the models: SDCHM, which needs runs that move one muscle alone, on the whole protocol."""
    runs = list(joint(seed).values())
    return {
        "sdchm": fits(("arm", seed), "sdchm", whole(seed)),
        WITH_PATTERNS: fits(("arm", seed), BALANCE, whole(seed)),
        BALANCE: fits(("joint", seed), BALANCE, runs),
    }


def followed(
    model: Block, reference: Recording, rig: Rig, *, pressure_loop: bool = True
) -> Tracked:
    """Return what came of a model's inverse, open loop."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return track(
            model.inverse(), rig, reference, settle=settle(reference), pressure_loop=pressure_loop
        )


def worst(tracked: Tracked) -> float:
    """Return the largest RMSE of all muscles [mm]."""
    return max(tracked.rmse.values())


def held(step: float, p0: Array) -> Recording:
    """Return a reference of muscles held while the extensor's pressure moves."""
    still = dict.fromkeys(OUTPUTS, np.full(p0.size, MIDDLE))
    return Recording(still | {EXTENSOR: p0}, step)


def fast(amplitude: float) -> Recording:
    """Return a fast sine of muscle 1, the others held."""
    time = np.arange(round(FAST_TIME / FAST_STEP)) * FAST_STEP
    still = held(FAST_STEP, np.full(time.size, 0.7))
    wave = MIDDLE + amplitude * np.sin(2 * np.pi * FASTEST * time)
    return still.with_channels(**{OUTPUTS[0]: wave})


def airs(rig: Rig, fits: Fits, seed: int) -> PerChannel:
    """Return air of every muscle, fitted to a run of its own with fast commands."""
    time = np.arange(round(AIR_TIME / FAST_STEP)) * FAST_STEP
    rise = np.minimum(1.0, time)
    given = {
        f"pressure_{k}": rise * random_wave(time, AIR_FREQUENCY, AIR_HIGH, seed=500 + k)
        for k in (1, 2, 3)
    }
    extensor = {EXTENSOR: np.ones(time.size)}
    measured = rig.run(Recording(given | extensor, FAST_STEP), seed, held=True)
    commands = {f"command_{name}": values for name, values in given.items()}
    run = measured.with_channels(dict.fromkeys(commands, "bar"), **commands)
    return PerChannel(
        tuple(
            fits(
                ("air", seed),
                "air",
                [run],
                input=f"command_{name}",
                output=name,
                longest_dead_time=0.1,
            )
            for name in given
        )
    )


def arm(seeds: int) -> Iterator[Row]:
    """Yield the targets of the arm; open loop on the first seed's models."""
    fits = Fits()
    for extensor, what in (("p0", "extensor constant"), ("moving", "extensor moving")):
        figures: dict[str, list[float]] = {}
        said = []
        for seed in range(seeds):
            tests = {n: run for n, run in joint(seed, "test").items() if f"-{extensor}-" in n}
            balance = fits(("joint", seed), BALANCE, list(joint(seed).values()))
            found = {BALANCE: balance} if seed else models(fits, seed)  # one seed of what is slow
            for name, model in found.items():
                errors = [missed(model, run, *OUTPUTS) for run in tests.values()]
                figures.setdefault(name, []).append(max(errors))
                if name == BALANCE:
                    said.append(" ".join(f"{error:.2f}" for error in errors))
        note = (
            "sdchm learned from the whole protocol, since it needs muscles moved alone; the others from "
            f"the joint runs unless told. The balance's runs by seed: {', '.join(said)}"
        )
        yield Row("arm", f"joint test, {what}, worst run", "mm", 0.8, figures, note)
    rig = load_rig("soft-arm")
    yield from _groups(models(fits, 0), rig)
    ramp = np.linspace(*SWEEP, round(SWEEP_TIME / CONTROL_TIME))
    sweep = held(CONTROL_TIME, ramp)
    figures = {
        name: [worst(followed(model, sweep, rig))] for name, model in models(fits, 0).items()
    }
    what = f"hold {MIDDLE:g} mm, extensor {SWEEP[0]} to {SWEEP[1]} bar in {SWEEP_TIME:g} s"
    yield Row("arm", what, "mm", 0.5, figures, "worst muscle")
    yield from _fast(models(fits, 0), rig, fits)


def _groups(found: Mapping[str, Block], rig: Rig) -> Iterator[Row]:
    errors: dict[str, list[float]] = {}
    widths: dict[str, list[float]] = {}
    for task, reference in references(3, 3, CONTROL_TIME).items():
        if task == "task":
            continue
        moving = OUTPUTS[int(task[-1]) - 1]
        for name, model in found.items():
            came = followed(model, reference, rig)
            errors.setdefault(name, []).extend(came.rmse.values())
            widths.setdefault(name, []).extend(
                loop_width(came, moving, output) for output in OUTPUTS
            )
    said = ", ".join(f"{g} {e:.2f}" for g, e in zip("abcdefghi", errors[BALANCE], strict=True))
    yield Row(
        "arm",
        "groups a to i open loop, worst",
        "mm",
        0.5,
        _worst(errors),
        f"balance by group: {said}",
    )
    said = ", ".join(f"{g} {e:.2f}" for g, e in zip("abcdefghi", widths[BALANCE], strict=True))
    yield Row("arm", "their e_w, worst", "%", 2.0, _worst(widths), f"balance by group: {said}")


def _worst(figures: Mapping[str, list[float]]) -> dict[str, list[float]]:
    return {name: [max(values)] for name, values in figures.items()}


def _fast(found: Mapping[str, Block], rig: Rig, fits: Fits) -> Iterator[Row]:
    air = airs(rig, fits, 0)
    for amplitude in AMPLITUDES:
        reference = fast(amplitude)
        figures = {
            f"{name}, no air": [worst(followed(model, reference, rig))]
            for name, model in found.items()
        }
        for name, model in found.items():
            came = followed(Series((air, model)), reference, rig, pressure_loop=False)
            figures[name] = [worst(came)]
        empty = 100 * float(np.mean(came.recording["command_pressure_1"] <= 0.0))
        note = (
            f"worst muscle; under the balance muscle 1's regulator is told 0 bar {empty:.0f} % of the "
            "time; no air: an inner loop of pressure instead, as in the other rows"
        )
        what = f"{FASTEST:g} Hz, {amplitude:g} mm on muscle 1 with preview, 5 ms"
        yield Row("arm", what, "mm", 0.8, figures, note)


def unlike(rig: Rig, rng: np.random.Generator) -> Rig:
    """Return an arm of other muscles, under a payload, that creeps more."""
    fields = rig.model_dump()
    changes: dict[str, object] = {
        f"spread.{name}": tuple(
            factor * rng.uniform(1 - SPREAD, 1 + SPREAD) for factor in fields["spread"][name]
        )
        for name in ("diameter", "bladder", "friction")
    }
    changes["payload"] = rng.uniform(0.0, PAYLOAD)
    stiffness = fields["muscle"]["creep"]["stiffness"]
    changes["muscle.creep.stiffness"] = tuple(CREEP * value for value in stiffness)
    return rig.changed(changes)


def robust(seeds: int) -> Iterator[Row]:
    """Yield how models of the nominal arm do on others, open loop."""
    del seeds
    fits, rng = Fits(), np.random.default_rng(0)
    rig = load_rig("soft-arm")
    found = models(fits, 0)
    del found[WITH_PATTERNS]
    reference = references(1.5, 1, CONTROL_TIME)["muscle 1"]
    arms = [unlike(rig, rng) for _ in range(N_ARMS)]
    figures: dict[str, list[float]] = {}
    for name, model in found.items():
        figures[name] = [worst(followed(model, reference, other)) for other in arms]
    nominal = ", ".join(
        f"{name} {worst(followed(m, reference, rig)):.2f}" for name, m in found.items()
    )
    note = (
        f"muscle 1 follows 33 + 6 sin(2 pi t / {PERIOD:g} s) mm, worst muscle; on the nominal arm: "
        f"{nominal} mm"
    )
    yield Row("robust", f"{N_ARMS} arms unlike the one learned from", "mm", np.nan, figures, note)
