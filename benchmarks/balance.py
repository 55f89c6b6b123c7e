"""Measure the model `balance` beside the others on the same data, against its targets.

    python benchmarks/balance.py [SECTION ...] [--data FOLDER] [--seeds N]

Every figure is of runs that nothing learned from. Of several seeds or runs, a cell has median and range,
and a target is met by the median. Seeds are those of sensor noise and of random references. FOLDER holds
measured recordings, which do not come with the package (see docs/measured). All sections take about ten
minutes on one core.
"""

from __future__ import annotations

import argparse
import statistics
import time
import warnings
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mckibben import Recording, Series, compare, load_rig
from mckibben.blocks.base import Block
from mckibben.blocks.coupled.load_estimate import load_of
from mckibben.control import track
from mckibben.measured.running import span_of
from mckibben.measured.sets import fit_and_test_data, sets_in
from mckibben.papers.activation_pressure.protocol import FORCES
from mckibben.papers.recognising import EXTENSOR
from mckibben.papers.sdchm.loops import MOVES, single_task, widths
from mckibben.papers.sdchm.protocol import PERIOD
from mckibben.registry import load
from mckibben.rigs import record
from mckibben.signals import random_wave
from mckibben.signals.protocol import protocol

Array = NDArray[np.float64]

Figures = dict[str, list[float]]
"""By model, a figure a seed or run."""

Runs = dict[str, Recording]

BALANCE = "balance"
WITH_PATTERNS = "balance, whole protocol"

OUTPUTS = ("displacement_1", "displacement_2", "displacement_3")
CONTROL_TIME = 0.05
"""Of the soft arm: what is followed, and the control step [s]."""

RAIL_TESTS = ("status-4", "random-3")

MEASURED = {
    "festo_dmsp10_levels": {"": 0.8},
    "festo_dmsp10_static": {"": np.nan},
    "cavatappi_loads": {"": 5.0},
    "festo_isometric_10mm": {"run 10": 4.0, "a length left out": 6.0},
}
"""Targets of measured sets by task, or of all, in per cent of the range of what is tested on, or, where
a part is left out in turn, of all.
"""

BASELINES = {
    "displacement": ("cpi", "gpi", "preisach", BALANCE),
    "force": ("force-bilinear", "balance-force"),
}
"""Models that are compared on measured sets, the balance last, by output."""


@dataclass(frozen=True)
class Row:
    """A target: the highest figure that is good enough, NaN where there is none."""

    section: str
    what: str
    unit: str
    target: float
    figures: Mapping[str, Sequence[float]]

    @property
    def met(self) -> bool | None:
        """Whether the balance's median keeps to the target; None where there is none."""
        if np.isnan(self.target):
            return None
        return statistics.median(self.figures[BALANCE]) <= self.target

    def __str__(self) -> str:
        others = (f"{name} {shown(v)}" for name, v in self.figures.items() if name != BALANCE)
        target = "" if np.isnan(self.target) else f"{self.target:g}"
        met = {None: "", True: "yes", False: "NO"}[self.met]
        own = shown(self.figures[BALANCE])
        cells = (self.section, self.what, self.unit, "; ".join(others), own, target, met)
        return f"| {' | '.join(cells)} |"


def shown(values: Sequence[float]) -> str:
    """Return the median, and the range where there are several."""
    middle = f"{statistics.median(values):.3g}"
    return middle if len(values) == 1 else f"{middle} ({min(values):.3g} to {max(values):.3g})"


def rms(values: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def missed(block: Block, recording: Recording, *names: str) -> float:
    """Return the RMSE of a free run over outputs."""
    return rms(block.simulate(recording).matrix(names) - recording.matrix(names))


def fit(name: str, train: Sequence[Recording], **settings: Any) -> Block:
    """Return a fitted model."""
    model: Block = load("estimators", name)(**settings).fit(list(train)).model_
    return model


@cache
def rail_runs(seed: int) -> tuple[Runs, Runs]:
    """Return the runs to learn from and those to test on: every 20th sample, at 50 Hz."""
    sides: dict[str, Runs] = {"train": {}, "test": {}}
    for run, made in record("mpi-narmax", seed=seed, jobs=1):
        channels = {name: made[name][::20] for name in made.channels}
        step = (made.sample_time or 1.0) * 20
        sides[run.role][run.name] = Recording(channels, step, made.units, meta=made.meta)
    return sides["train"], sides["test"]


def following(model: Block, pulls: Recording, seed: int) -> float:
    """Return the RMSE of the rig open loop, on a smooth random reference under pulls [mm]."""
    step = pulls.sample_time or 1.0
    wave = random_wave(np.arange(round(60.0 / step)) * step, 0.2, 36.0, 8.0, seed=1000 + seed)
    time = np.arange(wave.size) * step
    force = np.interp(time, pulls.time - pulls.time[0], pulls["force"]).clip(0.0)
    reference = Recording({"displacement": wave, "force": force}, step)
    found = track(model.inverse(), load_rig("rail"), reference, approach=10.0, seed=seed)
    return found.rmse["displacement"]


def rail(seeds: int) -> Iterator[Row]:
    """Yield the targets of a muscle on a rail that is pulled at."""
    rows: dict[str, Figures] = defaultdict(lambda: defaultdict(list))
    narmax = {"method": "ls", "memory": "rdpi", "n_sets": 2}
    for seed in range(seeds):
        train, test = rail_runs(seed)
        runs, status = list(train.values()), test["status-4"]
        light = [run for run in runs if run["force"].max() < 105.0]  # 100 N as measured
        for name, settings in (
            ("cpi", {}),
            ("gpi", {}),
            ("mpi-narmax", {"input": "pressure", **narmax}),
            (BALANCE, {"input": ("pressure",)}),
        ):
            model = fit(name, runs, **settings)
            for run in RAIL_TESTS:
                rows[run][name].append(missed(model, test[run], "displacement"))
            if name not in ("cpi", "gpi"):  # which know no force
                by_light = fit(name, light, **settings)
                rows["213 N"][name].append(missed(by_light, train["status-3"], "displacement"))
                rows["152 N"][name].append(missed(by_light, status, "displacement"))
        error = load_of(model).simulate(status)["force"] - status["force"]
        rows["force"][BALANCE].append(100 * rms(error) / float(np.ptp(status["force"])))
        ways = {
            "directly": fit(BALANCE, runs, input=("voltage",)),
            "air in front": Series((fit("air", runs, longest_dead_time=0.1), model)),
        }
        own = {
            way: rms(np.array([missed(found, run, "displacement") for run in runs]))
            for way, found in ways.items()
        }
        better = ways[min(own, key=lambda way: own[way])]  # by what was learned from
        by_voltage = {"mpi-narmax": fit("mpi-narmax", runs, **narmax), **ways, BALANCE: better}
        for name, found in by_voltage.items():
            for run in RAIL_TESTS:
                rows[f"voltage, {run}"][name].append(missed(found, test[run], "displacement"))
            if name != "mpi-narmax":  # which has no inverse
                rows["loop"][name].append(following(found, status, seed))
    for name, what, unit, target in (
        ("status-4", "from pressure and force, status-4", "mm", 0.16),
        ("random-3", "from pressure and force, random-3", "mm", 0.16),
        ("voltage, status-4", "from voltage and force, status-4", "mm", 0.4),
        ("voltage, random-3", "from voltage and force, random-3", "mm", 0.4),
        ("213 N", "learned up to 100 N, at 213 N (status-3)", "mm", 0.5),
        ("152 N", "learned up to 100 N, up to 152 N (status-4)", "mm", 0.3),
        ("force", "force from pressure and displacement, status-4", "% of range", 2.0),
        ("loop", "open loop on a random reference under pulls", "mm", 0.35),
    ):
        yield Row("rail", what, unit, target, rows[name])


@cache
def arm_runs(seed: int, stages: tuple[str, ...], role: str = "train") -> Runs:
    """Return runs of the soft arm by name."""
    plan = protocol("sdchm")
    names = [r.name for r in plan.runs if r.role == role and r.labels["stage"] in stages]
    return {run.name: made for run, made in record(plan, runs=names, seed=seed, jobs=1)}


def joint(seed: int) -> list[Recording]:
    """Return the training runs in which all pressures are random at once."""
    return list(arm_runs(seed, ("joint",)).values())


def whole(seed: int) -> list[Recording]:
    """Return all that the protocol trains on: hysteresis of each muscle, patterns, joint runs."""
    return [*arm_runs(seed, ("hysteresis", "network")).values(), *joint(seed)]


def arm(seeds: int) -> Iterator[Row]:
    """Yield the targets of a soft arm of three muscles; in open loop, of the first seed's models.

    SDCHM needs runs that move one muscle alone, and so the whole protocol.
    """
    first = {
        "sdchm": fit("sdchm", whole(0)),
        WITH_PATTERNS: fit(BALANCE, whole(0)),
        BALANCE: fit(BALANCE, joint(0)),
    }
    by_seed = [first, *({BALANCE: fit(BALANCE, joint(seed))} for seed in range(1, seeds))]
    for extensor, what in (("p0", "extensor constant"), ("moving", "extensor moving")):
        figures: Figures = defaultdict(list)
        for seed, models in enumerate(by_seed):
            tests = arm_runs(seed, ("joint",), "test")
            chosen = [run for name, run in tests.items() if f"-{extensor}-" in name]
            for name, model in models.items():
                figures[name].append(max(missed(model, run, *OUTPUTS) for run in chosen))
        yield Row("arm", f"joint test, {what}, worst run", "mm", 0.8, figures)
    rig = load_rig("soft-arm")
    errors: Figures = defaultdict(list)
    across: Figures = defaultdict(list)
    time = np.arange(0, 3 * PERIOD, CONTROL_TIME, dtype=np.float64)
    for (_, p0), moving in zip(MOVES, OUTPUTS, strict=True):
        task = single_task(OUTPUTS, moving, time, p0)
        for name, model in first.items():
            found = track(model.inverse(), rig, task.reference, settle=task.settle)
            errors[name] += found.rmse.values()
            across[name] += widths(found.recording, moving, OUTPUTS).values()
    worst = [{name: [max(v)] for name, v in figures.items()} for figures in (errors, across)]
    yield Row("arm", "groups a to i open loop, worst", "mm", 0.5, worst[0])
    yield Row("arm", "their e_w, and cross-motion, worst", "%", 2.0, worst[1])
    ramp = np.linspace(0.5, 2.3, round(50.0 / CONTROL_TIME))
    still = dict.fromkeys(OUTPUTS, np.full(ramp.size, 33.0))
    sweep = Recording(still | {EXTENSOR: ramp}, CONTROL_TIME)
    holding: Figures = {}
    for name, model in first.items():
        found = track(model.inverse(), rig, sweep, settle=50.0 / 3)
        holding[name] = [max(found.rmse.values())]
    yield Row(
        "arm", "hold 33 mm, extensor 0.5 to 2.3 bar in 50 s, worst muscle", "mm", 0.5, holding
    )


def hanging(seeds: int) -> Iterator[Row]:
    """Yield the target of a muscle under 20 kg."""
    figures: Figures = defaultdict(list)
    for seed in range(seeds):
        runs = {run.role: made for run, made in record("field-models", seed=seed, jobs=1)}
        for name in ("cpi", "gpi", BALANCE):
            figures[name].append(missed(fit(name, [runs["train"]]), runs["test"], "displacement"))
    yield Row("mas-20", "irregular triangle, 20 kg", "mm", 0.15, figures)


def lifting() -> Iterator[Row]:
    """Yield the targets of a muscle that lifts weights: pressure from displacement and force."""
    train: list[Recording] = []
    tests: dict[tuple[float, float], Recording] = {}
    for run, made in record("activation-pressure", jobs=1):
        recording = made.with_derived(["contraction"])
        if run.role == "train":
            train.append(recording)
        else:
            tests[float(run.labels["force"]), float(run.labels["frequency"])] = recording
    theirs: Any = fit("activation-pressure", train)
    memory: Any = fit("activation-memory", train)
    balance = fit(BALANCE, train).inverse()
    for force in FORCES:
        figures: Figures = defaultdict(list)
        for (pulled, frequency), test in tests.items():
            if pulled != force:
                continue
            pressure = test["pressure"]
            for name, found in (
                ("the paper's", replace(theirs, frequency=frequency).simulate(test)["pressure"]),
                ("activation-memory", memory.simulate(test)["pressure"]),
                (BALANCE, balance.simulate(test)["pressure"]),
            ):
                figures[name].append(100 * rms(found - pressure) / float(np.ptp(pressure)))
        what = f"pressure on random waves at {force:g} N, every frequency"
        yield Row("E", what, "% of range", 4.0 if force else 4.5, figures)


def measured(folder: Path | None) -> Iterator[Row]:
    """Yield the targets of measured muscles, by the splits of docs/measured; nothing without them."""
    for one in sets_in(folder) if folder else ():
        for task in one.tasks() if one.name in MEASURED else ():
            train, test = fit_and_test_data(task, one.recordings(), one.folder)
            (output,) = task.outputs or ("displacement",)
            models = ("coupled-memory", BALANCE) if task.load else BASELINES[output]
            board = compare(
                train,
                test,
                input=task.inputs,
                output=task.outputs,
                models=models,
                load=task.load,
            )
            percent = 100 / span_of(task, train, test, [output])
            found = {row.model: [percent * row.test_error] for row in board.rows if row.test}
            figures = {name: found[name] for name in models[:-1] if name in found}
            what = " ".join([one.title, task.name, *task.leave_out]).strip()
            targets = MEASURED[one.name]
            target = targets.get(task.name, targets.get("", np.nan))
            yield Row(
                "measured", what, "% of range", target, figures | {BALANCE: found[models[-1]]}
            )


def step_microseconds(block: Block, run: Recording) -> float:
    """Return the median time of a step from Python [µs]."""
    inputs = run.matrix([channel.name for channel in block.inputs])
    stream, times = block.stream(run.sample_time or 1.0), []
    for row in inputs[np.arange(20_000) % len(inputs)]:
        started = time.perf_counter_ns()
        stream.step(row)
        times.append(time.perf_counter_ns() - started)
    return statistics.median(times) / 1e3


def speed(seeds: int) -> Iterator[Row]:
    """Yield the times of fits, and of steps from Python."""
    train, _ = rail_runs(0)
    names = ("status-1", "status-2", "status-3", "training-pulls-100N")
    four, arms = [train[name] for name in names], joint(0)
    fit(BALANCE, four)  # compiles
    for what, runs, settings, target in (
        ("fit of one muscle, 4 x 60 s at 50 Hz", four, {"input": ("pressure",)}, 2.0),
        ("fit of the arm's joint runs", arms, {}, np.nan),
        ("fit of the arm's whole protocol", whole(0), {}, 15.0),
    ):
        seconds = []
        for _ in range(seeds):
            started = time.perf_counter()
            fit(BALANCE, runs, **settings)
            seconds.append(time.perf_counter() - started)
        yield Row("speed", what, "s", target, {BALANCE: seconds})
    for what, runs, settings, target in (
        ("one muscle", four, {"input": ("pressure",)}, 3.0),
        ("three muscles", arms, {}, 10.0),
    ):
        model = fit(BALANCE, runs, **settings)
        for way, block in (("displacements", model), ("pressures", model.inverse())):
            figures = {BALANCE: [step_microseconds(block, runs[-1])]}
            yield Row("speed", f"step from Python, {what}, to {way}", "µs", target, figures)


def main() -> None:
    """Print the table."""
    sections: dict[str, Callable[[], Iterator[Row]]] = {
        "rail": lambda: rail(given.seeds),
        "arm": lambda: arm(given.seeds),
        "mas-20": lambda: hanging(given.seeds),
        "lifting": lifting,
        "measured": lambda: measured(given.data),
        "speed": lambda: speed(given.seeds),
    }
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sections", nargs="*", metavar="SECTION", help=", ".join(sections))
    parser.add_argument("--data", type=Path, help="folder of measured recordings")
    parser.add_argument("--seeds", type=int, default=3)
    given = parser.parse_args()
    if unknown := set(given.sections) - set(sections):
        parser.error(f"there is no section {', '.join(sorted(unknown))}")
    warnings.simplefilter("ignore")
    print("| section | what | unit | baselines | balance | target | met |")
    print("|---|---|---|---|---:|---:|---|")
    met = []
    for name in given.sections or sections:
        for row in sections[name]():
            print(row, flush=True)
            met.append(row.met)
    print(f"\n{met.count(True)} of {len(met) - met.count(None)} targets met.")


if __name__ == "__main__":
    main()
