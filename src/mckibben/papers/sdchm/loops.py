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
"""Frequency of the paper's references [Hz]."""

MEAN, SWING = 33.0, 6.0
"""Of the references of Table 5 [mm]."""

AMPLITUDE, OFFSET, TASK_LEVEL = 40.0, 5.0, 0.6
"""Of the reference of Figure 13 [mm], and its pressure of the extensor [bar]."""

REACHED = 0.8
"""Share of the way recorded of every muscle that references ask for at most, else they are smaller."""

ENDS = "lowest error [mm]", "highest error [mm]"
"""Columns of tables."""

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


def single_task(
    outputs: Sequence[str], moving: str, time: Array, p0: float, scale: float = 1.0, f: float = F
) -> Task:
    """Return a task that moves one output, as in Table 5 or at another frequency."""
    channels = dict.fromkeys(outputs, np.full(time.size, scale * MEAN))
    channels[moving] = scale * (MEAN + SWING * np.sin(2 * np.pi * f * time))
    reference = Recording(channels | {EXTENSOR: np.full(time.size, p0)}, float(time[1]))
    return Task(reference, [moving], {"mean": scale * MEAN, "swing": scale * SWING, "p0": p0})


def run_loops(experiment: Experiment, rig: Rig, runs: Runs) -> None:
    """Track the paper's references with every controller, and further tasks with ours and PID.

    Results are the tables and the figure of Table 5, the table ``beyond`` the paper, and texts.
    """
    pid_level, *levels = _levels(rig, runs)
    tasks = _tasks(experiment, rig, runs, levels)
    laws = _laws(experiment, rig, compensators(experiment, runs), pid_level)
    table_5 = [key for key in tasks if key.startswith("tracking_")]
    beyond = [key for key in tasks if key not in experiment.paper.tables]
    ours = [name for name in laws if name not in (SDIHC, SINGLE, SDIHC_OURS)]

    pairs = [(key, name) for key in tasks for name in (ours if key in beyond else laws)]
    trials = [(laws[name], rig, tasks[key], experiment.seed) for key, name in pairs]
    results = dict(zip(pairs, all_of(_tracked, trials, experiment.jobs), strict=True))

    panels: dict[str, Curves] = {}
    for key in (key for key in tasks if key not in beyond):
        of_task = {name: results[key, name] for name in laws}
        shown = _add_task(experiment, key, tasks[key], of_task)
        panels |= shown if key in table_5 else {}
    experiment.figure("tracking", panels)

    worst = {pair: max(result.rmse.values()) for pair, result in results.items()}  # [mm]
    if beyond:
        rows = [[name, *(worst[key, name] for key in beyond)] for name in ours]
        experiment.table("beyond", beyond, rows, **tasks["tracking_1"].facts)
    worst_of_law = {name: max(worst[key, name] for key in table_5) for name in laws}
    tracking = ", ".join(f"{name} {rmse:.2f} mm" for name, rmse in worst_of_law.items())
    experiment.add_facts(tracking=tracking)
    _table_5(experiment, [{n: [*results[key, n].rmse.values()] for n in laws} for key in table_5])
    step_time = results["task", SDIHC_OURS].step_time[0]  # [s]
    experiment.add_facts(moved=", ".join(key[-1] for key in table_5), step=1e6 * step_time)


def _levels(rig: Rig, runs: Runs) -> list[float]:
    """Return pressures of the extensor for PID, Table 5 and Figure 13, within those recorded [bar]."""
    recorded = [float(run[EXTENSOR].mean()) for run in runs.values()]
    levels = np.array([1.0, *(p0 for _, p0 in MOVES), TASK_LEVEL]) * share(rig, EXTENSOR, HIGHEST)
    clipped: list[float] = np.clip(levels, min(recorded), max(recorded)).tolist()
    return clipped


def _tasks(
    experiment: Experiment, rig: Rig, runs: Runs, levels: Sequence[float]
) -> dict[str, Task]:
    """Return the tasks of Table 5 and Figure 13 by their tables, and those beyond the paper."""
    outputs, step = by_name([*runs.values()])[1], control_step(experiment)
    *moving_levels, task_level = levels
    reached = min(max(float(run[y].max()) for run in runs.values()) for y in outputs)
    scale = min(1.0, REACHED * reached / (AMPLITUDE + OFFSET))

    def times(duration: float) -> Array:
        return np.arange(round(duration / step), dtype=np.float64) * step

    t = times((1.5 if experiment.quick else 3) * PERIOD)
    moving = zip(outputs[: 1 if experiment.quick else len(MOVES)], moving_levels, strict=False)
    tasks = {f"tracking_{y[-1]}": single_task(outputs, y, t, p0, scale) for y, p0 in moving}

    wave = scale * np.abs(AMPLITUDE * np.sin(2 * np.pi * F * t) + OFFSET)
    channels = dict.fromkeys(outputs, wave) | {EXTENSOR: np.full(wave.size, task_level)}
    facts = {"amplitude": scale * AMPLITUDE, "offset": scale * OFFSET, "p0": task_level}
    tasks["task"] = Task(Recording(channels, step), outputs, facts)

    for frequency, mass in () if experiment.quick else BEYOND:
        load, longer = strength(rig) * mass, times(max(40.0, 2 / frequency))
        key = f"{frequency:g} Hz" + (f", {load:.2g} kg" if load else "")
        task = single_task(outputs, outputs[0], longer, moving_levels[0], scale, frequency)
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
    """Report how the paper's compensator compares with its rivals, by RMSE of every output [mm]."""
    tables = [t for key, t in experiment.paper.tables.items() if key.startswith("tracking_")]
    rmse = {name: [e for task in tracked for e in task[name]] for name in (SDIHC, SINGLE, PID)}
    printed = {
        name: max(cells[name] for t in tables for x, cells in t.printed.items() if "RMSE" in x)
        for name in rmse
    }
    closer = {name: int(np.sum(np.less(rmse[SDIHC], rmse[name]))) for name in (SINGLE, PID)}
    n = len(rmse[SDIHC])
    experiment.add_facts(
        table_5=", ".join(f"{name} {max(errors):.2f} mm" for name, errors in rmse.items()),
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

    def train_inverse() -> Series:
        return learned_inverse(models[PUBLISHED], patterns, search=search)

    individual: Any = models[INDIVIDUAL]
    return {
        SDIHC: experiment.checkpoints.once(
            "learned inverse", Series, train_inverse, models[PUBLISHED], patterns, search
        ),
        SINGLE: individual.parts[0].inverse(),
        SDIHC_OURS: models[OURS].inverse(),
        BALANCE: models[BALANCE].inverse(),
    }


def _tracked(common: None, trial: tuple[Block | Controller, Rig, Task, int], _: Tell) -> Tracked:
    """Return the closed loop of a trial, in a worker process: law, rig, task and seed."""
    law, rig, task, seed = trial
    if task.load:
        rig = rig.changed({"payload": float(rig.known().get("payload_kg", 0.0)) + task.load})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        return track(law, rig, task.reference, settle=task.settle, seed=seed)


def widths(recording: Recording, moving: str, outputs: Sequence[str]) -> dict[str, float]:
    """Return e_w of the moving output over the last period, and cross-motion of others [%]."""
    n, percentages = round(PERIOD / recording.step), dict[str, float]()
    u = recording[REFERENCE + moving][-n:]
    for name in outputs:  # each turned to begin at its minimum
        x, y = (np.roll(wave, -int(np.argmin(u))) for wave in (u, recording[name][-n:]))
        if name == moving:
            percentages[f"e_w of y{name[-1]} [%]"] = loop_width(x, y) if np.ptp(y) else 0.0
        else:
            percentages[f"cross-motion of y{name[-1]} [%]"] = crosstalk(x, y, x)
    return percentages


def _add_task(
    experiment: Experiment, key: str, task: Task, results: Mapping[str, Tracked]
) -> dict[str, Curves]:
    """Add the table of a task, and of several moving outputs its figure; return the panels.

    A panel is of one output, over the moving one in the last period, or over time.
    """
    rows = {name: _cells(task, tracked) for name, tracked in results.items()}
    lines: dict[str, list[Cell]] = {name: [*cells.values()] for name, cells in rows.items()}
    experiment.table(key, [*next(iter(rows.values()))], lines, **task.facts)

    is_single, moving = len(task.moving) == 1, task.moving[0]
    panels: dict[str, dict[str, tuple[Array, Array]]] = {}
    for name, tracked in [*results.items()][:DRAWN]:
        scored = _scored(task, tracked)
        if is_single:
            scored = scored.slice(len(scored) - round(PERIOD / scored.step), len(scored))
        x = scored[REFERENCE + moving] if is_single else scored.time
        for y in tracked.rmse:
            title = f"y{moving[-1]} moves: y{y[-1]}" if is_single else f"y{y[-1]}"
            panels.setdefault(title, {"reference": (x, scored[REFERENCE + y])})
            panels[title][name] = x, scored[y]

    if not is_single:
        experiment.figure(key, panels)
        printed = [experiment.paper.tables[key].printed[end][SDIHC] for end in ENDS]
        steady = [rows[SDIHC][end] for end in ENDS]
        within = Verdict(printed[0] <= steady[0] and steady[1] <= printed[1])
        experiment.add_facts(steady=steady, steady_printed=printed, steady_within=within)
    return dict(panels)


def _scored(task: Task, tracked: Tracked) -> Recording:
    """Return the part of a run that is scored."""
    run = tracked.recording
    return run.slice(int(np.searchsorted(run.time, task.settle)), len(run))


def _cells(task: Task, tracked: Tracked) -> dict[str, float]:
    """Return the cells of a controller: RMSE, of one moving output widths, and extreme errors."""
    scored = _scored(task, tracked)
    cells = {f"RMSE of y{y[-1]} [mm]": rmse for y, rmse in tracked.rmse.items()}
    if len(task.moving) == 1:
        cells |= widths(scored, task.moving[0], [*tracked.rmse])
    errors = np.array([scored[y] - scored[REFERENCE + y] for y in tracked.rmse])
    return cells | dict(zip(ENDS, (float(errors.min()), float(errors.max())), strict=True))
