"""Targets of a muscle under 20 kg, of one that lifts weights, and of measured recordings."""

from __future__ import annotations

import runpy
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from balance_rows import BALANCE, Fits, Row, free_run, missed, rms
from mckibben import Recording, compare
from mckibben.papers.activation_pressure.protocol import FORCES
from mckibben.papers.activation_pressure.rerun import REST_LENGTH, modelled
from mckibben.rigs import record

PAGES = Path(__file__).resolve().parent.parent / "docs" / "models"
"""Where recordings are read and split for the documentation."""

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


def coiled(folder: Path | None) -> Iterator[Row]:
    """Yield the targets of coiled muscles under two loads; nothing where they are absent."""
    if folder is None or not (folder / "cavatappi_loads").is_dir():
        return
    page = runpy.run_path(str(PAGES / "loads.py"))
    settings: dict[str, dict[str, Any]] = page["MODELS"] | {BALANCE: {}}
    warnings.simplefilter("ignore")
    for sample in page["SAMPLES"]:
        whole = [page["recording"](folder, sample, grams) for grams in page["LOADS"]]
        cuts = [round(page["FITTED"] * len(run)) for run in whole]
        train = [run.slice(0, cut) for run, cut in zip(whole, cuts, strict=True)]
        test = [run.slice(cut, len(run)) for run, cut in zip(whole, cuts, strict=True)]
        span = max(float(np.ptp(run["displacement"])) for run in test)
        figures = {}
        for name, how in settings.items():
            row = page["tried"](train, test, name, how)
            if not row.reason:
                figures[name] = [100 * row.test_error / span]
        each = [page["tried"]([a], [b], "p2uz", {}) for a, b in zip(train, test, strict=True)]
        errors = np.array([row.test_error for row in each])
        weights = np.array([len(run) for run in test])
        together = np.sqrt(np.sum(weights * errors**2) / weights.sum())
        figures["p2uz, one each"] = [float(100 * together / span)]
        yield Row(
            "coiled", f"sample {sample}, 200 and 400 g, one model", "% of range", 5.0, figures
        )


def measured(folder: Path | None) -> Iterator[Row]:
    """Yield the targets of a measured Festo muscle; nothing where it is absent."""
    if folder is None or not (folder / "festo_dmsp10_levels").is_dir():
        return
    page = runpy.run_path(str(PAGES / "measured.py"))
    warnings.simplefilter("ignore")
    for name, target in (("levels", 0.19), ("static", np.nan)):
        train, test = page[name](folder)
        board = compare(train, test, models=["cpi", "gpi", "preisach", BALANCE], n_folds=0)
        figures = {row.model: [row.test.rmse] for row in board.rows if row.test is not None}
        yield Row("measured", f"DMSP-10 {name}", "mm", target, figures)
