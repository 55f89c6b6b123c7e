"""The pressure that gives a contraction: at every force and frequency, then on random waves."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.force.activation import ActivationPressure
from mckibben.errors import DataError
from mckibben.estimators.core.data import Run, training_data
from mckibben.estimators.force.activation import (
    FORCE_STEP,
    STATIC_SHARE,
    ActivationMemoryEstimator,
    ActivationPressureEstimator,
    by_force,
    dominant_frequency,
    outermost,
)
from mckibben.papers.experiment import Cell, Curves, Experiment, Labels, Rerun, rms
from mckibben.recording import Recording
from mckibben.signals import reversals

THEIRS, OURS = "the paper's", "ours"
QUICK_FORCES = (0.0, 150.0, 300.0)

SHAPES = (100.0, 150.0)
"""Forces of the paper's Figure 10 [N]."""

Condition = tuple[float, float]
"""Force [N] and frequency [Hz]."""

BAR_PER_MPA = 10.0


class Score(NamedTuple):
    """How near a model's pressure is to what was measured in one run."""

    percent: float
    """RMSE in per cent of the range of the measured pressure."""
    correlation: float


def run(experiment: Experiment) -> None:
    """Record slow cycles, sines and random waves at every force, and identify both models."""
    names = None
    if experiment.quick and experiment.data is None:
        names = [f"{kind}-{f:.0f}N{rate}" for f in QUICK_FORCES for kind, rate in KINDS]
    runs = experiment.record(names=names, until=0.8)
    stages: dict[str, dict[Condition, Recording]] = {"static": {}, "hysteresis": {}, "random": {}}
    for name, recording in runs.items():
        condition = (float(runs.of(name, "force")), float(runs.of(name, "frequency")))
        stages[runs.of(name, "stage")][condition] = recording.with_derived(["contraction"])
    slow, sines, waves = (dict(sorted(stage.items())) for stage in stages.values())
    train = [*slow.values(), *sines.values()]
    experiment.tell(0.82, "the paper's model")
    theirs = experiment.fit(THEIRS, ActivationPressureEstimator(seed=experiment.seed), train).block
    experiment.tell(0.9, "ours")
    experiment.fit(OURS, ActivationMemoryEstimator(seed=experiment.seed), train)
    assert isinstance(theirs, ActivationPressure)
    scores = {
        key: {c: _scores(experiment, r, c[1]) for c, r in recordings.items()}
        for key, recordings in (("sines", sines), ("waves", waves))
    }
    for key, found in scores.items():
        columns = [
            f"{what}, {name}"
            for what in ("RMSE [% of range]", "correlation")
            for name in (THEIRS, OURS)
        ]
        rows = {
            label(*c): [*(one.percent for one in both), *(one.correlation for one in both)]
            for c, both in found.items()
        }
        experiment.table(key, columns, rows)
        for place, whose in enumerate(("theirs", "ours")):
            _said(experiment, f"{key}_{whose}", {c: both[place] for c, both in found.items()})
    printed = experiment.paper.printed("activation-pressure-profile")
    forces = sorted({force for force, _ in (*slow, *sines)})
    _profile(experiment, printed, theirs, slow or sines)
    _constants(experiment, printed, theirs)
    _rates(experiment, printed, theirs, forces, sorted({f for _, f in sines}))
    experiment.says(
        static=_static_rmse(theirs, (slow or sines).values()),
        static_printed=_static_rmse(printed, (slow or sines).values()),
        slope=theirs.gamma[0],
        slope_printed=printed.gamma[0],
    )
    _extremes(experiment, theirs, sines)
    _loops(experiment, theirs, sines, waves)


KINDS = (
    ("static", ""),
    *((kind, f"-{f:.1f}Hz") for kind in ("sine", "random") for f in (0.5, 1, 1.5, 2)),
)
"""Runs of the protocol at a force: how their names begin and end."""


REPEATS = 0.1
"""Share of the range by which peaks of a sine differ at most: those of a random wave differ by more."""


def sort(recordings: Sequence[Recording]) -> list[Labels | None]:
    """Tell slow cycles, sines and random waves apart, by the pressure, and under which force each is."""
    whole = [one.with_derived(["contraction"]) for one in recordings]
    runs = training_data(whole, "contraction", "pressure", None, ("force",)).runs
    forces = {i: force for force, own in by_force(runs).items() for i in own}
    swings = training_data(whole, "pressure", "contraction", None, ("force",)).runs
    at = [dominant_frequency(swing) for swing in swings]
    found: list[Labels | None] = []
    for place, recording in enumerate(recordings):
        pressure = recording["pressure"]
        turns = pressure[reversals(pressure)[1:-1]]
        peaks = turns[turns > pressure.mean()]
        repeats = peaks.size < 3 or float(np.ptp(peaks)) < REPEATS * float(np.ptp(pressure))
        slow = at[place] < STATIC_SHARE * max(at)
        stage = "static" if slow else "hysteresis" if repeats else "random"
        force = FORCE_STEP * round(forces[place] / FORCE_STEP)
        frequency = 0.0 if slow else round(20 * at[place]) / 20
        labels = {"stage": stage, "force": force, "frequency": frequency}
        found.append(Labels("test" if stage == "random" else "train", labels))
    if not any(one and one.labels["stage"] == "hysteresis" for one in found):
        raise DataError(
            "no recording repeats a cycle of pressure",
            channel="pressure",
            remedy="record sines of the pressure, each at a held force",
        )
    return found


def label(force: float, frequency: float) -> str:
    """Return the name of a condition's row."""
    return f"{force:.0f} N, {frequency:g} Hz"


def modelled(model: ActivationPressure, recording: Recording, frequency: float) -> Array:
    """Return the pressure that the paper's model gives at a frequency [Hz]."""
    pressure: Array = replace(model, frequency=frequency).simulate(recording)["pressure"]
    return pressure


def _scores(experiment: Experiment, recording: Recording, frequency: float) -> tuple[Score, Score]:
    """Return how near the paper's model, which needs the frequency, and ours are to a recording."""
    theirs = experiment.models[THEIRS]
    assert isinstance(theirs, ActivationPressure)
    measured = recording["pressure"]
    both = modelled(theirs, recording, frequency), experiment.simulate(OURS, recording)["pressure"]
    first, second = (
        Score(
            100 * rms(p - measured) / float(np.ptp(measured)), float(np.corrcoef(p, measured)[0, 1])
        )
        for p in both
    )
    return first, second


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


def _said(experiment: Experiment, key: str, scores: Mapping[Condition, Score]) -> None:
    """Give the worst error and where it is, how many are above what is printed, and correlations."""
    if not scores:
        return
    worst = max(scores, key=lambda condition: scores[condition].percent)
    bound = experiment.paper.tables["sines"].bound
    correlations = [found.correlation for found in scores.values()]
    facts = {
        "n": len(scores),
        "worst": scores[worst].percent,
        "at": label(*worst),
        "above": sum(found.percent > bound for found in scores.values()) if bound else 0,
        "low": min(correlations),
        "high": max(correlations),
    }
    experiment.says(**{f"{key}_{name}": value for name, value in facts.items()})


ORDER = [2, 0, 1, 3]
"""Points by rising contraction."""


def _profile(
    experiment: Experiment,
    printed: ActivationPressure,
    found: ActivationPressure,
    slow: Mapping[Condition, Recording],
) -> None:
    rows: dict[str, list[Cell]] = {}
    for (force, _), recording in slow.items():
        for whose, model in (("printed", printed), ("here", found)):
            contractions, pressures = points(model, force)
            cells = [*contractions[ORDER].tolist(), *pressures[ORDER].tolist()]
            rows[f"{force:.0f} N, {whose}"] = [*cells, _static_rmse(model, [recording])]
    names = [f"e_{j + 1}" for j in ORDER] + [f"y_{j + 1} [bar]" for j in ORDER]
    experiment.table("points", [*names, "static RMSE [bar]"], rows)


def _constants(
    experiment: Experiment, printed: ActivationPressure, found: ActivationPressure
) -> None:
    """Add Table 1 as printed: the cubics of the force."""
    rows: dict[str, list[Cell]] = {}
    for i, name in enumerate(
        [*(f"e_{j}" for j in range(1, 5)), *(f"y_{j} [MPa]" for j in range(1, 5))]
    ):
        cells: list[Cell] = []
        for model in (printed, found):
            cubics = np.reshape((*model.contractions, *model.pressures), (8, 4))[i]
            cells += (cubics / (1.0 if i < 4 else BAR_PER_MPA)).tolist()
        rows[name] = [cell for pair in zip(cells[:4], cells[4:], strict=True) for cell in pair]
    columns = [f"{letter}, {whose}" for letter in "abcd" for whose in ("printed", "here")]
    experiment.table("constants", columns, rows)


def _rates(
    experiment: Experiment,
    printed: ActivationPressure,
    found: ActivationPressure,
    forces: Sequence[float],
    frequencies: Sequence[float],
) -> None:
    """Add gamma and phi, of which only the product has a meaning: gamma is 1 at mean frequency."""
    middle = float(np.mean(frequencies))
    both, curves = [], {}
    for whose, model in (("printed", printed), ("here", found)):
        scale = float(np.polyval(model.gamma, middle))
        gamma = {
            f"gamma at {f:g} Hz": float(np.polyval(model.gamma, f)) / scale for f in frequencies
        }
        phi = {f"phi at {f:.0f} N [bar s]": scale * float(np.polyval(model.phi, f)) for f in forces}
        both.append({"slope of gamma [1/Hz]": model.gamma[0] / scale} | gamma | phi)
        curves[whose] = gamma, phi
    rows = {name: [model[name] for model in both] for name in both[0]}
    experiment.table("rates", ["printed", "here"], rows, middle=middle)
    panels = {
        title: {
            whose: (np.array(at), np.array([*pair[place].values()]))
            for whose, pair in curves.items()
        }
        for place, (title, at) in enumerate(
            (("gamma by frequency [Hz]", frequencies), ("phi by force [N]", forces))
        )
    }
    experiment.figure("rates", panels)


def _extremes(
    experiment: Experiment, model: ActivationPressure, sines: Mapping[Condition, Recording]
) -> None:
    """Add the extrema of the loops, and the static pressure before and after it goes through them."""
    data = training_data([*sines.values()], "contraction", "pressure", None, ("force",))
    local: list[Array] = []
    whole: list[Array] = []
    rows: dict[str, list[Cell]] = {}
    curves: tuple[dict[str, tuple[Array, Array]], ...] = {}, {}
    betas: dict[str, list[float]] = {f"beta_{k}": [] for k in range(4)}
    groups = by_force(data.runs)
    for force, places in groups.items():
        own = [data.runs[i] for i in places]
        local += [outermost([one]) for one in own]
        ends = outermost(own)
        whole.append(ends)
        e = np.concatenate([one.u for one in own])
        before = np.polyfit(e, np.concatenate([one.y for one in own]), 3)
        four = points(model, force)
        after = np.polyfit(*four, 3)
        along = np.linspace(ends[0, 0], ends[1, 0], 400)
        named = f"{abs(round(force)):d} N"
        distances: list[Cell] = [
            _distance(cubic, along, end, own) for cubic in (before, after) for end in ends
        ]
        rows[named] = distances
        for static_curve, cubic in zip(curves, (before, after), strict=True):
            static_curve[named] = along, np.asarray(np.polyval(cubic, along))
        for k in range(4):
            betas[f"beta_{k}"].append(float(after[3 - k]))
    columns = [
        f"{which}, {when}" for when in ("before", "after") for which in ("minimum", "maximum")
    ]
    experiment.table("distance", columns, rows)
    scatter = {
        "of every loop": tuple(np.vstack(local).T),
        "of every force": tuple(np.vstack(whole).T),
    }
    experiment.figure("extrema", {"": {name: (xy[0], xy[1]) for name, xy in scatter.items()}})
    experiment.figure("static", dict(zip(("before", "after"), curves, strict=True)))
    forces = np.array([*groups])
    experiment.figure(
        "beta", {name: {"here": (forces, np.array(values))} for name, values in betas.items()}
    )


def _distance(cubic: Array, along: Array, end: Array, runs: Sequence[Run]) -> float:
    """Return the shortest distance of a point from a curve, axes in shares of their ranges [%]."""
    spans = [
        float(np.ptp(np.concatenate(parts)))
        for parts in zip(*((r.u, r.y) for r in runs), strict=True)
    ]
    away = (along - end[0]) / spans[0], (np.polyval(cubic, along) - end[1]) / spans[1]
    return float(100 * np.hypot(*away).min())


def _loops(
    experiment: Experiment,
    theirs: ActivationPressure,
    sines: Mapping[Condition, Recording],
    waves: Mapping[Condition, Recording],
) -> None:
    """Add loops of sines and random waves, and the hysteresis extracted from them."""
    for key, recordings in (("sines", sines), ("waves", waves)):
        panels = {}
        for condition in _sample([*recordings]):
            recording = recordings[condition]
            e = recording["contraction"]
            curves: dict[str, tuple[Array, Array]] = {
                recording.origin: (e, recording["pressure"]),
                THEIRS: (e, modelled(theirs, recording, condition[1])),
                OURS: (e, experiment.simulate(OURS, recording)["pressure"]),
            }
            panels[label(*condition)] = curves
        if panels:
            experiment.figure(key, panels)
    shapes: dict[str, Curves] = {}
    for (force, frequency), recording in sines.items():
        if force in SHAPES:
            rest = modelled(static(theirs), recording, frequency)
            e, z = recording["contraction"], recording["pressure"] - rest
            shape = modelled(theirs, recording, frequency) - rest
            shapes[label(force, frequency)] = {"extracted": (e, z), THEIRS: (e, shape)}
    if shapes:
        experiment.figure("shapes", shapes)


def _sample(conditions: Sequence[Condition]) -> list[Condition]:
    """Return four conditions: weak and strong forces, low and high frequencies."""
    if not conditions:
        return []
    forces, frequencies = (sorted(set(values)) for values in zip(*conditions, strict=True))
    corners = [
        (f, w)
        for f in (forces[len(forces) // 2], forces[-1])
        for w in (frequencies[len(frequencies) // 3], frequencies[-1])
    ]
    return [one for one in dict.fromkeys(corners) if one in conditions]


RERUN = Rerun(run, sort)
