"""Targets of a muscle under 20 kg, of one that lifts weights, and of measured recordings."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from balance_rows import BALANCE, Fits, Row, free_run, missed, rms
from mckibben import Recording, compare
from mckibben.measured.sets import parted, sets_in
from mckibben.papers.activation_pressure.protocol import FORCES
from mckibben.papers.activation_pressure.rerun import REST_LENGTH, modelled
from mckibben.rigs import record

TARGETS = {"festo_dmsp10_levels": 0.8, "festo_dmsp10_static": np.nan, "cavatappi_loads": 5.0}
"""In per cent of the range of what is tested on."""

SMOOTHED = 5
"""Samples of 5 ms over which displacement is averaged."""


def smoothed(recording: Recording) -> Recording:
    """Return a recording whose displacement is a running mean, its ends held."""
    half = SMOOTHED // 2
    padded = np.pad(recording["displacement"], half, mode="edge")
    mean = np.convolve(padded, np.full(SMOOTHED, 1 / SMOOTHED), mode="valid")
    return recording.with_channels(displacement=mean)


def hanging(seeds: int) -> Iterator[Row]:
    """Yield the target of paper B's protocol."""
    figures: dict[str, list[float]] = {}
    for seed in range(seeds):
        fits = Fits()
        runs = {run.role: made for run, made in record("field-models", seed=seed, jobs=1)}
        for name in ("cpi", "gpi", BALANCE):
            model = fits(seed, name, [runs["train"]])
            figures.setdefault(name, []).append(missed(model, runs["test"], "displacement"))
    yield Row("mas-20", "irregular triangle, 20 kg", "mm", 0.15, figures)


def lifting(seeds: int) -> Iterator[Row]:
    """Yield the targets of paper E's protocol: pressure from displacement and force."""
    del seeds
    fits = Fits()
    train: list[Recording] = []
    tests: dict[tuple[float, float], Recording] = {}
    for run, made in record("activation-pressure", jobs=1):
        contraction = made["displacement"] / REST_LENGTH
        whole = made.with_channels({"contraction": ""}, contraction=contraction)
        if run.role == "train":
            train.append(whole)
        else:
            tests[float(run.labels["force"]), float(run.labels["frequency"])] = whole
    theirs: Any = fits("E", "activation-pressure", train, method="pso")
    memory: Any = fits("E", "activation-memory", train)
    balance = fits("E", BALANCE, train).inverse()
    percent: dict[str, dict[float, list[float]]] = {}
    for (force, frequency), test in tests.items():
        pressed = test["pressure"]
        found = {
            "the paper's": modelled(theirs, test, frequency),
            "activation-memory": modelled(memory, test, frequency),
            "balance, smoothed": free_run(balance, smoothed(test), "pressure")[:, 0],
            BALANCE: free_run(balance, test, "pressure")[:, 0],
        }
        for name, pressure in found.items():
            error = 100 * rms(pressure - pressed) / float(np.ptp(pressed))
            percent.setdefault(name, {}).setdefault(force, []).append(error)
    note = (
        f"smoothed: displacement averaged over {SMOOTHED} samples, for damping makes pressure of noise, "
        "of which a reference has none"
    )
    for force in FORCES:
        figures = {name: by[force] for name, by in percent.items()}
        target = 4.0 if force else 4.5
        what = f"pressure on random waves at {force:g} N, every frequency"
        yield Row("E", what, "% of range", target, figures, note)


def measured(folder: Path | None) -> Iterator[Row]:
    """Yield the targets of measured muscles, by the splits of docs/measured; nothing without them."""
    if folder is None:
        return
    warnings.simplefilter("ignore")
    for one in sets_in(folder):
        for _, task in one.tasks() if one.name in TARGETS else ():
            train, test = parted(task, one.recordings(), one.folder)
            span = max(float(np.ptp(run["displacement"])) for run in test)
            models = (
                ("coupled-memory", BALANCE) if task.load else ("cpi", "gpi", "preisach", BALANCE)
            )
            board = compare(train, test, models=models, load=task.load, n_folds=0)
            figures = {
                r.model: [100 * r.test_error / span] for r in board.rows if r.test is not None
            }
            what = f"{one.title} {task.name}".strip()
            yield Row("measured", what, "% of range", TARGETS[one.name], figures)
