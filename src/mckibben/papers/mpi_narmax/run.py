"""Displacement under a varying load: models with and without the force, and compensation with it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import Any

import numpy as np

from mckibben import registry
from mckibben.arrays import Array
from mckibben.blocks.coupled.load_estimate import load_of
from mckibben.control import BlockController, EstimatedLoad, track, tune_pid
from mckibben.metrics import mae, rmse
from mckibben.papers.experiment import Axes, Cell, Curves, Experiment, Verdict
from mckibben.papers.mpi_narmax import protocol
from mckibben.papers.mpi_narmax.protocol import VARYING, driven
from mckibben.papers.recognising import Runs
from mckibben.recording import Recording
from mckibben.rigs import Rig
from mckibben.signals import cycles, resample, sine

AS_PRINTED, ALL_RATES, PLAIN = "MPI-NARMAX", "MPI-NARMAX, all rates", "MPI-NARMAX, ours"
MORE, OURS, PRESSURE = "MPI-NARMAX, more records", "balance", "balance, on recorded pressure"
LOADED = 0.05
"""Share of the greatest force from which on a load is on."""

HEADLINE = (AS_PRINTED, ALL_RATES, PLAIN, OURS)


@dataclass(frozen=True)
class Study:
    """Recordings on one grid, the run of each status, and the training runs of each model."""

    experiment: Experiment
    runs: Runs
    drive: str
    step: float
    statuses: Mapping[int, str]
    training: dict[str, list[str]] = field(default_factory=dict)

    def scored(self, run: str, x: str = "displacement", model: str = "") -> Array:
        """Return a channel, as modelled if a model is named; for a constant input, over the force."""
        source = self.experiment.simulate(model, self.runs[run]) if model else self.runs[run]
        start = self.runs.labels[run].labels.get("start", 0.0)
        return (source.time if x == "time" else source[x])[round(start / self.step) :]

    def errors(self, model: str, runs: Sequence[str]) -> tuple[float, float]:
        """Return MAE and RMSE over runs [mm]."""
        outputs = [
            np.concatenate([self.scored(n, model=source) for n in runs]) for source in ("", model)
        ]
        return mae(*outputs), rmse(*outputs)

    def curves(self, runs: Sequence[str], x: str, models: Sequence[str]) -> dict[str, Curves]:
        """Return panels of the displacement against a channel, or the time."""
        names = {self.runs[run].origin: "" for run in runs} | {model: model for model in models}
        return {
            run: {n: (self.scored(run, x), self.scored(run, model=m)) for n, m in names.items()}
            for run in runs
        }


def run(experiment: Experiment) -> None:
    """Identify models with and without the force, and compare them on motion that is not repeated."""
    recorded = experiment.record(until=0.1, loops=0.9)
    slowest = max(item.sample_time or 0.0 for item in recorded.values())
    step = max(0.05 if experiment.quick else 0.02, slowest)
    runs = Runs({name: resample(item, step) for name, item in recorded.items()}, recorded.labels)
    statuses = {k: n for k in range(1, len(runs) + VARYING) for n in runs.names(status=k)}
    study = Study(experiment, runs, driven([*runs.values()]), step, statuses)
    for part in (_fit, _errors, _constants, _loops, _force):
        part(study)
    if experiment.rig is not None and not experiment.quick:
        _track(study, experiment.rig)


def _fit(study: Study) -> None:
    """Fit models of single statuses without the force, then those with it."""
    experiment, runs, step = study.experiment, study.runs, study.step
    by_stage = {
        s: runs.names("train", stage=s) for s in ("free", "status", "weight", "pulls", "random")
    }
    train, free = [*chain(*by_stage.values())], by_stage["free"]
    rate = runs.of(study.statuses[1], "frequency")
    at_rate = [name for name in free if runs.of(name, "frequency") == rate][:1]
    pulls = by_stage["pulls"] or by_stage["weight"] + by_stage["random"]
    paper_settings = {
        "method": "pso",
        "memory": "rdpi",
        "constants": False,
        "learns_from": "loaded",
    }
    mpi_settings: dict[str, dict[str, Any]] = {
        "": {"thresholds": "identified", "nonnegative": False, "rate_time_constant": 0.0}
        | {"output_map": "free-polynomial", "map_size": 9},
        ", ours": {"rate_time_constant": 5 * step},
    }
    fits: list[tuple[str, str, dict[str, Any], list[str]]] = [
        (f"MPI-{k}{suffix}", "rdpi", {"input": study.drive, **settings}, [name])
        for k, name in study.statuses.items()
        for suffix, settings in mpi_settings.items()
        if k != VARYING
    ] + [
        (AS_PRINTED, "mpi-narmax", paper_settings, at_rate + pulls),
        (ALL_RATES, "mpi-narmax", paper_settings, free + pulls),
        (MORE, "mpi-narmax", paper_settings | {"learns_from": "all"}, train),
        (PLAIN, "mpi-narmax", {"method": "ls", "memory": "rdpi", "n_sets": 2}, train),
        ("balance, one record", "balance", {}, free + pulls),
        (OURS, "balance", {}, train),
        ("coupled-memory", "coupled-memory", {}, train),
        (PRESSURE, "balance", {"input": ("pressure",)}, train),
    ]
    sensed = study.drive == "voltage" and all(
        "pressure" in recording for recording in runs.values()
    )
    left_out = [MORE] * experiment.quick + [PRESSURE] * (not sensed)  # MORE takes longest
    fits = [fit for fit in fits if fit[0] not in left_out]
    rows: dict[str, tuple[Cell, ...]] = {}
    for name, family, settings, names in experiment.steps(0.1, 0.85, fits):
        fit_settings = {"input": (study.drive,)} | settings
        fitted = experiment.fit(name, family, [runs[run] for run in names], fit_settings)
        study.training[name] = names
        text = ", ".join(names) if names != train else "all training runs"
        rows[name] = text, fitted.seconds, fitted.n_free
    experiment.table("models", ("learned from", "time [s]", "parameters"), rows)


def _errors(study: Study) -> None:
    """Add errors by status, on pulls, on motion that is not repeated, and at constant input."""
    experiment, runs, training = study.experiment, study.runs, study.training
    held_runs, varying = runs.names(stage="held"), study.statuses[VARYING]
    groups = {f"status {k}": [name] for k, name in study.statuses.items()} | {
        "training pulls": runs.names("train", stage="pulls"),
        "random": [n for n in runs.names("test", stage="random") if n != varying],
        "held": held_runs,
    }
    errors = {k: {n: study.errors(n, g) for n in training} for k, g in groups.items() if g}
    errors["learned from"] = {n: study.errors(n, names) for n, names in training.items()}
    for i, key in enumerate(("mae", "rmse")):
        columns = [name for name in errors if name.startswith("status ")]
        rows = {n: [errors[column][n][i] for column in columns] for n in training}
        experiment.table(key, columns, rows)
    order = ("learned from", "training pulls", "status 4", "random", "held")
    groups_shown = [group for group in order if group in errors]
    columns = [f"{group}, {measure}" for group in groups_shown for measure in ("MAE", "RMSE")]
    rows = {n: [error for group in groups_shown for error in errors[group][n]] for n in training}
    experiment.table("errors", columns, rows)
    _constant_loads(study, errors)
    for group in errors.keys() & order[2:]:
        _headline(study, group, errors[group])
    if held_runs:
        outputs = {n: [study.scored(run, model=n) for run in held_runs] for n in ("", *training)}
        rows = {
            n or "muscle": [round(float(np.ptp(y[y.size // 2 :])), 6) for y in of_model]
            for n, of_model in outputs.items()
        }
        experiment.table("held", [f"swing at {runs.of(run, 'level'):g}" for run in held_runs], rows)


def _headline(study: Study, group: str, errors: Mapping[str, tuple[float, float]]) -> None:
    """Set how the headline models compare on a group of runs with the best one without the force."""
    key = group.replace(" ", "_")
    without_force = [name for name in errors if name[4].isdigit()]  # MPI-1, ...
    least = [min(errors[name][i] for name in without_force) for i in (0, 1)]
    best = next(name for name in without_force if errors[name][0] == least[0])
    texts = ("{} {:.2f} / {:.2f} mm".format(n, *errors[n]) for n in (best, *HEADLINE))
    worse = [n for n in errors if n not in without_force and errors[n][0] >= least[0]]
    facts: dict[str, Any] = {"": "; ".join(texts), "_worse": "; ".join(worse) or "none"}
    facts["_better"] = Verdict(errors[AS_PRINTED][0] < least[0])
    for name, i in (("_gains", 0), ("_gains_rmse", 1)):
        facts[name] = [least[i] / errors[n][i] for n in HEADLINE]
    study.experiment.add_facts(**{key + name: fact for name, fact in facts.items()})


def _constant_loads(study: Study, errors: Mapping[str, Mapping[str, tuple[float, float]]]) -> None:
    """Set the MAE of the paper's model by that of the MPI of the same constant load."""
    printed = study.experiment.paper.tables["mae"].printed
    pairs = [(f"status {k}", f"MPI-{k}") for k in study.statuses if k != VARYING]
    ratios = [errors[status][AS_PRINTED][0] / errors[status][name][0] for status, name in pairs]
    printed_ratios = [printed[status][AS_PRINTED] / printed[status][name] for status, name in pairs]
    for key, values in (("own_load", ratios), ("own_load_theirs", printed_ratios)):
        study.experiment.add_facts(**{key: ", ".join(f"{ratio:.2g}" for ratio in values)})
    study.experiment.add_facts(comparable=Verdict(max(ratios) <= max(printed_ratios)))


def _constants(study: Study) -> None:
    """Add Table 1 with ours, and where the printed MPI passes the turning point of its map."""
    experiment, largest_b, status = study.experiment, {}, study.statuses[1]
    hysteresis, output_map = experiment.paper.printed("mpi-narmax-mpi").parts
    powers = np.polynomial.Polynomial(output_map.polynomial)
    folds = powers.deriv().roots()
    fold = float(folds[(abs(folds.imag) < 1e-9) & (folds.real > 0)].real.min())
    rows: list[tuple[Cell, ...]] = []
    for f in (0.05, 0.1, 0.2, 0.22):
        wave = sine(np.arange(round(2000 / f)) * 0.001, 1 / f, protocol.HIGH, protocol.LOW)
        b = np.asarray(hysteresis.simulate(wave, sample_time=0.001))[wave.size // 2 :]
        y, past_fold = powers(b), np.mean(np.abs(b) > fold)
        largest_b[f] = float(b.max())
        rows.append((f, largest_b[f], 100 * float(past_fold), float(y.min()), float(y.max())))
    columns = ("largest b", "past the fold [%]", "lowest [mm]", "highest [mm]")
    experiment.table("folded", columns, rows)
    model: Any = experiment.models["MPI-1"]
    pi, polynomial = model.parts
    # Table 1's b has no offset; ours is scaled to be as large as that at 0.1 Hz.
    b = np.asarray(pi.simulate(study.scored(status, study.drive), sample_time=study.step))
    scale = largest_b[0.1] / float(np.abs(b - pi.offset).max())
    inner = [(pi.offset - polynomial.centre) / polynomial.scale, 1 / scale / polynomial.scale]
    a = np.polynomial.Polynomial(polynomial.polynomial)(np.polynomial.Polynomial(inner)).coef
    a = np.pad(a, (0, max(0, len(pi.thresholds) - a.size)))[::-1]
    table = zip(pi.thresholds, *np.multiply(scale, (pi.rate_weights, pi.weights)), a, strict=True)
    constants = {str(i): [*map(float, row)] for i, row in enumerate(table, start=1)}
    experiment.table("constants", ["r", "k", "d", "a"], constants)


def _loops(study: Study) -> None:
    """Add loops by rate and load, time plots, errors, and the displacement by force."""
    experiment, runs, statuses = study.experiment, study.runs, study.statuses
    kinds = {"pulls": "varying load", "weight": "constant load", "free": "no load"}
    panels: dict[str, dict[str, tuple[Array, Array]]] = {"no load": {}}
    for stage, kind in kinds.items():
        for name in runs.names(stage=stage):
            u, y = runs[name][study.drive], runs[name]["displacement"]
            if rate := runs.of(name, "frequency"):
                part = slice(None) if stage == "pulls" else cycles(u)[-1]
                panels.setdefault(f"{rate:g} Hz", {})[kind] = u[part], y[part]
                if stage == "free":
                    panels["no load"][f"{rate:g} Hz"] = u[part], y[part]
    unit = f"[{runs[statuses[1]].units[study.drive]}]"
    compared = {n: c for n, c in sorted(panels.items()) if len(c) > 1}
    experiment.figure("loads", compared or panels, unit=unit)
    pulls = [*runs.names("train", stage="pulls")[:1], statuses[VARYING]]
    models, held_runs = ("MPI-1", AS_PRINTED, ALL_RATES), runs.names(stage="held")
    experiment.figure("time", _time_plots(study, (statuses[1], *pulls), models), unit=unit)
    loops = [*statuses.values(), *pulls[:-1]]
    experiment.figure("statuses", study.curves(loops, study.drive, models), unit=unit)
    experiment.figure("pulls", study.curves(pulls, "force", models[1:]))
    errors = study.scored(statuses[1], model="MPI-1") - study.scored(statuses[1])
    share, edges = np.histogram(errors, 61, weights=np.full(errors.size, 100 / errors.size))
    outline = np.repeat(edges, 2), np.pad(np.repeat(share, 2), 1)
    experiment.figure("histogram", {"": {"MPI-1": outline}})
    if held_runs:
        muscle = {name: (study.scored(name, "force"), study.scored(name)) for name in held_runs}
        held_panels: dict[str, Curves] = {"muscle": muscle}
        held_panels |= study.curves(held_runs, "force", (*models[1:], OURS))
        experiment.figure("held", held_panels)


def _time_plots(study: Study, runs: Sequence[str], models: Sequence[str]) -> dict[str, Axes]:
    """Return panels of input, force and displacement over time; shaded while a load is on."""
    loaded_times: dict[str, list[tuple[float, float]]] = {}
    strongest = max(float(study.scored(run, "force").max()) for run in runs)
    for run in runs:
        time, loaded = study.scored(run, "time"), study.scored(run, "force") > LOADED * strongest
        ends = np.flatnonzero(np.diff(np.pad(loaded.astype(int), 1))).reshape(-1, 2)
        loaded_times[run] = [(float(time[begin]), float(time[end - 1])) for begin, end in ends]
    panels: dict[str, Axes] = {}
    for channel, key in ((study.drive, "input"), ("force", "force")):
        for run in runs:
            curve = study.scored(run, "time"), study.scored(run, channel)
            panels[f"{run}: {key}"] = Axes({study.runs[run].origin: curve}, key, loaded_times[run])
    for run, curves in study.curves(runs, "time", models).items():
        panels[f"{run}: displacement"] = Axes(curves, "", loaded_times[run])
    return panels


def _force(study: Study) -> None:
    """Add the force estimated from displacement and pressure, where pressure is recorded."""
    experiment, runs, test = study.experiment, study.runs, study.statuses[VARYING]
    if not all("pressure" in recording for recording in runs.values()):
        return
    model = experiment.models[PRESSURE if PRESSURE in study.training else OURS]
    experiment.models["force"] = load_of(model)
    rows: dict[str, list[float]] = {}
    for name in runs:
        force = study.scored(name, "force")
        estimated = study.scored(name, "force", "force")
        rows[name] = [rmse(force, estimated), float(np.ptp(force))]
    experiment.table("force", ["RMSE [N]", "range [N]"], rows)
    experiment.add_facts(force_percent=100 * rows[test][0] / rows[test][1])


def _track(study: Study, rig: Rig) -> None:
    """Add the tracking of a sine under the pulls of status 4, for every controller."""
    experiment, step, pulls = study.experiment, study.step, study.runs[study.statuses[VARYING]]
    seed, models = experiment.seed, experiment.models
    experiment.report(0.9, "closed loops")
    low, high = np.percentile(pulls["displacement"], (1, 99))
    middle, amplitude = round(0.53 * low + 0.47 * high), round(0.3 * (high - low))
    wave: Array = middle + amplitude * np.sin(0.2 * np.pi * pulls.time)
    reference = Recording({"displacement": wave, "force": pulls["force"].clip(0.0)}, step)
    unloaded = registry.load("estimators", "balance")(input=(study.drive,), scheduling=())
    unloaded.fit(study.runs[study.statuses[1]])
    inverse = models[OURS].inverse()
    controllers = {
        "inverse without force": unloaded.model_.inverse(),
        "inverse with force": inverse,
        "PID": tune_pid(rig, sample_time=step, scheduled={"force": 0.0}, seed=seed),
    }
    if "force" in models:
        controllers["inverse, estimated force"] = EstimatedLoad(
            BlockController(inverse), models["force"]
        )
    rows, errors = {}, {}
    drawn = {"reference": (pulls.time, wave)}
    for name, controller in controllers.items():
        tracked = track(controller, rig, reference, approach=10.0, settle=5.0, seed=seed)
        rows[name] = tracked.rmse["displacement"], tracked.largest["displacement"]
        displacement = tracked.recording["displacement"][-wave.size :]
        drawn[name], errors[name] = (pulls.time, displacement), (pulls.time, displacement - wave)
    facts = {"middle": middle, "amplitude": amplitude}
    experiment.table("tracked", ["RMSE [mm]", "largest [mm]"], rows, **facts)
    experiment.figure("tracked", {"displacement": drawn, "error": Axes(errors, "error")})
