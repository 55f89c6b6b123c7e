"""Coupled hysteresis of a soft arm: motion, predictions of models, and errors of their inverses."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.channels import by_name
from mckibben.metrics import err, loop_width, rmse
from mckibben.papers.experiment import Axes, Cell, Experiment, Fitted, Verdict, rms
from mckibben.papers.recognising import Runs
from mckibben.papers.sdchm import loops
from mckibben.papers.sdchm.loops import BALANCE, OURS, PUBLISHED
from mckibben.papers.sdchm.protocol import PATTERNS, quick
from mckibben.recording import Recording
from mckibben.signals import cycles

LINEAR, MEMORY, TOO = "linear function of the pressures", "coupled memory", ", joint runs too"
RAW, DAMPED = "raw network, as published", "raw network, damped"
PREDICTING = (LINEAR, RAW, DAMPED, PUBLISHED, OURS, MEMORY, BALANCE, OURS + TOO, BALANCE + TOO)
GROUPS = (PUBLISHED, RAW, OURS, BALANCE)
SIZES = (5, 10, 15, 20)
SEEDS = 3
"""Models that predict, and those whose errors are listed by group; orders N of Table 2; seeds of each
particle swarm, of which the best on the validation patterns is taken."""

PAPERS: dict[str, Any] = {"threshold_rule": "paper", "initial": "virgin"}
LETTERS = dict(zip(product(PATTERNS, "123"), "abcdefghijkl", strict=True))
"""The paper's settings of a muscle's hysteresis; its groups, by muscles driven and output."""

SETS: dict[str, dict[str, str]] = {
    "constant": {"stage": "joint", "extensor": "constant"},
    "moving": {"stage": "joint", "extensor": "moving"},
    "along": {"stage": "network"},
}
"""Runs that test, by the table of their errors."""

Panels = dict[str, dict[str, tuple[Array, Array]]]


def run(experiment: Experiment) -> None:
    """Record the patterns, identify the coupled models, predict, and track with their inverses."""
    runs = experiment.record(*(quick(experiment.rig) if experiment.quick else ()), loops=0.7)
    for part in (_motions, _orders, _fits, _parts, _sets, _groups):
        part(experiment, runs)
    if experiment.rig is not None:
        experiment.report(0.7, "closed loops")
        loops.run_loops(experiment, experiment.rig, runs)


def by_group(runs: Runs, names: Sequence[str]) -> Iterator[tuple[str, str, Array, Recording, str]]:
    """Yield every output of runs by the muscles driven: run, group, pressure, recording, output."""
    for name in sorted(names, key=lambda n: (runs.of(n, "p0"), len(runs.of(n, "driven")), n)):
        recording, driven = runs[name], runs.of(name, "driven")
        for output in by_name([recording])[1]:
            k = output.rpartition("_")[2]
            letter = f"({LETTERS[driven, k]}) " if (driven, k) in LETTERS else ""
            group = f"{letter}{' '.join(f'p{i}' for i in driven)}, y{k}"
            pressure = recording[f"pressure_{k if k in driven else driven[0]}"]
            yield name, group, pressure, recording, output


def _width(u: Array, y: Array) -> list[Cell]:
    """Return e_w over the last cycle of a pressure [%], and the range of the output over it [mm]."""
    *_, last = cycles(u) or [slice(0, len(u))]
    span = float(np.ptp(y[last]))
    return [loop_width(u[last], y[last]) if span and cycles(u) else None, span]


def _motions(experiment: Experiment, runs: Runs) -> None:
    """Add the motion of the arm: by pattern, Figure 4, and by the extensor's pressure, Figure 5."""
    all_names = runs.names(stage="hysteresis") + runs.names(stage="network")
    patterns, alone = (runs.names(stage=key) or all_names for key in ("coupling", "stiffness"))
    levels = sorted({float(runs.of(name, "p0")) for name in patterns})
    middle, first = levels[len(levels) // 2], min(runs.of(name, "driven") for name in alone)
    names_by_table = {
        "coupling": [name for name in patterns if runs.of(name, "p0") == middle],
        "stiffness": [name for name in alone if runs.of(name, "driven") == first],
    }
    widths: list[float] = []
    for key, names in names_by_table.items():
        rows: dict[str, list[Cell]] = {}
        panels: Panels = {}
        for name, group, u, recording, output in by_group(runs, names):
            level, y = f"{runs.of(name, 'p0'):g} bar", recording[output]
            by_level = key == "stiffness"
            row = rows[f"{level}, y{output[-1]}" if by_level else group] = _width(u, y)
            widths += [float(cell) for cell in row[:1] if cell is not None]
            curves = panels.setdefault(f"y{output[-1]}" if by_level else group, {})
            curves[level if by_level else recording.origin] = u, y
        experiment.table(key, ["e_w [%]", "range [mm]"], rows, p0=middle, driven=first[0])
        experiment.figure(key, panels)
    if widths:
        experiment.add_facts(narrowest=min(widths), widest=max(widths))


def _orders(experiment: Experiment, runs: Runs) -> None:
    """Add the errors of one muscle's hysteresis by the number of operators: Table 2."""
    name, *_ = runs.names("train", stage="hysteresis")
    recording, k = runs[name], runs.of(name, "driven")
    orders: dict[str, list[Cell]] = {}
    for n in (10,) if experiment.quick else SIZES:
        for settings in (PAPERS, {"threshold_rule": "envelope", "initial": "first_sample"}):
            y, name = f"displacement_{k}", f"GPI {n}, {settings['threshold_rule']}"
            gpi_settings = settings | {"input": f"pressure_{k}", "output": y, "n_operators": n}
            fitted = experiment.fit(name, "gpi", recording, gpi_settings)
            error = err(recording[y], experiment.simulate(name, recording)[y])
            orders.setdefault(str(n), []).append(error)
        orders[str(n)].append(fitted.n_free)
    columns = ["Err [%]", "Err, thresholds over the envelopes [%]", "parameters"]
    experiment.table("orders", columns, orders, muscle=k)


def learners(short: bool) -> dict[str, tuple[str, dict[str, Any]]]:
    """Return all coupled models with their estimators and settings, for a quick run or a full one."""
    search: dict[str, Any] = {"search_samples": loops.QUICK_SAMPLES} if short else {}
    swarm: dict[str, Any] = search | loops.QUICK_SWARM if short else {}
    starts: dict[str, Any] = {"n_starts": 4, "n_refined": 1} if short else {}
    ours = search | ({"memory_settings": starts, "n_rounds": 1} if short else {})
    return {
        LINEAR: ("tsfnn", {"n_sets": 1, "constants": True, "method": "ls"}),
        RAW: ("tsfnn", {"method": "pso", "ridge": 1e-9} | swarm),
        DAMPED: ("tsfnn", search),
        PUBLISHED: ("sdchm-published", {"memory_settings": PAPERS | starts} | swarm),
        loops.INDIVIDUAL: ("coupled-pi", {"memory_settings": PAPERS | starts}),
        OURS: ("sdchm", ours),
        MEMORY: ("coupled-memory", {}),
        BALANCE: ("balance", {}),
    }


def _fits(experiment: Experiment, runs: Runs) -> None:
    """Fit all models; validation patterns stop the search for antecedents of ours."""
    models, joint = learners(experiment.quick), runs.select("train", stage="joint")
    models |= {name + TOO: models[name] for name in (OURS, BALANCE) if joint}
    stages = ("hysteresis", "network")
    patterns = [run for stage in stages for run in runs.select("train", stage=stage)]
    sets = [runs.select(role, stage="network") for role in ("validation", "test")]
    rows: dict[str, list[Cell]] = {}
    seed_rows: list[list[Cell]] = []
    for name, (model, changes) in experiment.steps(0.32, 0.7, [*models.items()]):
        train = patterns + (joint if name.endswith(TOO) else [])
        searched = name in (RAW, PUBLISHED) and all(sets) and not experiment.quick
        fits: dict[float, Fitted] = {}
        for seed in range(experiment.seed, experiment.seed + (SEEDS if searched else 1)):
            label, settings = f"{name}, seed {seed}", changes | {"seed": seed}
            fitted = experiment.fit(label, model, train, settings)
            errors = (
                [rms(_output_errors(experiment, label, recordings)) for recordings in sets]
                if searched
                else [0.0]
            )
            fits[errors[0]] = fitted
            seed_rows += [[name, seed, *errors]] if searched else []
        best = fits[min(fits)]
        experiment.models[name] = best.block
        rows[name] = [best.seconds, best.n_free]
    experiment.table("identification", ["time [s]", "parameters"], rows)
    if seed_rows:
        experiment.table("seeds", ["seed", "validation RMSE [mm]", "test RMSE [mm]"], seed_rows)


def _parts(experiment: Experiment, runs: Runs) -> None:
    """Add the parts of the paper's model: hysteresis, Figure 9, and coupling gains, Table 3."""
    published: Any = experiment.models[PUBLISHED]
    hysteresis, coupling, _ = published.parts
    panels: dict[str, Axes] = {}
    errors: dict[str, Axes] = {}
    for name in runs.names("train", stage="hysteresis"):
        recording, k = runs[name], runs.of(name, "driven")
        u, y = recording[f"pressure_{k}"], recording[f"displacement_{k}"]
        modelled = np.asarray(hysteresis.parts[int(k) - 1].simulate(u))
        panels[f"GPI {k}"] = Axes({recording.origin: (u, y), "GPI": (u, modelled)})
        errors[f"GPI {k}: error"] = Axes({"error": (u, modelled - y)}, "error")
    experiment.figure("hysteresis", panels | errors)
    entries = np.ndenumerate(coupling.matrix)
    gains = {f"G{i + 1}{j + 1}": [float(gain)] for (i, j), gain in entries if i != j}
    radii = {"printed": experiment.paper.printed("sdchm-coupling").radius, "here": coupling.radius}
    experiment.table("gains", ["gain"], gains, **radii)
    ends = [f(*gains.values())[0] for f in (min, max)]
    converges = Verdict(coupling.radius < 1)
    experiment.add_facts(gains=ends, radius=coupling.radius, converges=converges)


def _output_errors(experiment: Experiment, name: str, runs: Sequence[Recording]) -> Array:
    """Return modelled minus measured outputs over all recordings, shape (n, outputs) [mm]."""
    outputs = by_name(runs)[1]
    pairs = ((experiment.simulate(name, run), run) for run in runs)
    return np.concatenate([model.matrix(outputs) - run.matrix(outputs) for model, run in pairs])


def _sets(experiment: Experiment, runs: Runs) -> None:
    """Add the errors on test runs: all pressures random at once, and along the patterns."""
    names = [name for name in PREDICTING if name in experiment.models]
    validation_ = runs.select("validation", stage="joint") or runs.select("validation")
    best = min(
        (OURS, BALANCE),
        key=lambda n: rms(_output_errors(experiment, n, validation_ or runs.select("train"))),
    )
    for kind, labels in SETS.items():
        test, validation = (runs.select(role, **labels) for role in ("test", "validation"))
        if not test:
            continue
        outputs = by_name(test)[1]
        y = np.concatenate([first.matrix(outputs) for first in test])
        y = y - y.mean(axis=0)
        rows: dict[str, list[Cell]] = {}
        size: dict[str, float] = {}
        for name in names:
            errors = _output_errors(experiment, name, test)
            rmses, size[name] = np.sqrt(np.mean(errors**2, axis=0)), rms(errors)
            worst = float(100 * np.max(rmses / np.ptp(y, axis=0)))
            largest, share = float(np.abs(errors).max()), err(y.ravel(), (y + errors).ravel())
            held_rmse = rms(_output_errors(experiment, name, validation)) if validation else None
            rows[name] = [*rmses.tolist(), worst, largest, share, held_rmse]
        columns = [f"RMSE of y{output[-1]} [mm]" for output in outputs]
        columns += ["worst RMSE of range [%]", "largest error [mm]", "Err [%]"]
        levels = sorted({f"{runs.of(name, 'p0'):g}" for name in runs.names("test", **labels)})
        facts: dict[str, Any] = {"n": len(test), "samples": len(y), "levels": ", ".join(levels)}
        facts["covered"] = ", ".join(f"{span:.0f}" for span in np.ptp(y, axis=0))
        experiment.table(kind, [*columns, "validation runs, RMSE [mm]"], rows, **facts)
        (first, *_), output = test, outputs[0]
        curves = {n: experiment.simulate(n, first)[output] for n in (LINEAR, OURS, BALANCE)}
        curves = {first.origin: first[output]} | curves
        experiment.figure(kind, {str(first.name): {n: (first.time, z) for n, z in curves.items()}})
        failing = [f"{n} ({size[n]:.1f} mm)" for n in names if size[n] > size[LINEAR]]
        facts = {"best": size[best], "worst": rows[best][len(outputs)], "linear": size[LINEAR]}
        facts["other"] = size[BALANCE if best == OURS else OURS]
        facts["all"] = ", ".join(f"{name} {value:.2f} mm" for name, value in size.items())
        facts |= {"failing": ", ".join(failing)} if failing else {}
        experiment.add_facts(best=best, on="validation" if validation_ else "training")
        experiment.add_facts(**{f"{kind}_{name}": value for name, value in facts.items()})


def _groups(experiment: Experiment, runs: Runs) -> None:
    """Add the errors by group: Table 4, Figures 10 and 11."""
    names = runs.names(stage="prediction") or runs.names("test", stage="network")
    levels: dict[str, list[Cell]] = {}
    groups: dict[str, list[Cell]] = {}
    panels: Panels = {}
    for name, group, u, recording, output in by_group(runs, names):
        y, p0 = recording[output], runs.of(name, "p0")
        predictions = {model: experiment.simulate(model, recording)[output] for model in GROUPS}
        sizes = [rmse(y, z) for z in predictions.values()]
        levels[f"{p0:g} bar, {group}"] = [*sizes]
        if p0 == min(runs.of(n, "p0") for n in names):
            groups[group] = [*(err(y, z) for z in predictions.values()), *sizes]
            panels[group] = {recording.origin: (u, y)} | {
                n: (u, predictions[n]) for n in GROUPS[:3]
            }
    if groups:
        columns = [f"{what}, {name}" for what in ("Err [%]", "RMSE [mm]") for name in GROUPS]
        experiment.table("groups", columns, groups, p0=min(runs.of(n, "p0") for n in names))
        experiment.figure("prediction", panels)
        experiment.table("levels", GROUPS, levels)
        _compare_with_table_4(experiment, groups)


def _compare_with_table_4(experiment: Experiment, groups: dict[str, list[Cell]]) -> None:
    """Set how the paper's models compare in Table 4, and how large the Err of SDCHM is."""
    published_column, raw_column = (GROUPS.index(name) for name in (PUBLISHED, RAW))
    errs: Any = [row[published_column] for row in groups.values()]
    closer = sum(row[published_column] < row[raw_column] for row in groups.values())  # type: ignore[operator]
    printed = experiment.paper.tables["groups"].printed[f"Err [%], {PUBLISHED}"].values()
    experiment.add_facts(
        predicted=[min(errs), max(errs)],
        predicted_theirs=[min(printed), max(printed)],
        as_small=Verdict(max(errs) <= max(printed)),
        closer=closer,
        n_groups=len(groups),
        closer_in_all=Verdict(closer == len(groups)),
    )
