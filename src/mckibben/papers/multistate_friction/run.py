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
    experiment.tell(0.42, "static laws")
    found = _hysteresis(runs, _static_laws(experiment, isometric))
    for model, name in experiment.steps(0.45, 0.65, [*CLOSED.items()]):
        of, settings = MODELS[model]
        fewer = {"n_refined": 4} if experiment.quick and model in FRICTIONS else {}
        closed = settings | FROM_FIRST_SAMPLE | fewer
        found.fitted[name] = experiment.fit(name, of, found.loop, closed)
        whole, rested = found.runs[found.chosen], closed | {"initial": "virgin"}
        found.fitted[model] = experiment.fit(model, of, whole, rested)
    _errors(experiment, found)
    experiment.tell(0.65, "how far parameters are determined")
    for key, model in (("friction", PAPERS), ("friction_ours", OURS))[: 2 - experiment.quick]:
        _parameters(experiment, key, model, found)
    _figures(experiment, isometric, found)
    _feedforward(experiment, found)


def _static_laws(experiment: Experiment, isometric: Sequence[Recording]) -> PolynomialForce:
    """Add errors of force laws on the isometric runs, and coefficients and forces of the paper's."""
    rows: dict[str, list[Cell]] = {}
    measured = np.concatenate([one["force"] for one in isometric])
    others = ("force-chou", "force-tondu", "force-petrovic", "force-minh", "force-schindele")
    for name in (LAW, *others)[: 1 if experiment.quick else None]:
        fit = experiment.fit(name, name, isometric)
        modelled = np.concatenate([experiment.simulate(name, one)["force"] for one in isometric])
        rows[full_name(name)] = [fit.rmse, score(measured, modelled).r2, fit.block.n_parameters]
    experiment.table("laws", ["RMSE [N]", "r²", "parameters"], rows)
    law = experiment.models[LAW]
    assert isinstance(law, PolynomialForce)
    top = max(float(one["pressure"].max()) for one in isometric)
    held = [round(float(one["length"].mean())) for one in isometric]
    names = ("a_1 [N/bar]", "a_3 [N/(bar mm)]", "a_0 [N]", "a_2 [N/mm]", "a_4 [N/mm^2]")
    both = [experiment.paper.printed("multistate-static-force"), law.unscaled()]
    cells = sorted(zip(names, *(one.pack().tolist() for one in both), strict=True))
    for bar in sorted({float(f"{share * top:.2g}") for share in (1 / 6, 2 / 3, 1.0)}):
        for length in (min(held), max(held)):
            forces = [float(np.dot((bar, 1.0), one.terms(np.array(length)))) for one in both]
            cells.append((f"force at {length} mm, {bar:g} bar [N]", *forces))
    experiment.table("static", ["printed", "here"], cells)
    return law


def _hysteresis(runs: Runs, law: PolynomialForce) -> Hysteresis:
    """Return the residual of the law in the isobaric runs, in the order of their pressures."""
    (chosen,) = runs.names("train", stage="friction")
    names = runs.names(stage="friction")
    names.sort(key=lambda name: (runs.of(name, "pressure"), name != chosen))
    rest = float(runs[chosen]["length"][0])
    found: dict[str, Recording] = {}
    for name, left in zip(names, extract_hysteresis([runs[n] for n in names], law), strict=True):
        bar, elongation = f"{runs.of(name, 'pressure'):.3g} bar", left["length"] - rest
        title = name if bar in found else bar
        found[title] = left.with_channels({ELONGATION: "mm"}, **{ELONGATION: elongation})
    title = f"{(level := float(runs.of(chosen, 'pressure'))):.3g} bar"
    # the first cycle begins at rest; from its end on the loop is closed
    whole, begun = found[title], cycles(-found[title]["length"])
    loop = whole.slice(begun[0].stop - 1, len(whole)) if len(begun) > 1 else whole
    return Hysteresis(law, found, title, level, loop, [one for one in found if one != title], {})


def _errors(experiment: Experiment, found: Hysteresis) -> None:
    """Add the errors of all models on the loop they are fitted to, and on all loops, best first."""
    rows: dict[str, list[Cell]] = {}
    errors = {STATIC: {title: rms(one[HYSTERESIS]) for title, one in found.runs.items()}}
    for model, name in CLOSED.items():
        modelled = experiment.simulate(name, found.loop)[HYSTERESIS]
        r2, fit = score(found.loop[HYSTERESIS], modelled).r2, found.fitted[name]
        rows[model] = [fit.n_free, fit.rmse, r2]
        free = {title: experiment.simulate(model, one) for title, one in found.runs.items()}
        errors[model] = {
            title: rms(free[title][HYSTERESIS] - one[HYSTERESIS])
            for title, one in found.runs.items()
        }
    experiment.table("closed", ["parameters", "RMSE [N]", "r²"], rows, at=found.chosen)
    left = {model: found.fitted[name].rmse for model, name in CLOSED.items()}
    closer = sum(own < min(left[PAPERS], left[OURS]) for own in left.values())
    r2s = {model: cells[-1] for model, cells in rows.items()}
    eleven_do = Verdict(left[PAPERS] < NEAR * left[EIGHTEEN])
    experiment.says(left=left, r2=r2s, closer=closer, n=len(left), eleven_do=eleven_do)
    worst: dict[str, float] = {
        model: max((own[t] / errors[STATIC][t] for t in found.unused), default=math.nan)
        for model, own in errors.items()
    }
    every = {
        n: [rows.get(n, [None])[0], *errors[n].values(), worst[n] if found.unused else None]
        for n in (STATIC, *sorted(MODELS, key=lambda model: worst[model]))
    }
    columns = ["parameters", *found.runs, "at most, of the static law's"]
    experiment.table("loops", columns, every, at=found.chosen)
    if found.unused:
        better = sum(own < min(worst[PAPERS], worst[OURS]) for own in worst.values())
        won = sum(errors[EIGHTEEN][title] < errors[PAPERS][title] for title in found.unused)
        experiment.says(worst=worst, better=better, won=won, unused=len(found.unused))


def _parameters(experiment: Experiment, key: str, model: str, found: Hysteresis) -> None:
    """Add the parameters of a friction model fitted to the closed loop, with standard errors."""
    fitted = found.fitted[CLOSED[model]]
    assert isinstance(fitted.block, MultistateFriction)
    friction, order = fitted.block.by_strength()
    errors = np.array(fitted.standard_errors)[order].tolist()
    printed = experiment.paper.printed("multistate-friction").values
    theirs = printed if model == PAPERS else [math.nan] * len(order)
    rows: dict[str, list[Cell]] = {
        name: [None if math.isnan(x) else x for x in numbers]
        for name, *numbers in zip(
            friction.parameter_names, theirs, friction.values, errors, strict=True
        )
    }
    experiment.table(key, ["printed", "here", "standard error"], rows, at=found.chosen)


def _figures(experiment: Experiment, isometric: Sequence[Recording], found: Hysteresis) -> None:
    """Add the runs, the extracted hysteresis, and the residuals of models."""
    length, extracted = found.loop["length"], found.loop[HYSTERESIS]
    modelled = {n: experiment.simulate(CLOSED[n], found.loop)[HYSTERESIS] for n in FRICTIONS}
    held = {f"{one['length'].mean():.0f} mm": one for one in isometric}
    forces = {title: (one["pressure"], one["force"]) for title, one in held.items()}
    laws: dict[str, Curves] = {}
    for title in [*held][:: max(1, (len(held) - 1) // 2)]:
        law = held[title]["pressure"], experiment.simulate(LAW, held[title])["force"]
        laws[title] = {held[title].origin: forces[title], "static law": law}
    searched = {name: found.fitted[CLOSED[name]].search for name in (PAPERS, EIGHTEEN)}
    costs = {name: np.minimum.accumulate(search) for name, search in searched.items()}
    steps = {name: np.cumsum(np.full(cost.size, EVERY)) for name, cost in costs.items()}
    stairs = {n: (np.repeat(steps[n], 2)[1:], np.repeat(cost, 2)[:-1]) for n, cost in costs.items()}
    experiment.says(near={n: steps[n][np.argmax(c < NEAR * c.min())] for n, c in costs.items()})
    total: dict[str, Curves] = {}
    for title, one in ((title, found.runs[title]) for title in found.unused):
        x, static = one["length"], one["force"] - one[HYSTERESIS]
        total[title] = {one.origin: (x, one["force"]), STATIC: (x, static)} | {
            n: (x, static + experiment.simulate(n, one)[HYSTERESIS]) for n in (PAPERS, OURS)
        }
    loops = {n: (r["length"], r["force"]) for n, r in found.runs.items() if n.endswith(" bar")}
    experiment.figure("isobaric", {"": loops})
    experiment.figure("isometric", {"": dict([*forces.items()][:: -(-len(forces) // 6)])})
    experiment.figure("law", laws)
    of_loop = {n: (length, force) for n, force in ({"extracted": extracted} | modelled).items()}
    experiment.figure("loop", {"": of_loop})
    experiment.figure("search", {name: {"": stair} for name, stair in stairs.items()})
    last = cycles(-length)[-1]
    left = {n: (length[last], (force - extracted)[last]) for n, force in modelled.items()}
    experiment.figure("left", {"": left})
    experiment.figure("unused", total)


STROKE, APPROACH, SWINGING = 0.8, 10.0, 7.0
"""Imposed motion, by that of the loop; time to the first force, and period of the sine [s]."""


def _feedforward(experiment: Experiment, found: Hysteresis) -> None:
    """Add forces tracked on the rig without feedback; references are ours, as the paper has none."""
    if experiment.rig is None:
        return
    law, (n, turns) = found.law, (1, 5) if experiment.quick else (3, 9)
    time = np.arange(round(10.0 * (turns - 1) / SAMPLE_TIME) + 1) * SAMPLE_TIME
    stroke = STROKE * float(np.ptp(found.loop["length"]))
    length = found.loop["length"].max() - irregular_triangle(time, turns, stroke, seed=7)
    static = [float((one["force"] - one[HYSTERESIS]).max()) for one in found.runs.values()]
    held = float(f"{max(static) / 4:.2g}")
    references = {
        f"static law at {found.chosen}": np.dot((found.bar, 1.0), law.terms(length)),
        f"{held:.0f} N": np.full(time.size, held),
        f"{held:.0f} N ± {held / 3:.0f} N": held * (1 + np.sin(2 * np.pi * time / SWINGING) / 3),
    }
    ways = {STATIC: ForceFeedforward(law)}
    for name in FRICTIONS[: max(n, 2)]:
        friction: Any = experiment.models[name]
        ways[name] = ForceFeedforward(law, replace(friction, output=law.outputs[0]))
    rows: list[list[Cell]] = []
    panels: dict[str, dict[str, tuple[Array, Array]]] = {}
    for title, force in [*references.items()][:n]:
        reference = Recording({"force": force, "length": length}, SAMPLE_TIME)
        panels[title] = {"reference": (length, force)}
        for name, way in ways.items():
            experiment.tell(0.75 + len(rows) / 48, f"feedforward of {title}")
            done = track(way, experiment.rig, reference, approach=APPROACH, seed=experiment.seed)
            missed = done.rmse["force"], done.largest["force"], float(done.clipped)
            rows.append([title, name, *missed])
            last = done.recording.slice(len(done.recording) - time.size, len(done.recording))
            panels[title][name] = last["length"], last["force"]
    columns = ["compensated by", "RMSE [N]", "largest [N]", "steps at a limit"]
    experiment.table("feedforward", columns, rows, stroke=stroke, at=found.chosen)
    experiment.figure("feedforward", dict([*panels.items()][:2]))
    experiment.says(tracked={str(row[1]): row[2] for row in rows[: len(ways)]})
