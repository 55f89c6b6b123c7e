"""Static force from isometric runs, friction from an isobaric loop, and feedforward with both."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.force.feedforward import ForceFeedforward
from mckibben.blocks.force.laws import PolynomialForce
from mckibben.blocks.force.multistate_friction import MultistateFriction
from mckibben.control import track
from mckibben.estimators.catalogue import full_name
from mckibben.estimators.force.multistate import extract_hysteresis
from mckibben.metrics import score
from mckibben.papers.experiment import Cell, Curves, Experiment, Fitted, Verdict, rms
from mckibben.papers.multistate_friction.protocol import SAMPLE_TIME
from mckibben.papers.recognising import Runs
from mckibben.recording import Recording
from mckibben.signals import cycles
from mckibben.signals.excitations import irregular_triangle

STATIC, LAW = "static law alone", "force-bilinear"
PAPERS, OURS, EIGHTEEN = "11 parameters, the paper's", "11 parameters, ours", "18 parameters"
LITERAL = "11 parameters, Eq. (5) to the letter"
HYSTERESIS, ELONGATION = "force_hysteresis", "elongation"
"""What a static law leaves of the force [N], and the length beyond that at rest [mm], where models start
that are at rest at 0."""

LINE: dict[str, Any] = {"input": ELONGATION, "degree": 1}
"""A straight line as the reversible part: a polynomial is wild at lengths that were not in the data."""

SIGNED: dict[str, Any] = {"input": ELONGATION, "n_operators": 39, "nonnegative": False}
MODELS: Mapping[str, tuple[str, dict[str, Any]]] = {
    PAPERS: ("multistate-11", {"static": None}),
    LITERAL: ("multistate-11", {"static": None, "elements": "eleven-released"}),
    OURS: ("multistate", {"static": None}),
    EIGHTEEN: ("multistate-18", {"static": None}),
    "modified Maxwell-slip": ("mms", LINE | {"n_operators": 38}),
    "modified PI": ("mpi", {"input": ELONGATION, "n_operators": 34}),
    "PI with weights of either sign": ("pi", SIGNED),
    "generalized Bouc-Wen": ("gbw", LINE),
    "Maxwell-slip": ("maxwell-slip", LINE),
    "Bouc-Wen": ("bouc-wen", LINE),
    "Duhem": ("duhem", LINE),
}
"""Estimators of the hysteresis and their settings: the paper's sizes, where it gives one."""

FROM_FIRST_SAMPLE: dict[str, Any] = {"output": HYSTERESIS, "initial": "first_sample"}
"""Settings of models that begin within a motion."""

EVERY, NEAR = 16.0, 1.05
"""Number of evaluations between reports of a search; ratio of errors that counts as no difference."""

FRICTIONS = (PAPERS, OURS, EIGHTEEN)
CLOSED = {model: f"{model}, closed loop" for model in MODELS}
"""Names of the models that are fitted to the closed loop."""


class Hysteresis(NamedTuple):
    """Isobaric runs by title with the law's residual, and the fits to one of them and its loop."""

    law: PolynomialForce
    runs: dict[str, Recording]
    chosen: str
    bar: float
    loop: Recording
    unused: list[str]
    fitted: dict[str, Fitted]


def run(experiment: Experiment) -> None:
    """Record isometric and isobaric runs, and identify force laws and friction."""
    runs = experiment.record(until=0.4, loops=0.75)
    isometric = runs.select(stage="static")
    experiment.report(0.42, "static laws")
    isobaric = _hysteresis(runs, _static_laws(experiment, isometric))
    for model, name in experiment.steps(0.45, 0.65, [*CLOSED.items()]):
        model_name, settings = MODELS[model]
        quick_settings = {"n_refined": 4} if experiment.quick and model in FRICTIONS else {}
        loop_settings = settings | FROM_FIRST_SAMPLE | quick_settings
        isobaric.fitted[name] = experiment.fit(name, model_name, isobaric.loop, loop_settings)
        run_at_level = isobaric.runs[isobaric.chosen]
        rest_settings = loop_settings | {"initial": "virgin"}
        isobaric.fitted[model] = experiment.fit(model, model_name, run_at_level, rest_settings)
    _errors(experiment, isobaric)
    experiment.report(0.65, "how far parameters are determined")
    for key, model in (("friction", PAPERS), ("friction_ours", OURS))[: 2 - experiment.quick]:
        _parameters(experiment, key, model, isobaric)
    _figures(experiment, isometric, isobaric)
    _feedforward(experiment, isobaric)


def _static_laws(experiment: Experiment, isometric: Sequence[Recording]) -> PolynomialForce:
    """Add errors of force laws on the isometric runs, and coefficients and forces of the paper's."""
    rows: dict[str, list[Cell]] = {}
    measured = np.concatenate([run["force"] for run in isometric])
    others = ("force-chou", "force-tondu", "force-petrovic", "force-minh", "force-schindele")
    for name in (LAW, *others)[: 1 if experiment.quick else None]:
        fit = experiment.fit(name, name, isometric)
        modelled = np.concatenate([experiment.simulate(name, run)["force"] for run in isometric])
        rows[full_name(name)] = [fit.rmse, score(measured, modelled).r2, fit.block.n_parameters]
    experiment.table("laws", ["RMSE [N]", "r²", "parameters"], rows)
    law = experiment.models[LAW]
    assert isinstance(law, PolynomialForce)
    top = max(float(run["pressure"].max()) for run in isometric)
    lengths = [round(float(run["length"].mean())) for run in isometric]
    names = ("a_1 [N/bar]", "a_3 [N/(bar mm)]", "a_0 [N]", "a_2 [N/mm]", "a_4 [N/mm^2]")
    laws = [experiment.paper.printed("multistate-static-force"), law.unscaled()]
    cells = sorted(zip(names, *(each.pack().tolist() for each in laws), strict=True))
    for bar in sorted({float(f"{share * top:.2g}") for share in (1 / 6, 2 / 3, 1.0)}):
        for length in (min(lengths), max(lengths)):
            forces = [float(np.dot((bar, 1.0), each.terms(np.array(length)))) for each in laws]
            cells.append((f"force at {length} mm, {bar:g} bar [N]", *forces))
    experiment.table("static", ["printed", "here"], cells)
    return law


def _hysteresis(runs: Runs, law: PolynomialForce) -> Hysteresis:
    """Return the residual of the law in the isobaric runs, in the order of their pressures."""
    (chosen,) = runs.names("train", stage="friction")
    names = runs.names(stage="friction")
    names.sort(key=lambda name: (runs.of(name, "pressure"), name != chosen))
    start = float(runs[chosen]["length"][0])
    residuals: dict[str, Recording] = {}
    for name, residual in zip(
        names, extract_hysteresis([runs[n] for n in names], law), strict=True
    ):
        bar, elongation = f"{runs.of(name, 'pressure'):.3g} bar", residual["length"] - start
        title = name if bar in residuals else bar
        residuals[title] = residual.with_channels({ELONGATION: "mm"}, **{ELONGATION: elongation})
    title = f"{(level := float(runs.of(chosen, 'pressure'))):.3g} bar"
    # the first cycle begins at rest; from its end on the loop is closed
    free, parts = residuals[title], cycles(-residuals[title]["length"])
    loop = free.slice(parts[0].stop - 1, len(free)) if len(parts) > 1 else free
    return Hysteresis(
        law, residuals, title, level, loop, [other for other in residuals if other != title], {}
    )


def _errors(experiment: Experiment, isobaric: Hysteresis) -> None:
    """Add the errors of all models on the loop they are fitted to, and on all loops, best first."""
    rows: dict[str, list[Cell]] = {}
    errors = {STATIC: {title: rms(run[HYSTERESIS]) for title, run in isobaric.runs.items()}}
    for model, name in CLOSED.items():
        modelled = experiment.simulate(name, isobaric.loop)[HYSTERESIS]
        r2, fitted = score(isobaric.loop[HYSTERESIS], modelled).r2, isobaric.fitted[name]
        rows[model] = [fitted.n_free, fitted.rmse, r2]
        free_runs = {title: experiment.simulate(model, run) for title, run in isobaric.runs.items()}
        errors[model] = {
            title: rms(free_runs[title][HYSTERESIS] - run[HYSTERESIS])
            for title, run in isobaric.runs.items()
        }
    experiment.table("closed", ["parameters", "RMSE [N]", "r²"], rows, at=isobaric.chosen)
    loop_rmse = {model: isobaric.fitted[name].rmse for model, name in CLOSED.items()}
    closer = sum(rmse < min(loop_rmse[PAPERS], loop_rmse[OURS]) for rmse in loop_rmse.values())
    r2s = {model: cells[-1] for model, cells in rows.items()}
    eleven_do = Verdict(loop_rmse[PAPERS] < NEAR * loop_rmse[EIGHTEEN])
    experiment.add_facts(
        left=loop_rmse, r2=r2s, closer=closer, n=len(loop_rmse), eleven_do=eleven_do
    )
    worst: dict[str, float] = {
        model: max((rms_by_title[t] / errors[STATIC][t] for t in isobaric.unused), default=math.nan)
        for model, rms_by_title in errors.items()
    }
    rows_by_error = {
        n: [rows.get(n, [None])[0], *errors[n].values(), worst[n] if isobaric.unused else None]
        for n in (STATIC, *sorted(MODELS, key=lambda model: worst[model]))
    }
    columns = ["parameters", *isobaric.runs, "at most, of the static law's"]
    experiment.table("loops", columns, rows_by_error, at=isobaric.chosen)
    if isobaric.unused:
        better = sum(ratio < min(worst[PAPERS], worst[OURS]) for ratio in worst.values())
        n_won = sum(errors[EIGHTEEN][title] < errors[PAPERS][title] for title in isobaric.unused)
        experiment.add_facts(worst=worst, better=better, won=n_won, unused=len(isobaric.unused))


def _parameters(experiment: Experiment, key: str, model: str, isobaric: Hysteresis) -> None:
    """Add the parameters of a friction model fitted to the closed loop, with standard errors."""
    fitted = isobaric.fitted[CLOSED[model]]
    assert isinstance(fitted.block, MultistateFriction)
    friction, order = fitted.block.by_strength()
    errors = np.array(fitted.standard_errors)[order].tolist()
    printed = experiment.paper.printed("multistate-friction").values
    printed_values = printed if model == PAPERS else [math.nan] * len(order)
    rows: dict[str, list[Cell]] = {
        name: [None if math.isnan(value) else value for value in numbers]
        for name, *numbers in zip(
            friction.parameter_names, printed_values, friction.values, errors, strict=True
        )
    }
    experiment.table(key, ["printed", "here", "standard error"], rows, at=isobaric.chosen)


def _figures(experiment: Experiment, isometric: Sequence[Recording], isobaric: Hysteresis) -> None:
    """Add the runs, the extracted hysteresis, and the residuals of models."""
    length, extracted = isobaric.loop["length"], isobaric.loop[HYSTERESIS]
    modelled = {n: experiment.simulate(CLOSED[n], isobaric.loop)[HYSTERESIS] for n in FRICTIONS}
    by_length = {f"{run['length'].mean():.0f} mm": run for run in isometric}
    forces = {title: (run["pressure"], run["force"]) for title, run in by_length.items()}
    laws: dict[str, Curves] = {}
    for title in [*by_length][:: max(1, (len(by_length) - 1) // 2)]:
        law = by_length[title]["pressure"], experiment.simulate(LAW, by_length[title])["force"]
        laws[title] = {by_length[title].origin: forces[title], "static law": law}
    searched = {name: isobaric.fitted[CLOSED[name]].search for name in (PAPERS, EIGHTEEN)}
    costs = {name: np.minimum.accumulate(search) for name, search in searched.items()}
    steps = {name: np.cumsum(np.full(cost.size, EVERY)) for name, cost in costs.items()}
    stairs = {n: (np.repeat(steps[n], 2)[1:], np.repeat(cost, 2)[:-1]) for n, cost in costs.items()}
    experiment.add_facts(
        near={n: steps[n][np.argmax(c < NEAR * c.min())] for n, c in costs.items()}
    )
    unused_panels: dict[str, Curves] = {}
    for title, run in ((title, isobaric.runs[title]) for title in isobaric.unused):
        x, static = run["length"], run["force"] - run[HYSTERESIS]
        unused_panels[title] = {run.origin: (x, run["force"]), STATIC: (x, static)} | {
            n: (x, static + experiment.simulate(n, run)[HYSTERESIS]) for n in (PAPERS, OURS)
        }
    loops = {n: (r["length"], r["force"]) for n, r in isobaric.runs.items() if n.endswith(" bar")}
    experiment.figure("isobaric", {"": loops})
    experiment.figure("isometric", {"": dict([*forces.items()][:: -(-len(forces) // 6)])})
    experiment.figure("law", laws)
    of_loop = {n: (length, force) for n, force in ({"extracted": extracted} | modelled).items()}
    experiment.figure("loop", {"": of_loop})
    experiment.figure("search", {name: {"": stair} for name, stair in stairs.items()})
    last = cycles(-length)[-1]
    last_residuals = {n: (length[last], (force - extracted)[last]) for n, force in modelled.items()}
    experiment.figure("left", {"": last_residuals})
    experiment.figure("unused", unused_panels)


STROKE, APPROACH, SWINGING = 0.8, 10.0, 7.0
"""Imposed motion, by that of the loop; time to the first force, and period of the sine [s]."""


def _feedforward(experiment: Experiment, isobaric: Hysteresis) -> None:
    """Add forces tracked on the rig without feedback; references are ours, as the paper has none."""
    if experiment.rig is None:
        return
    law, (n_references, n_turns) = isobaric.law, (1, 5) if experiment.quick else (3, 9)
    time = np.arange(round(10.0 * (n_turns - 1) / SAMPLE_TIME) + 1) * SAMPLE_TIME
    stroke = STROKE * float(np.ptp(isobaric.loop["length"]))
    length = isobaric.loop["length"].max() - irregular_triangle(time, n_turns, stroke, seed=7)
    static = [float((run["force"] - run[HYSTERESIS]).max()) for run in isobaric.runs.values()]
    level = float(f"{max(static) / 4:.2g}")
    references = {
        f"static law at {isobaric.chosen}": np.dot((isobaric.bar, 1.0), law.terms(length)),
        f"{level:.0f} N": np.full(time.size, level),
        f"{level:.0f} N ± {level / 3:.0f} N": level * (1 + np.sin(2 * np.pi * time / SWINGING) / 3),
    }
    inverses = {STATIC: ForceFeedforward(law)}
    for name in FRICTIONS[: max(n_references, 2)]:
        friction: Any = experiment.models[name]
        inverses[name] = ForceFeedforward(law, replace(friction, output=law.outputs[0]))
    rows: list[list[Cell]] = []
    panels: dict[str, dict[str, tuple[Array, Array]]] = {}
    for title, force in [*references.items()][:n_references]:
        reference = Recording({"force": force, "length": length}, SAMPLE_TIME)
        panels[title] = {"reference": (length, force)}
        for name, inverse in inverses.items():
            experiment.report(0.75 + len(rows) / 48, f"feedforward of {title}")
            tracked = track(
                inverse, experiment.rig, reference, approach=APPROACH, seed=experiment.seed
            )
            errors = tracked.rmse["force"], tracked.largest["force"], float(tracked.clipped)
            rows.append([title, name, *errors])
            last = tracked.recording.slice(
                len(tracked.recording) - time.size, len(tracked.recording)
            )
            panels[title][name] = last["length"], last["force"]
    columns = ["compensated by", "RMSE [N]", "largest [N]", "steps at a limit"]
    experiment.table("feedforward", columns, rows, stroke=stroke, at=isobaric.chosen)
    experiment.figure("feedforward", dict([*panels.items()][:2]))
    experiment.add_facts(tracked={str(row[1]): row[2] for row in rows[: len(inverses)]})
