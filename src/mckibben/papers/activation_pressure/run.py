"""Pressure for a contraction: at every force and frequency, then on random waves."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.force.activation import ActivationPressure
from mckibben.estimators.core.data import training_data
from mckibben.estimators.force.activation import (
    by_force,
    outermost,
)
from mckibben.papers.experiment import Axes, Cell, Curves, Experiment, Verdict, rms
from mckibben.papers.recognising import Runs
from mckibben.recording import Recording
from mckibben.signals.protocol import protocol

THEIRS, OURS, SWARM = "the paper's", "ours", "the paper's, by particle swarm"
FITS: dict[str, tuple[str, dict[str, Any]]] = {
    THEIRS: ("activation-pressure", {}),
    SWARM: ("activation-pressure", {"method": "pso"}),
    OURS: ("activation-memory", {}),
}
QUALITIES = ("RMSE [% of range]", "correlation")

QUICK = 3
"""One of so many forces is recorded by the quick run."""

SHAPES = (100.0, 150.0)
"""Forces of the paper's Figure 10 [N]."""

Recordings = Mapping[tuple[float, float, str], Recording]
"""By force [N], frequency [Hz] and the name of their row."""

BAR_PER_MPA = 10.0

SHOWN = {"sines": 1.0, "waves": 3.0}
"""Periods of a run that figures show, its last."""

DRAWN, GAP = 100, (np.nan, np.nan)
"""Points of a cubic that is drawn; between two curves of one name."""


@dataclass(frozen=True)
class Study:
    """Slow cycles, sines and random waves, and the paper's model as printed and as fitted."""

    experiment: Experiment
    slow: Recordings
    sines: Recordings
    waves: Recordings
    printed: ActivationPressure
    fitted: ActivationPressure
    swarmed: ActivationPressure


def run(experiment: Experiment) -> None:
    """Record slow cycles, sines and random waves at every force, and identify both models."""
    names = None
    if experiment.quick and experiment.data is None:
        planned = protocol("activation-pressure", experiment.rig).runs
        forces = sorted({run.labels["force"] for run in planned})[::QUICK]
        names = [run.name for run in planned if run.labels["force"] in forces]
    runs = experiment.record(names=names, until=0.8)

    slow, sines, waves = (by_condition(runs, s) for s in ("static", "hysteresis", "random"))
    train = [*slow.values(), *sines.values()]
    for name, (model, settings) in experiment.steps(0.82, 0.98, [*FITS.items()]):
        experiment.fit(name, model, train, settings)
    fitted: Any = experiment.models[THEIRS]
    swarm: Any = experiment.models[SWARM]
    printed = experiment.paper.printed("activation-pressure-profile")
    study = Study(experiment, slow, sines, waves, printed, fitted, swarm)
    _scores(study, "sines", sines)
    _scores(study, "waves", waves)
    for part in (_profile, _constants, _rates, _extremes, _loops):
        part(study)


def by_condition(runs: Runs, stage: str) -> Recordings:
    """Return the recordings of a stage; repeated conditions are numbered in the name of their row."""
    recordings: dict[tuple[float, float, str], Recording] = {}
    for name in runs.names(stage=stage):
        force, frequency = float(runs.of(name, "force")), float(runs.of(name, "frequency"))
        row = f"{abs(force) if abs(force) < 1 else force:.3g} N, {frequency:.2g} Hz"
        row = f"{row}, {name}" if any(row == key[2] for key in recordings) else row
        recordings[force, frequency, row] = runs[name].with_derived(["contraction"])
    return dict(sorted(recordings.items()))


def static(model: ActivationPressure, recording: Recording) -> Array:
    """Return the pressure of the paper's model without its extracted hysteresis."""
    return replace(model, gamma=(0.0, 0.0)).simulate(recording)["pressure"]


def modelled(study: Study, recording: Recording, frequency: float) -> dict[str, Array]:
    """Return the pressures of the paper's model, which needs the frequency, and of ours."""
    pressure = replace(study.fitted, frequency=frequency).simulate(recording)["pressure"]
    return {THEIRS: pressure, OURS: study.experiment.simulate(OURS, recording)["pressure"]}


def points(model: ActivationPressure, force: float) -> tuple[Array, Array]:
    """Return e_1 to e_4 and y_1 to y_4 [bar] at a force [N]."""
    cubics = (np.reshape(field, (4, 4)).T for field in (model.contractions, model.pressures))
    contractions, pressures = (np.polyval(cubic, force) for cubic in cubics)
    return contractions, pressures


def _percent(
    model: ActivationPressure, condition: tuple[float, float, str], run: Recording
) -> float:
    """Return the RMSE of the paper's model over a sine of a frequency, in percent of its range."""
    p = replace(model, frequency=condition[1]).simulate(run)["pressure"]
    return 100 * rms(p - run["pressure"]) / float(np.ptp(run["pressure"]))


def static_rmse(model: ActivationPressure, runs: Collection[Recording]) -> float | None:
    """Return the RMSE of the static pressure over runs [bar], None without any."""
    if not runs:
        return None
    return rms(np.concatenate([static(model, run) - run["pressure"] for run in runs]))


def _scores(study: Study, key: str, recordings: Recordings) -> None:
    """Add errors and correlations; return the worst, the count above the printed ones, and the ends."""
    rows: dict[str, list[float]] = {}
    for (_, frequency, row), recording in recordings.items():
        y, pressures = recording["pressure"], modelled(study, recording, frequency).values()
        percents = [100 * rms(p - y) / float(np.ptp(y)) for p in pressures]
        rows[row] = [*percents, *(float(np.corrcoef(p, y)[0, 1]) for p in pressures)]
    names = [f"{quality}, {name}" for quality in QUALITIES for name in (THEIRS, OURS)]
    study.experiment.table(key, names, rows)
    bound = study.experiment.paper.tables["sines"].bound or np.inf
    for i, owner in enumerate(("theirs", "ours") if rows else ()):
        percents, correlations = ([row[k] for row in rows.values()] for k in (i, 2 + i))
        worst = max(percents)
        facts = {"n": len(rows), "worst": worst, "at": [*rows][percents.index(worst)]}
        facts |= {"above": sum(percent > bound for percent in percents)}
        facts |= {"low": min(correlations), "high": max(correlations)}
        facts |= {"below": Verdict(facts["above"] == 0)}
        study.experiment.add_facts(
            **{f"{key}_{owner}_{name}": fact for name, fact in facts.items()}
        )


ORDER = [2, 0, 1, 3]
"""Points by rising contraction."""


def _profile(study: Study) -> None:
    """Add the characteristic points at every force, and the error of the static pressure."""
    experiment, slow = study.experiment, study.slow
    models = {"printed": study.printed, "here": study.fitted}
    rows: dict[str, list[Cell]] = {}
    for force in dict.fromkeys(force for force, *_ in slow or study.sines):
        cycles = [run for condition, run in slow.items() if condition[0] == force]
        for source, model in models.items():
            cells = np.concatenate([values[ORDER] for values in points(model, force)]).tolist()
            rows[f"{force:.3g} N, {source}"] = [*cells, static_rmse(model, cycles)]
    names = [f"e_{j + 1}" for j in ORDER] + [f"y_{j + 1} [bar]" for j in ORDER]
    experiment.table("points", [*names, "static RMSE [bar]"], rows)
    if slow:
        printed_rmse, rmse = (static_rmse(model, slow.values()) for model in models.values())
        experiment.add_facts(static=rmse, static_printed=printed_rmse)
    experiment.add_facts(slope=study.fitted.gamma[0], slope_printed=study.printed.gamma[0])


def _constants(study: Study) -> None:
    """Add Table 1 as printed: the cubics of the force."""
    names = [f"e_{j}" for j in (1, 2, 3, 4)] + [f"y_{j} [MPa]" for j in (1, 2, 3, 4)]
    units = np.repeat([[1.0], [BAR_PER_MPA]], 4, axis=0)
    cubics = [
        np.reshape((*model.contractions, *model.pressures), (8, 4)) / units
        for model in (study.printed, study.fitted)
    ]
    rows = dict(zip(names, np.stack(cubics, axis=2).reshape(8, 8).tolist(), strict=True))
    columns = [f"{letter}, {source}" for letter in "abcd" for source in ("printed", "here")]
    study.experiment.table("constants", columns, rows)


def _rates(study: Study) -> None:
    """Add gamma and phi, whose product is identified: gamma is 1 at mean frequency."""
    frequencies = np.unique([frequency for _, frequency, _ in study.sines])
    forces = np.unique([force for force, *_ in (*study.slow, *study.sines)])
    middle, columns = float(np.mean(frequencies)), []
    curves: dict[str, dict[str, tuple[Array, Array]]] = {"gamma": {}, "phi": {}}
    models = {"printed": study.printed, "here": study.fitted, "here, by swarm": study.swarmed}
    for source, model in models.items():
        scale = float(np.polyval(model.gamma, middle))
        gamma = np.polyval(model.gamma, frequencies) / scale
        phi = scale * np.polyval(model.phi, forces)
        errors = [_percent(model, *sine) for sine in study.sines.items()]
        columns.append(
            [model.gamma[0] / scale, *gamma.tolist(), *phi.tolist(), rms(np.array(errors))]
        )
        curves["gamma"][source], curves["phi"][source] = (frequencies, gamma), (forces, phi)
    names = ["slope of gamma [1/Hz]", *(f"gamma at {f:g} Hz" for f in frequencies)]
    names += [*(f"phi at {f:.3g} N [bar s]" for f in forces), "RMSE over all sines [% of range]"]
    rows = dict(zip(names, zip(*columns, strict=True), strict=True))
    study.experiment.table("rates", [*models], rows, middle=middle)
    study.experiment.add_facts(off=dict(zip(models, rows[names[-1]], strict=True)))
    study.experiment.figure("rates", {name: Axes(panel, name) for name, panel in curves.items()})


def _extremes(study: Study) -> None:
    """Add the extrema of the loops, and the static pressure before and after adjustment to them."""
    experiment, sines = study.experiment, [*study.sines.values()]
    data = training_data(sines, "contraction", "pressure", None, ("force",))
    outer, through = list[Array](), list[Array]()
    rows: dict[str, list[float]] = {}
    static_curves: dict[str, dict[str, tuple[Array, Array]]] = {"before": {}, "after": {}}
    groups = by_force(data.runs)
    for force, places in groups.items():
        group = [data.runs[i] for i in places]
        extrema = outermost(group)
        outer.append(extrema)
        e, y = (np.concatenate(parts) for parts in zip(*((r.u, r.y) for r in group), strict=True))
        cubics = {
            "before": np.polyfit(e, y, 3),
            "after": np.polyfit(*points(study.fitted, force), 3),
        }
        e_grid = np.linspace(extrema[0, 0], extrema[1, 0], 400)
        row = f"{round(force, 1) + 0.0:.3g} N"
        spans = float(np.ptp(e)), float(np.ptp(y))
        rows[row] = [_distance(c, e_grid, end, spans) for c in cubics.values() for end in extrema]
        for stage, cubic in cubics.items():
            static_curves[stage][row] = e_grid, np.asarray(np.polyval(cubic, e_grid))
        thin = e_grid[:: e_grid.size // DRAWN]
        through.append(np.vstack([np.stack([thin, np.polyval(cubics["after"], thin)], 1), GAP]))
    columns = [f"{end}, {stage}" for stage in ("before", "after") for end in ("minimum", "maximum")]
    if len(rows) > 4:  # a cubic of the force goes through the extremes at four forces exactly
        experiment.table("distance", columns, rows)
        low, high = (sum(cells[k + 2] < cells[k] for cells in rows.values()) for k in (0, 1))
        nearer = Verdict(low + high == 2 * len(rows))
        experiment.add_facts(nearer_low=low, nearer_high=high, n_forces=len(rows), nearer=nearer)
    local: dict[str, list[Array]] = {}
    for (_, frequency, _), run in zip(study.sines, data.runs, strict=True):
        local.setdefault(f"{frequency:.2g} Hz", []).append(outermost([run]))
    scatter = {name: np.vstack(extrema) for name, extrema in local.items()}
    final = {"static pressure": np.vstack(through), "of every force": np.vstack(outer)}
    panels = {"local extrema": scatter, "global extrema": final}
    experiment.figure(
        "extrema", {t: {n: (*xy.T,) for n, xy in c.items()} for t, c in panels.items()}
    )
    experiment.figure("static", static_curves)
    _coefficients(study, np.array([*groups]))


def _coefficients(study: Study, forces: Array) -> None:
    """Add the coefficients of the static pressure by force, as printed and here: Figure 9(b)."""
    between = np.linspace(forces.min(), forces.max(), DRAWN)
    models = {"printed": (study.printed, between)} if study.experiment.of_its_size else {}
    models["here"] = study.fitted, forces
    panels: dict[str, dict[str, tuple[Array, Array]]] = {f"beta_{k}": {} for k in range(4)}
    for source, (model, model_forces) in models.items():
        betas = [np.polyfit(*points(model, force), 3)[::-1] for force in model_forces]
        for panel, values in zip(panels.values(), np.transpose(betas), strict=True):
            panel[source] = model_forces, values
    study.experiment.figure("beta", panels)


def _distance(cubic: Array, along: Array, end: Array, spans: tuple[float, float]) -> float:
    """Return the shortest distance of a point from a curve, axes in shares of their ranges [%]."""
    away = (along - end[0]) / spans[0], (np.polyval(cubic, along) - end[1]) / spans[1]
    return float(100 * np.hypot(*away).min())


def _loops(study: Study) -> None:
    """Add loops of sines and random waves, and their extracted hysteresis."""
    for key, recordings in (("sines", study.sines), ("waves", study.waves)):
        panels: dict[str, Curves] = {}
        for condition in _sample([*recordings]):
            run = recordings[condition]
            pressures = {run.origin: run["pressure"]} | modelled(study, run, condition[1])
            part = _last_periods(run, condition[1], SHOWN[key])
            panels[condition[2]] = {
                n: (run["contraction"][part], p[part]) for n, p in pressures.items()
            }
        study.experiment.figure(key, panels)
    shapes: dict[str, Curves] = {}
    forces = [force for force, *_ in study.sines]
    nearest = [min(forces, key=lambda force: abs(force - shape)) for shape in SHAPES]
    for (force, frequency, row), run in study.sines.items():
        if force in nearest:
            static_pressure, e = static(study.fitted, run), run["contraction"]
            pressures = {
                "extracted": run["pressure"],
                THEIRS: modelled(study, run, frequency)[THEIRS],
            }
            part = _last_periods(run, frequency, SHOWN["sines"])
            shapes[row] = {n: (e[part], (p - static_pressure)[part]) for n, p in pressures.items()}
    study.experiment.figure("shapes", shapes)


def _last_periods(recording: Recording, frequency: float, periods: float) -> slice:
    """Return the last periods of a recording."""
    return slice(max(len(recording) - round(periods / frequency / recording.step) - 1, 0), None)


def _sample(conditions: Sequence[tuple[float, float, str]]) -> list[tuple[float, float, str]]:
    """Return up to four conditions: weak and strong forces, low and high frequencies."""
    forces, frequencies = (sorted({condition[i] for condition in conditions}) for i in (0, 1))
    indices = product(
        {len(forces) // 2, len(forces) - 1}, {len(frequencies) // 3, len(frequencies) - 1}
    )
    corners = {(forces[f], frequencies[w]) for f, w in indices if conditions}
    return list(
        {condition[:2]: condition for condition in conditions if condition[:2] in corners}.values()
    )
