"""Compensation: the inverses of the models that predict, in loops on the arm."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from mckibben.blocks.base import Block
from mckibben.blocks.compose import Series
from mckibben.blocks.feedback import PIDFeedback
from mckibben.checkpoints import Checkpoints
from mckibben.control import Controller, Tracked, control_law, track, tune_pid
from mckibben.errors import ModelWarning
from mckibben.estimators.coupled.fuzzy import Search, printed_swarm
from mckibben.estimators.coupled.sdchm import learned_inverse
from mckibben.papers.reproduction import Cell, Figure, Table, thinned
from mckibben.papers.sdchm import printed
from mckibben.papers.sdchm.models import (
    BALANCE,
    INDIVIDUAL,
    OURS,
    PUBLISHED,
    QUICK_SEARCH,
    QUICK_SWARM,
    Models,
)
from mckibben.papers.sdchm.protocol import PERIOD
from mckibben.papers.sdchm.recordings import EXTENSOR, OUTPUTS
from mckibben.recording import Recording
from mckibben.rigs import load_rig
from mckibben.system.workers import Tell, all_of

MOVES = ((1, 0.7), (2, 1.5), (3, 2.3))
"""Muscle that moves, and pressure of the extensor [bar], for every three groups of Table 5."""

CONTROL_TIME, QUICK_CONTROL_TIME = 0.05, 0.1
"""Control step of the loops, and of the quick run's [s]."""

SEARCH_SAMPLES = 6000
"""Samples on which the antecedents of the paper's inverse network are searched."""

PAPERS, SINGLE, OURS_INVERTED = "SDIHC, the paper's", "individual inverse", "SDIHC, ours"
WITH_PID = f"{BALANCE} + PID"

FREQUENCIES = (0.02, 0.1, 0.3, 1.0)
LOADS = (0.0, 1.0, 2.0)
"""Beyond the paper: of the reference [Hz], and on the disc [kg]."""


def settle(reference: Recording) -> float:
    """Return how much of a loop is not scored [s]: the first third, so that whole cycles are left."""
    return (reference.duration or 0.0) / 3


@dataclass(frozen=True)
class Loops:
    """What came of the loops, by controller and task."""

    found: Mapping[tuple[str, str], Tracked]

    @property
    def controllers(self) -> list[str]:
        """In the order tried."""
        return list(dict.fromkeys(name for name, _ in self.found))

    @property
    def muscles(self) -> list[int]:
        """Muscles that were moved."""
        return [k for k, _ in MOVES if (self.controllers[0], f"muscle {k}") in self.found]

    def _tracking_tables(self) -> Iterator[Table]:
        groups = [(muscle, name) for muscle in self.muscles for name in OUTPUTS]
        for place, what in enumerate(("e_w [%]", "RMSE [mm]")):
            rows: list[tuple[Cell, ...]] = []
            for (group, said), (muscle, name) in zip(
                printed.TRACKING.items(), groups, strict=False
            ):
                cells: list[Cell] = []
                for controller in self.controllers:
                    tracked = self.found[controller, f"muscle {muscle}"]
                    width = loop_width(tracked, OUTPUTS[muscle - 1], name)
                    cells.append(tracked.rmse[name] if place else width)
                rows.append((group, *said[place::2], *cells))
            yield Table(
                f"Tracking 33 + 6 sin(0.04 pi t) mm, {what} (its Table 5)",
                (
                    *("group", "printed SDIHC", "printed individual", "printed PID"),
                    *self.controllers,
                ),
                tuple(rows),
                "Groups: muscle 1 (extensor at 0.7 bar), 2 (1.5 bar), 3 (2.3 bar) moves, by output "
                "1, 2, 3.",
            )

    def _task_table(self) -> Table:
        rows: list[tuple[Cell, ...]] = [("printed SDIHC", None, *printed.TASK)]
        for name in self.controllers:
            tracked = self.found[name, "task"]
            recording = tracked.recording
            kept = recording.time >= settle(recording)
            errors = np.array([(recording[y] - recording[f"reference_{y}"])[kept] for y in OUTPUTS])
            rows.append(
                (name, max(tracked.rmse.values()), float(errors.min()), float(errors.max()))
            )
        return Table(
            "All three follow |40 sin(0.04 pi t) + 5| mm (its Figure 13)",
            ("controller", "worst RMSE [mm]", "lowest error [mm]", "highest error [mm]"),
            tuple(rows),
            "After the first third. At the corners of the reference, at 0 mm, its speed jumps by "
            "10 mm/s.",
        )

    def tables(self) -> Iterator[Table]:
        """Return Table 5, and Figure 13's errors."""
        yield from self._tracking_tables()
        yield self._task_table()

    def summary(self) -> Iterator[str]:
        """Return what came out."""
        worst = {
            name: max(max(self.found[name, f"muscle {k}"].rmse.values()) for k in self.muscles)
            for name in self.controllers
        }
        last = list(printed.TRACKING)[3 * len(self.muscles) - 1]
        yield (
            f"Tracking, worst RMSE over groups a to {last}: "
            + ", ".join(f"{name} {value:.2f} mm" for name, value in worst.items())
            + "."
        )
        step = self.found[OURS_INVERTED, "task"].step_time
        yield (
            f"A step of our SDIHC takes {1e6 * step[0]:.0f} µs (median; 99.9 %: {1e6 * step[1]:.0f} µs)."
        )

    def figures(self) -> Iterator[Figure]:
        """Return Figure 12's first row, and Figure 13."""
        for task, title in (("muscle 1", "its Figure 12"), ("task", "its Figure 13")):
            first = self.found[PAPERS, task].recording
            curves = {
                "reference": (thinned(first.time), thinned(first["reference_displacement_1"]))
            }
            for name in (PAPERS, OURS_INVERTED, BALANCE, "PID", WITH_PID):
                if (name, task) in self.found:
                    recording = self.found[name, task].recording
                    curves[name] = (thinned(recording.time), thinned(recording["displacement_1"]))
            said = f"Tracking, displacement 1 ({title})"
            yield Figure(said, "time [s]", "displacement [mm]", curves)


def run_loops(
    models: Models,
    train: list[Recording],
    quick: bool,
    seed: int,
    jobs: int | None,
    kept: Checkpoints,
) -> tuple[Loops, Table | None]:
    """Return what came of all loops, and of those beyond the paper where they are run."""
    step = QUICK_CONTROL_TIME if quick else CONTROL_TIME
    pid = tune_pid(load_rig("soft-arm"), sample_time=step, scheduled={EXTENSOR: 1.0}, seed=seed)
    inverses = compensators(models, train, quick, seed, kept)
    if quick:
        del inverses[SINGLE]
        return _tracked(inverses | {"PID": pid}, references(1.5, 1, step), jobs, seed), None
    laws = _laws(inverses[BALANCE], pid)
    found = _tracked(inverses | laws, references(3, len(MOVES), step), jobs, seed)
    return found, _beyond(laws, jobs, seed)


def _laws(compensator: Block, pid: PIDFeedback) -> dict[str, Block | Controller]:
    names = {
        BALANCE: "feedforward",
        "PID": "pid",
        WITH_PID: "feedforward-pid",
        "disturbance observer": "observer",
    }
    return {said: control_law(name, compensator, lambda: pid) for said, name in names.items()}


def compensators(
    models: Models, train: list[Recording], quick: bool, seed: int, kept: Checkpoints
) -> dict[str, Block]:
    """Return all inverses, the paper's with its network trained from displacements to couplings."""
    published, individual = models[PUBLISHED], models[INDIVIDUAL]
    assert isinstance(individual, Series)
    rest = [run for run in train if "gpi" not in run.name] or train
    size = QUICK_SWARM if quick else {}
    samples = QUICK_SEARCH["search_samples"] if quick else SEARCH_SAMPLES

    search = Search("pso", samples, printed_swarm(**size), seed)

    def swapped() -> Series:
        return learned_inverse(published, rest, search=search)

    return {
        PAPERS: kept.once("learned inverse", Series, swapped, published, rest, search),
        SINGLE: individual.parts[0].inverse(),
        OURS_INVERTED: models[OURS].inverse(),
        BALANCE: models[BALANCE].inverse(),
    }


def references(cycles: float, muscles: int, step: float) -> dict[str, Recording]:
    """Return Table 5's references of the first muscles, and Figure 13's."""
    time = np.arange(round(cycles * PERIOD / step)) * step
    wave = np.sin(2 * np.pi * time / PERIOD)
    found = {}
    for muscle, p0 in MOVES[:muscles]:
        channels = {name: np.full(time.size, 33.0) for name in OUTPUTS}
        channels[OUTPUTS[muscle - 1]] = 33.0 + 6.0 * wave
        found[f"muscle {muscle}"] = Recording(channels | {EXTENSOR: np.full(time.size, p0)}, step)
    task = np.abs(40.0 * wave + 5.0)
    found["task"] = Recording(
        dict.fromkeys(OUTPUTS, task) | {EXTENSOR: np.full(time.size, 0.6)}, step
    )
    return found


def _try(law: Block | Controller, reference: Recording, seed: int, load: float) -> Tracked:
    rig = load_rig("soft-arm")
    if load:
        rig = rig.changed({"disc_mass": rig.model_dump()["disc_mass"] + load})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        return track(law, rig, reference, settle=settle(reference), seed=seed)


def _tried(
    common: None, trial: tuple[Block | Controller, Recording, int, float], _: Tell
) -> Tracked:
    return _try(*trial)


def _tracked(
    laws: Mapping[str, Block | Controller],
    tasks: Mapping[str, Recording],
    jobs: int | None,
    seed: int,
) -> Loops:
    keys = [(name, task) for name in laws for task in tasks]
    trials = [(laws[name], tasks[task], seed, 0.0) for name, task in keys]
    results = all_of(_tried, trials, jobs)
    return Loops(dict(zip(keys, results, strict=True)))


def _beyond(laws: Mapping[str, Block | Controller], jobs: int | None, seed: int) -> Table:
    """Return what higher frequencies and unmodelled loads do to every controller."""
    trials = [(frequency, 0.0) for frequency in FREQUENCIES] + [(0.02, load) for load in LOADS[1:]]
    keys = [(name, trial) for name in laws for trial in trials]

    def reference(frequency: float) -> Recording:
        time = np.arange(round(max(40.0, 2 / frequency) / CONTROL_TIME)) * CONTROL_TIME
        channels = {name: np.full(time.size, 33.0) for name in OUTPUTS}
        channels[OUTPUTS[0]] = 33.0 + 6.0 * np.sin(2 * np.pi * frequency * time)
        return Recording(channels | {EXTENSOR: np.full(time.size, 0.7)}, CONTROL_TIME)

    results = all_of(
        _tried,
        [(laws[name], reference(frequency), seed, load) for name, (frequency, load) in keys],
        jobs,
    )
    errors = {key: max(found.rmse.values()) for key, found in zip(keys, results, strict=True)}
    rows = tuple((name, *(errors[name, trial] for trial in trials)) for name in laws)
    headings = [f"{f:g} Hz" if not load else f"0.02 Hz, {load:g} kg" for f, load in trials]
    return Table(
        "Beyond the paper: worst muscle's RMSE at higher frequencies and under loads [mm]",
        ("controller", *headings),
        rows,
        "33 + 6 sin(2 pi f t) mm on muscle 1, the others hold 33 mm; no model was told of the load.",
    )


def loop_width(tracked: Tracked, moving: str, name: str) -> float:
    """Return e_w [%]: rising less falling at the middle of the moving reference, over its range."""
    recording = tracked.recording
    reference, y = recording[f"reference_{moving}"], recording[name]
    kept = recording.time >= settle(recording)
    reference, y = reference[kept], y[kept]
    middle, span = 0.5 * (reference.max() + reference.min()), float(np.ptp(reference))
    near = np.abs(reference - middle) < 0.05 * span
    rate = np.gradient(reference)
    up, down = y[near & (rate > 0)], y[near & (rate < 0)]
    if not up.size or not down.size:
        return float("nan")
    return float(100 * abs(up.mean() - down.mean()) / span)
