"""Paper E again: the pressure that gives a contraction, at 28 conditions and on random waves.

Source: "Inverse Modeling of Nonlinear Artificial Muscle Using Polynomial Parameterization and
Particle Swarm Optimization".
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mckibben.blocks.force.activation_memory import ActivationMemory
from mckibben.blocks.force.activation_pressure import ActivationPressure
from mckibben.blocks.published.activation_pressure import activation_pressure as printed_profile
from mckibben.comparison.kept import Kept
from mckibben.estimators.force.activation_memory import ActivationMemoryEstimator
from mckibben.estimators.force.activation_pressure import ActivationPressureEstimator
from mckibben.papers.keeping import fitted, recorded
from mckibben.papers.reproduction import Cell, Figure, Progress, Reproduction, Table, rms, thinned
from mckibben.recording import Recording
from mckibben.signals.protocols import protocol
from mckibben.signals.protocols.activation_pressure import FORCES, FREQUENCIES

REST_LENGTH = 530.0
"""Of the muscle [mm]."""

THEIRS, OURS = "the paper's", "ours"

QUICK_FORCES = (0.0, 150.0, 300.0)

Condition = tuple[float, float]
Model = ActivationPressure | ActivationMemory


def activation_pressure(
    *, quick: bool, seed: int, jobs: int | None, tell: Progress, kept: Kept
) -> Reproduction:
    """Run sines and random waves at every force, and identify both models on the sines."""
    del jobs
    forces = QUICK_FORCES if quick else FORCES
    plan = protocol("activation-pressure")
    names = [
        run.name
        for run in plan.runs
        if run.labels["stage"] != "static" and run.labels["force"] in forces
    ]
    sines: dict[Condition, Recording] = {}
    waves: dict[Condition, Recording] = {}
    for run, recording in recorded(
        kept, plan.name, names, seed, lambda share, text: tell(0.8 * share, text)
    ):
        contraction = recording["displacement"] / REST_LENGTH
        whole = recording.with_channels({"contraction": ""}, contraction=contraction)
        condition = (float(run.labels["force"]), float(run.labels["frequency"]))
        (sines if run.labels["stage"] == "hysteresis" else waves)[condition] = whole
    train = list(sines.values())
    tell(0.82, "the paper's model, by particle swarm")
    swarm = ActivationPressureEstimator(method="pso", seed=seed)
    theirs = fitted(kept, THEIRS, swarm, train).block
    tell(0.9, "ours")
    ours = fitted(kept, OURS, ActivationMemoryEstimator(seed=seed), train).block
    assert isinstance(theirs, ActivationPressure)
    assert isinstance(ours, ActivationMemory)
    tables = []
    worst: dict[tuple[str, str], float] = {}
    for title, recordings in (("sines", sines), ("random waves", waves)):
        errors = {
            name: {c: percent(model, r, c[1]) for c, r in recordings.items()}
            for name, model in ((THEIRS, theirs), (OURS, ours))
        }
        for name, by_condition in errors.items():
            worst[name, title] = max(by_condition.values())
        tables.append(_table(title, errors, forces))
    correlations = [correlation(theirs, r, c[1]) for c, r in sines.items()]
    light = [percent(ours, r, c[1]) for c, r in waves.items() if c[0] == 0]
    loaded = [percent(ours, r, c[1]) for c, r in waves.items() if c[0] > 0]
    return Reproduction(
        name="activation-pressure",
        title="Inverse Modeling of Nonlinear Artificial Muscle Using Polynomial Parameterization and "
        "Particle Swarm Optimization",
        summary=(
            f"The paper's model: at most {worst[THEIRS, 'sines']:.1f} % of range "
            f"on {len(sines)} sines (printed: below 10 %), correlation {min(correlations):.3f} to "
            f"{max(correlations):.3f} (printed: .875 to .988).",
            f"Ours, without knowing the frequency: at most {worst[OURS, 'sines']:.1f} % on the sines; "
            f"on random waves at most {max(loaded):.1f} % under a load, {max(light):.1f} % without.",
        ),
        tables=(*tables, _profile(theirs, forces)),
        figures=_figures(sines, waves, theirs, ours),
        notes=(
            "Pressures of the sines are the printed y_1 and y_2; loads are forces that do not swing.",
            "Both models are fitted to the sines only; random waves are only tested on.",
            "The published data profile belongs to another muscle: it is in the table for size.",
        ),
    )


def modelled(model: Model, recording: Recording, frequency: float) -> np.ndarray:
    """Return the pressure of a model; the paper's is told the frequency."""
    told = replace(model, frequency=frequency) if isinstance(model, ActivationPressure) else model
    pressure: np.ndarray = told.simulate(recording)["pressure"]
    return pressure


def percent(model: Model, recording: Recording, frequency: float) -> float:
    """Return the RMSE as a percentage of the pressure's range."""
    errors = modelled(model, recording, frequency) - recording["pressure"]
    return 100 * rms(errors) / float(np.ptp(recording["pressure"]))


def correlation(model: Model, recording: Recording, frequency: float) -> float:
    """Return the correlation of modelled and measured pressure."""
    pressure = modelled(model, recording, frequency)
    return float(np.corrcoef(pressure, recording["pressure"])[0, 1])


def _table(
    title: str, errors: dict[str, dict[Condition, float]], forces: tuple[float, ...]
) -> Table:
    columns = [f"{name}, {f:g} Hz" for f in FREQUENCIES for name in errors]
    rows: list[tuple[Cell, ...]] = []
    for force in forces:
        cells = [by[(force, f)] for f in FREQUENCIES for by in errors.values()]
        rows.append((f"{force:.0f}\u00a0N", *cells))
    return Table(
        f"RMSE on {title} [% of range] (its Figure 14)",
        ("force", *columns),
        tuple(rows),
        "Printed: below 10 % at all conditions.",
    )


def _profile(model: ActivationPressure, forces: tuple[float, ...]) -> Table:
    printed = printed_profile()
    rows: list[tuple[Cell, ...]] = []
    for force in (forces[0], forces[-1]):
        for j, point in enumerate(("minimum", "maximum", "inflection", "tangent")):
            for quantity, field in (
                ("contraction", "contractions"),
                ("pressure [bar]", "pressures"),
            ):
                both = [
                    float(np.polyval(getattr(m, field)[4 * j : 4 * j + 4], force))
                    for m in (printed, model)
                ]
                rows.append((f"{point}, {quantity}, {force:.0f} N", *both))
    for f in FREQUENCIES:
        both = [m.gamma[0] * f + m.gamma[1] for m in (printed, model)]
        rows.append((f"gamma at {f:g} Hz", *both))
    return Table(
        "Characteristic points and rates (its Tables 1 and 2)",
        ("quantity", "printed", "here"),
        tuple(rows),
    )


def _figures(
    sines: dict[Condition, Recording],
    waves: dict[Condition, Recording],
    theirs: ActivationPressure,
    ours: ActivationMemory,
) -> tuple[Figure, ...]:
    figures = []
    for title, recordings in (
        ("Sines (its Figure 12)", sines),
        ("Random waves (its Figure 13)", waves),
    ):
        for condition in ((150.0, 1.0), (300.0, 2.0)):
            recording = recordings[condition]
            e = thinned(recording["contraction"], 2000)
            force, frequency = condition
            figures.append(
                Figure(
                    f"{title}: {force:.0f} N, {frequency:g} Hz",
                    "contraction",
                    "pressure [bar]",
                    {
                        "measured": (e, thinned(recording["pressure"], 2000)),
                        THEIRS: (e, thinned(modelled(theirs, recording, frequency), 2000)),
                        OURS: (e, thinned(modelled(ours, recording, frequency), 2000)),
                    },
                )
            )
    return tuple(figures)
