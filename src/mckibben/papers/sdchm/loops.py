"""Closed loops on the arm: inverses of the predictive models, and PID."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.compose import Series
from mckibben.channels import by_name
from mckibben.control import Controller, Tracked, control_law, track, tune_pid
from mckibben.errors import ModelWarning
from mckibben.estimators.coupled.fuzzy import Search, printed_swarm
from mckibben.estimators.coupled.sdchm import learned_inverse
from mckibben.metrics import crosstalk, loop_width
from mckibben.papers.experiment import Cell, Curves, Experiment, Verdict
from mckibben.papers.recognising import EXTENSOR, Runs
from mckibben.papers.sdchm.protocol import HIGHEST, PERIOD, strength
from mckibben.recording import REFERENCE, Recording
from mckibben.rigs import Rig, share
from mckibben.system.workers import Tell, all_of

PUBLISHED, INDIVIDUAL = "SDCHM, as published", "individual hysteresis"
OURS, BALANCE = "SDCHM, ours", "balance"
SDIHC, SINGLE, SDIHC_OURS = "SDIHC, as published", "individual inverse", "SDIHC, ours"
PID = "PID"

QUICK_SWARM, QUICK_SAMPLES, SAMPLES = {"particles": 8, "iterations": 6}, 1000, 6000
"""Of the quick run's searches; samples on which the paper's inverse network is searched else."""

MOVES = ((1, 0.7), (2, 1.5), (3, 2.3))
"""Muscle that moves, and pressure of the extensor [bar], for every three groups of Table 5."""

F = 1 / PERIOD
MEAN, SWING, AMPLITUDE, OFFSET, TASK_LEVEL = 33.0, 6.0, 40.0, 5.0, 0.6
"""Of the references of Table 5 and Figure 13: [Hz], [mm], the latter's extensor [bar]."""

REACHED = 0.8
"""Share of the way recorded of every muscle that references ask for at most, else they are smaller."""

DRAWN = 6
"""Controllers that figures show, the first of the tables: as many as there are colours."""

BEYOND = ((0.02, 0.0), (0.1, 0.0), (0.3, 0.0), (1.0, 0.0), (0.02, 1.0), (0.02, 2.0))
"""Beyond the paper: frequency of the reference [Hz], and load on the disc of the paper's arm [kg]."""


class Task(NamedTuple):
    """A reference, the moving outputs, the facts of its table, and a load [kg]."""

    reference: Recording
    moving: Sequence[str]
    facts: Mapping[str, float]
    load: float = 0.0

    @property
    def settle(self) -> float:
        """Time that is not scored [s]: the first third, so that whole cycles remain."""
        return (self.reference.duration or 0.0) / 3


def held(
    outputs: Sequence[str], moving: str, time: Array, p0: float, scale: float = 1.0, f: float = F
) -> Task:
    """Return a task that moves one output, as in Table 5 or at another frequency."""
    channels = dict.fromkeys(outputs, np.full(time.size, scale * MEAN))
    channels[moving] = scale * (MEAN + SWING * np.sin(2 * np.pi * f * time))
    reference = Recording(channels | {EXTENSOR: np.full(time.size, p0)}, float(time[1]))
    return Task(reference, [moving], {"mean": scale * MEAN, "swing": scale * SWING, "p0": p0})


def run_loops(experiment: Experiment, rig: Rig, runs: Runs) -> None:
    """Track the paper's references with every controller, and further tasks with some."""
    middle, *levels = _levels(rig, runs)
    tasks = _tasks(experiment, rig, runs, levels)
    inverses = compensators(experiment, runs)
    laws = _laws(experiment, rig, inverses, middle)
    table_5 = [key for key in tasks if key.startswith("tracking_")]
    beyond = [key for key in tasks if key not in experiment.paper.tables]
    ours = [name for name in laws if name not in (SDIHC, SINGLE, SDIHC_OURS)]
    keys = [(key, name) for key in tasks for name in (ours if key in beyond else laws)]
    trials = [(laws[name], rig, tasks[key], experiment.seed) for key, name in keys]
    found = dict(zip(keys, all_of(_tracked, trials, experiment.jobs), strict=True))
    plane: dict[str, Curves] = {}
    for key in tasks:
        if key not in beyond:
            panels = _shown(experiment, key, tasks[key], {name: found[key, name] for name in laws})
            plane |= panels if key in table_5 else {}
    experiment.figure("tracking", plane)
    worst = {key: max(one.rmse.values()) for key, one in found.items()}
    if beyond:
        rows = [[name, *(worst[key, name] for key in beyond)] for name in ours]
        experiment.table("beyond", beyond, rows, **tasks["tracking_1"].facts)
    most = {name: max(worst[key, name] for key in table_5) for name in laws}
    experiment.says(tracking=", ".join(f"{name} {value:.2f} mm" for name, value in most.items()))
    _table_5(experiment, [{n: [*found[key, n].rmse.values()] for n in laws} for key in table_5])
    moved, step = ", ".join(key[-1] for key in table_5), found["task", SDIHC_OURS].step_time[0]
    experiment.says(moved=moved, step=1e6 * step)


def _levels(rig: Rig, runs: Runs) -> list[float]:
    """Return pressures of the extensor for PID, Table 5 and Figure 13, within those recorded [bar]."""
    recorded = [float(one[EXTENSOR].mean()) for one in runs.values()]
    wanted = np.array([1.0, *(p0 for _, p0 in MOVES), TASK_LEVEL]) * share(rig, EXTENSOR, HIGHEST)
    clipped: list[float] = np.clip(wanted, min(recorded), max(recorded)).tolist()
    return clipped


def _tasks(
    experiment: Experiment, rig: Rig, runs: Runs, levels: Sequence[float]
) -> dict[str, Task]:
    """Return the tasks of Table 5 and Figure 13 by their tables, and those beyond the paper."""
    outputs, step, (*at, p0) = by_name([*runs.values()])[1], control_step(experiment), levels
    reached = min(max(float(one[y].max()) for one in runs.values()) for y in outputs)
    scale = min(1.0, REACHED * reached / (AMPLITUDE + OFFSET))

    def time(duration: float) -> Array:
        return np.arange(round(duration / step), dtype=np.float64) * step

    whole = time((1.5 if experiment.quick else 3) * PERIOD)
    moved = zip(outputs[: 1 if experiment.quick else len(MOVES)], at, strict=False)
    tasks = {f"tracking_{y[-1]}": held(outputs, y, whole, p, scale) for y, p in moved}
    wave = scale * np.abs(AMPLITUDE * np.sin(2 * np.pi * F * whole) + OFFSET)
    channels = dict.fromkeys(outputs, wave) | {EXTENSOR: np.full(wave.size, p0)}
    facts = {"amplitude": scale * AMPLITUDE, "offset": scale * OFFSET, "p0": p0}
    tasks["task"] = Task(Recording(channels, step), outputs, facts)
    for frequency, mass in () if experiment.quick else BEYOND:
        load, longer = strength(rig) * mass, time(max(40.0, 2 / frequency))
        key = f"{frequency:g} Hz" + (f", {load:.2g} kg" if load else "")
        task = held(outputs, outputs[0], longer, at[0], scale, frequency)
        tasks[key] = task._replace(load=load)
    return tasks


def control_step(experiment: Experiment) -> float:
    """Return the time between two samples of a controller [s]."""
    return 0.1 if experiment.quick else 0.05


def _laws(
    experiment: Experiment, rig: Rig, inverses: Mapping[str, Block], middle: float
) -> dict[str, Block | Controller]:
    """Return the compensators, PID, and ours with feedback unless the run is quick."""
    step, scheduled = control_step(experiment), {EXTENSOR: middle}
    pid = tune_pid(rig, sample_time=step, scheduled=scheduled, seed=experiment.seed)
    laws: dict[str, Block | Controller] = {**inverses, PID: pid}
    if not experiment.quick:
        laws["balance + PID"] = control_law("feedforward-pid", inverses[BALANCE], lambda: pid)
        laws["disturbance observer"] = control_law("observer", inverses[BALANCE], lambda: pid)
    return laws


def _table_5(experiment: Experiment, tracked: Sequence[Mapping[str, Sequence[float]]]) -> None:
    """Set how the paper's compensator compares with its rivals, by RMSE of every output."""
    tables = [t for key, t in experiment.paper.tables.items() if key.startswith("tracking_")]
    off = {name: [rmse for one in tracked for rmse in one[name]] for name in (SDIHC, SINGLE, PID)}
    printed = {
        name: max(cells[name] for t in tables for x, cells in t.printed.items() if "RMSE" in x)
        for name in off
    }
    closer = {name: int(np.sum(np.less(off[SDIHC], off[name]))) for name in (SINGLE, PID)}
    n = len(off[SDIHC])
    experiment.says(
        table_5=", ".join(f"{name} {max(own):.2f} mm" for name, own in off.items()),
        table_5_printed=", ".join(f"{value:.2f} mm" for value in printed.values()),
        table_5_closer=closer,
        table_5_outputs=n,
        table_5_first=Verdict(set(closer.values()) == {n}),
    )


def compensators(experiment: Experiment, runs: Runs) -> dict[str, Block]:
    """Return all inverses of predictive models; the paper's is trained (Section 4)."""
    models = experiment.models
    swarm = printed_swarm(**(QUICK_SWARM if experiment.quick else {}))
    samples = QUICK_SAMPLES if experiment.quick else SAMPLES
    search = Search("pso", samples, swarm, experiment.seed)
    patterns = runs.select("train", stage="network") or runs.select("train", stage="hysteresis")

    def learned() -> Series:
        return learned_inverse(models[PUBLISHED], patterns, search=search)

    individual: Any = models[INDIVIDUAL]
    return {
        SDIHC: experiment.kept.once(
            "learned inverse", Series, learned, models[PUBLISHED], patterns, search
        ),
        SINGLE: individual.parts[0].inverse(),
        SDIHC_OURS: models[OURS].inverse(),
        BALANCE: models[BALANCE].inverse(),
    }


def _tracked(common: None, trial: tuple[Block | Controller, Rig, Task, int], _: Tell) -> Tracked:
    law, rig, task, seed = trial
    if task.load:
        rig = rig.changed({"payload": float(rig.known().get("payload_kg", 0.0)) + task.load})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        return track(law, rig, task.reference, settle=task.settle, seed=seed)


def widths(recording: Recording, moving: str, outputs: Sequence[str]) -> dict[str, float]:
    """Return e_w of the moving output over the last period, and cross-motion of others [%]."""
    n = round(PERIOD / recording.step)
    u, found = recording[REFERENCE + moving][-n:], {}
    for name in outputs:  # each turned to begin at its minimum
        x, y = (np.roll(wave, -int(np.argmin(u))) for wave in (u, recording[name][-n:]))
        if name == moving:
            found[f"e_w of y{name[-1]} [%]"] = loop_width(x, y) if np.ptp(y) else 0.0
        else:
            found[f"cross-motion of y{name[-1]} [%]"] = crosstalk(x, y, x)
    return found


def _shown(
    experiment: Experiment, key: str, task: Task, found: Mapping[str, Tracked]
) -> dict[str, Curves]:
    """Add the results of a reference; return panels of every output over the moving one, or time."""
    alone, one = len(task.moving) == 1, task.moving[0]
    panels: dict[str, dict[str, tuple[Array, Array]]] = {}
    rows: dict[str, dict[str, float]] = {}
    for name, tracked in found.items():
        late = tracked.recording
        late = late.slice(int(np.searchsorted(late.time, task.settle)), len(late))
        rows[name] = {f"RMSE of y{y[-1]} [mm]": error for y, error in tracked.rmse.items()}
        rows[name] |= widths(late, one, [*tracked.rmse]) if alone else {}
        errors = np.array([late[y] - late[REFERENCE + y] for y in tracked.rmse])
        ends = {"lowest error [mm]": errors.min(), "highest error [mm]": errors.max()}
        rows[name] |= {end: float(error) for end, error in ends.items()}
        shown = late.slice(len(late) - round(PERIOD / late.step), len(late)) if alone else late
        for y in tracked.rmse if name in [*found][:DRAWN] else ():
            x = shown[REFERENCE + one] if alone else shown.time
            title = f"y{one[-1]} moves: y{y[-1]}" if alone else f"y{y[-1]}"
            panels.setdefault(title, {"reference": (x, shown[REFERENCE + y])})
            panels[title][name] = x, shown[y]
    lines: dict[str, list[Cell]] = {name: [*cells.values()] for name, cells in rows.items()}
    experiment.table(key, [*rows[name]], lines, **task.facts)
    if not alone:
        experiment.figure(key, panels)
        printed = [experiment.paper.tables[key].printed[end][SDIHC] for end in ends]
        steady = [rows[SDIHC][end] for end in ends]
        within = Verdict(printed[0] <= steady[0] and steady[1] <= printed[1])
        experiment.says(steady=steady, steady_printed=printed, steady_within=within)
    return dict(panels)
