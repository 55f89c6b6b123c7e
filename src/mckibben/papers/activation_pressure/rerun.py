"""Paper E again: the pressure that gives a contraction, at 28 conditions and on random waves.

Source: "Inverse Modeling of Nonlinear Artificial Muscle Using Polynomial Parameterization and
Particle Swarm Optimization".
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.force.activation import ActivationMemory, ActivationPressure
from mckibben.comparison.checkpoints import Checkpoints
from mckibben.estimators.force.activation import (
    ActivationMemoryEstimator,
    ActivationPressureEstimator,
)
from mckibben.papers.activation_pressure.protocol import FORCES, FREQUENCIES
from mckibben.papers.activation_pressure.published import activation_pressure as printed_profile
from mckibben.papers.keeping import fitted, recorded
from mckibben.papers.reproduction import (
    Cell,
    Figure,
    Points,
    Progress,
    Reproduction,
    Source,
    Table,
    rms,
    thinned,
)
from mckibben.recording import Recording
from mckibben.signals.protocol import protocol

SOURCE = Source(
    "Inverse Modeling of Nonlinear Artificial Muscle Using Polynomial Parameterization and Particle "
    "Swarm Optimization",
    "Which pressure gives a wished-for contraction at a force and a frequency, hysteresis included?",
    authors="Mat Dzahir, Yamamoto",
    published="Hindawi, 2020",
    doi="10.1155/2020/8189157",
)

REST_LENGTH = 530.0
"""Of the muscle [mm]."""

THEIRS, OURS = "the paper's", "ours"

QUICK_FORCES = (0.0, 150.0, 300.0)

PRINTED_BOUND = 10.0
"""That the paper's RMSE keep below at all conditions [%]."""

Condition = tuple[float, float]
Model = ActivationPressure | ActivationMemory
Scores = dict[str, dict[Condition, "Score"]]


class Score(NamedTuple):
    """How near a model's pressure is to what was measured in one run."""

    percent: float
    """RMSE in per cent of the range of the measured pressure."""
    correlation: float


def activation_pressure(
    *, quick: bool, seed: int, jobs: int | None, tell: Progress, kept: Checkpoints
) -> Reproduction:
    """Run slow cycles, sines and random waves at every force, and identify both models."""
    del jobs
    forces = QUICK_FORCES if quick else FORCES
    plan = protocol("activation-pressure")
    names = [run.name for run in plan.runs if run.labels["force"] in forces]
    stages: dict[str, dict[Condition, Recording]] = {"static": {}, "hysteresis": {}, "random": {}}
    for run, recording in recorded(
        kept, plan.name, names, seed, lambda share, text: tell(0.8 * share, text)
    ):
        contraction = recording["displacement"] / REST_LENGTH
        whole = recording.with_channels({"contraction": ""}, contraction=contraction)
        condition = (float(run.labels["force"]), float(run.labels["frequency"]))
        stages[str(run.labels["stage"])][condition] = whole
    slow, sines, waves = stages.values()
    train = [*slow.values(), *sines.values()]
    tell(0.82, "the paper's model")
    theirs = fitted(kept, THEIRS, ActivationPressureEstimator(seed=seed), train).block
    tell(0.9, "ours")
    ours = fitted(kept, OURS, ActivationMemoryEstimator(seed=seed), train).block
    assert isinstance(theirs, ActivationPressure)
    assert isinstance(ours, ActivationMemory)
    models: dict[str, Model] = {THEIRS: theirs, OURS: ours}
    on_sines, on_waves = (
        {
            name: {c: score(model, r, c[1]) for c, r in runs.items()}
            for name, model in models.items()
        }
        for runs in (sines, waves)
    )
    printed = printed_profile()
    return Reproduction(
        name="activation-pressure",
        source=SOURCE,
        summary=(
            f"The paper's model on the {len(sines)} sines: {_said(on_sines[THEIRS])} "
            "(printed: below 10 % at all conditions, .875 to .988).",
            f"The paper's model on the {len(waves)} random waves, which it was not fitted to: "
            f"{_said(on_waves[THEIRS])} (printed: below 10 % there, too).",
            f"Ours, which is told no frequency, on the sines: {_said(on_sines[OURS])}.",
            f"Ours on the random waves: {_said(on_waves[OURS])}.",
            "Static pressure over the slow cycles: "
            f"{_static_rmse(theirs, slow.values()):.2f} bar RMSE as identified here, "
            f"{_static_rmse(printed, slow.values()):.2f} bar by the printed profile.",
            f"Slope of gamma: {theirs.gamma[0]:+.3f} per Hz (printed: {printed.gamma[0]:+.3f}).",
        ),
        tables=(
            *_tables("sines", on_sines, forces),
            *_tables("random waves", on_waves, forces),
            _profile(printed, theirs, slow),
            _rates(printed, theirs, forces),
        ),
        figures=_figures(sines, waves, theirs, ours),
        notes=(
            "The paper does not print what its errors are relative to. Here: to the range of the "
            "recorded pressure, run by run.",
            "Pressures of the sines are the printed y_1 and y_2; loads are forces that do not swing.",
            "Slow cycles at every force are ours: they show where pressure is low and where it is high.",
            "How inflection and tangent were moved to the boundaries of low and high pressure is not "
            "printed. Here the boundaries are at the printed shares of the range of pressure, and the "
            "contractions there by least squares, the cubic being held to the extremes of the loops.",
            "Gamma and phi are found by least squares, where the paper has a particle swarm.",
            "Both models are fitted to slow cycles and sines; random waves are only tested on.",
            "The rig was made after the printed profile, rates included: gamma and phi near the printed "
            "ones speak for the identification, not for the muscle.",
        ),
    )


def modelled(model: Model, recording: Recording, frequency: float) -> Array:
    """Return the pressure of a model; the paper's is told the frequency."""
    told = replace(model, frequency=frequency) if isinstance(model, ActivationPressure) else model
    pressure: Array = told.simulate(recording)["pressure"]
    return pressure


def score(model: Model, recording: Recording, frequency: float) -> Score:
    """Return how near a model is to a recording."""
    pressure, measured = modelled(model, recording, frequency), recording["pressure"]
    percent = 100 * rms(pressure - measured) / float(np.ptp(measured))
    return Score(percent, float(np.corrcoef(pressure, measured)[0, 1]))


def static(model: ActivationPressure) -> ActivationPressure:
    """Return a model without its extracted hysteresis."""
    return replace(model, gamma=(0.0, 0.0))


def points(model: ActivationPressure, force: float) -> tuple[Array, Array]:
    """Return e_1 to e_4 and y_1 to y_4 [bar] at a force [N]."""
    cubics = (np.reshape(field, (4, 4)).T for field in (model.contractions, model.pressures))
    contractions, pressures = (np.polyval(cubic, force) for cubic in cubics)
    return contractions, pressures


def _static_rmse(model: ActivationPressure, runs: Iterable[Recording]) -> float:
    errors = [modelled(static(model), run, 0.0) - run["pressure"] for run in runs]
    return rms(np.concatenate(errors))


def _said(scores: dict[Condition, Score]) -> str:
    """Return the worst error, where it is, how many are above the printed bound; correlations."""
    force, frequency = worst = max(scores, key=lambda condition: scores[condition].percent)
    above = sum(found.percent > PRINTED_BOUND for found in scores.values())
    correlations = [found.correlation for found in scores.values()]
    return (
        f"at most {scores[worst].percent:.1f} % of range (at {force:.0f} N, {frequency:g} Hz), "
        f"{above} of {len(scores)} above {PRINTED_BOUND:.0f} %; correlation "
        f"{min(correlations):.3f} to {max(correlations):.3f}"
    )


def _tables(title: str, scores: Scores, forces: tuple[float, ...]) -> Iterator[Table]:
    columns = ("force", *(f"{name}, {f:g} Hz" for f in FREQUENCIES for name in scores))
    for place, (what, note) in enumerate(
        (
            ("RMSE [% of range] on {} (its Figure 14)", "Printed: below 10 % at all conditions."),
            ("Correlation on {}", "Printed with its Figure 12, of the sines: .875 to .988."),
        )
    ):
        rows: list[tuple[Cell, ...]] = [
            (
                f"{force:.0f}\u00a0N",
                *(by[force, f][place] for f in FREQUENCIES for by in scores.values()),
            )
            for force in forces
        ]
        ends = [
            c
            for c in columns[1:]
            if c.endswith((f"{FREQUENCIES[0]:g} Hz", f"{FREQUENCIES[-1]:g} Hz"))
        ]
        drawn = None if place else Points("RMSE [% of range]", tuple(ends), PRINTED_BOUND)
        yield Table(what.format(title), columns, tuple(rows), note, drawn)


def _profile(
    printed: ActivationPressure, found: ActivationPressure, slow: dict[Condition, Recording]
) -> Table:
    order = [2, 0, 1, 3]
    rows: list[tuple[Cell, ...]] = []
    for (force, _), recording in slow.items():
        for whose, model in (("printed", printed), ("here", found)):
            contractions, pressures = points(model, force)
            rows.append(
                (
                    f"{force:.0f}\u00a0N",
                    whose,
                    *(float(e) for e in contractions[order]),
                    *(float(y) for y in pressures[order]),
                    _static_rmse(model, [recording]),
                )
            )
    return Table(
        "Characteristic points (its Table 1), and the static pressure through them",
        (
            "force",
            "whose",
            *(f"e_{j + 1}" for j in order),
            *(f"y_{j + 1} [bar]" for j in order),
            "static RMSE [bar]",
        ),
        tuple(rows),
        "3: inflection, 1: global minimum, 2: global maximum, 4: tangent. The RMSE is that of y over "
        "the slow cycle from 0 to 4 bar.",
    )


def _rates(
    printed: ActivationPressure, found: ActivationPressure, forces: tuple[float, ...]
) -> Table:
    """Return gamma and phi, of which only the product has a meaning: gamma is 1 at mean frequency."""
    middle = float(np.mean(FREQUENCIES))
    both = []
    for model in (printed, found):
        scale = float(np.polyval(model.gamma, middle))
        gamma = {
            "slope of gamma [1/Hz]": model.gamma[0] / scale,
            **{
                f"gamma at {f:g} Hz": float(np.polyval(model.gamma, f)) / scale for f in FREQUENCIES
            },
        }
        phi = {
            f"phi at {force:.0f} N [bar s]": scale * float(np.polyval(model.phi, force))
            for force in forces
        }
        both.append(gamma | phi)
    rows: list[tuple[Cell, ...]] = [(name, *(model[name] for model in both)) for name in both[0]]
    return Table(
        "Extracted hysteresis (its Table 2)",
        ("quantity", "printed", "here"),
        tuple(rows),
        f"Only gamma times phi has a meaning; gamma is scaled to 1 at {middle:g} Hz.",
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
                        recording.origin: (e, thinned(recording["pressure"], 2000)),
                        THEIRS: (e, thinned(modelled(theirs, recording, frequency), 2000)),
                        OURS: (e, thinned(modelled(ours, recording, frequency), 2000)),
                    },
                )
            )
    return tuple(figures)
