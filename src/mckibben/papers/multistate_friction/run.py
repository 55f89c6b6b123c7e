"""Static force from isometric runs, friction from an isobaric loop, and feedforward with both."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from mckibben import registry
from mckibben.arrays import Array
from mckibben.blocks.force.feedforward import ForceFeedforward
from mckibben.blocks.force.laws import PolynomialForce
from mckibben.blocks.force.multistate_friction import MultistateFriction
from mckibben.control import track
from mckibben.errors import DataError
from mckibben.estimators.catalogue import full_name
from mckibben.estimators.core.ranges import parameter_ranges
from mckibben.estimators.force.multistate import extract_hysteresis
from mckibben.metrics import score
from mckibben.papers.experiment import Cell, Curves, Experiment, Fitted, Labels, Rerun, Runs, rms
from mckibben.papers.multistate_friction.printed import multistate_friction as printed_friction
from mckibben.papers.multistate_friction.printed import static_force as printed_law
from mckibben.papers.multistate_friction.protocol import SAMPLE_TIME
from mckibben.recording import Recording
from mckibben.signals import cycles
from mckibben.signals.excitations import irregular_triangle
from mckibben.signals.protocol import Role

LAW = "force-bilinear"
LAWS = (LAW, "force-chou", "force-tondu", "force-petrovic", "force-minh", "force-schindele")
"""Estimators of static laws, the paper's first."""

STATIC = "static law alone"
PAPERS, OURS, EIGHTEEN = "11 parameters, the paper's", "11 parameters, ours", "18 parameters"
HYSTERESIS, ELONGATION = "force_hysteresis", "elongation"
"""What a static law leaves of the force [N], and the length beyond that at rest [mm], where models start
that are at rest at 0."""

REST = {"input": ELONGATION}
LINE = {"input": ELONGATION, "degree": 1}
"""A straight line as the reversible part: a polynomial is wild at lengths that were not in the data."""

MODELS: Mapping[str, tuple[str, dict[str, Any]]] = {
    PAPERS: ("multistate-11", {"static": None}),
    OURS: ("multistate", {"static": None}),
    EIGHTEEN: ("multistate-18", {"static": None}),
    "modified Maxwell-slip": ("mms", LINE | {"n_operators": 38}),
    "modified PI": ("mpi", REST | {"n_operators": 33}),
    "PI with weights of either sign": ("pi", REST | {"n_operators": 39, "nonnegative": False}),
    "generalised Bouc-Wen": ("gbw", LINE),
    "Maxwell-slip": ("maxwell-slip", LINE),
    "Bouc-Wen": ("bouc-wen", LINE),
    "Duhem": ("duhem", LINE),
}
"""Estimators of the hysteresis and their settings: the paper's sizes, where it gives one."""

FRICTIONS = (PAPERS, OURS, EIGHTEEN)
CLOSED = {model: f"{model}, closed loop" for model in MODELS}
"""Names of the models that are fitted to the closed loop."""


class Hysteresis(NamedTuple):
    """Isobaric runs by title with what the law leaves, and the fits to one of them and to its loop."""

    law: PolynomialForce
    runs: dict[str, Recording]
    chosen: str
    bar: float
    loop: Recording
    unused: list[str]
    fitted: dict[str, Fitted]


def run(experiment: Experiment) -> None:
    """Record isometric and isobaric runs, and identify force laws and friction."""
    runs = experiment.record(until=0.4)
    isometric = runs.select(stage="static")
    experiment.tell(0.42, "static laws")
    found = _hysteresis(runs, _static_laws(experiment, isometric))
    experiment.tell(0.45, "friction")
    for model, name in CLOSED.items():
        fewer = {"n_refined": 4} if experiment.quick and model in FRICTIONS else {}
        closed = _estimator(model, experiment.seed, **fewer)
        found.fitted[name] = experiment.fit(name, closed, found.loop)
        rested = replace(closed, initial="virgin")
        found.fitted[model] = experiment.fit(model, rested, found.runs[found.chosen])
    _errors(experiment, found)
    experiment.tell(0.65, "how far parameters are determined")
    for key, model in (("friction", PAPERS), ("friction_ours", OURS))[: 2 - experiment.quick]:
        _parameters(experiment, key, model, found)
    _figures(experiment, isometric, found)
    _feedforward(experiment, found)


def _estimator(model: str, seed: int, **how: Any) -> Any:
    name, settings = MODELS[model]
    given = {"output": HYSTERESIS, "seed": seed, "initial": "first_sample"}
    return registry.load("estimators", name)(**given, **settings, **how)


def _static_laws(experiment: Experiment, isometric: Sequence[Recording]) -> PolynomialForce:
    """Add errors of force laws on the isometric runs, and coefficients and forces of the paper's."""
    rows: dict[str, list[Cell]] = {}
    measured = np.concatenate([one["force"] for one in isometric])
    for name in LAWS[: 1 if experiment.quick else None]:
        estimator = registry.load("estimators", name)(seed=experiment.seed)
        fit = experiment.fit(name, estimator, isometric)
        modelled = np.concatenate([experiment.simulate(name, one)["force"] for one in isometric])
        rows[full_name(name)] = [fit.rmse, score(measured, modelled).r2, fit.block.n_parameters]
    experiment.table("laws", ["RMSE [N]", "r²", "parameters"], rows)
    law = experiment.models[LAW]
    assert isinstance(law, PolynomialForce)
    top = max(float(one["pressure"].max()) for one in isometric)
    held = [round(float(one["length"].mean())) for one in isometric]
    lengths = np.array([min(held), max(held)], dtype=float)
    names = ("a_1 [N/bar]", "a_3 [N/(bar mm)]", "a_0 [N]", "a_2 [N/mm]", "a_4 [N/mm^2]")
    both: list[dict[str, float]] = []
    for each in (printed_law(), law.unscaled()):
        both.append(dict(sorted(zip(names, each.pack().tolist(), strict=True))))
        per_bar, rest = each.terms(lengths)
        for bar in sorted({float(round(share * top)) for share in (1 / 6, 2 / 3, 1.0)}):
            for length, force in zip(lengths, bar * per_bar + rest, strict=True):
                both[-1][f"force at {length:g} mm, {bar:g} bar [N]"] = float(force)
    cells = {name: [one[name] for one in both] for name in both[0]}
    experiment.table("static", ["printed", "here"], cells)
    return law


def _hysteresis(runs: Runs, law: PolynomialForce) -> Hysteresis:
    """Return what the law leaves of the isobaric runs, in the order of their pressures."""
    (chosen,) = runs.names("train", stage="friction")
    names = runs.names(stage="friction")
    names.sort(key=lambda name: (runs.of(name, "pressure"), name != chosen))
    rest = float(runs[chosen]["length"][0])
    found: dict[str, Recording] = {}
    for name, left in zip(names, extract_hysteresis([runs[n] for n in names], law), strict=True):
        bar, elongation = f"{runs.of(name, 'pressure'):g} bar", left["length"] - rest
        title = name if bar in found else bar
        found[title] = left.with_channels({ELONGATION: "mm"}, **{ELONGATION: elongation})
    level = float(runs.of(chosen, "pressure"))
    title = f"{level:g} bar"
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
        rows[model] = [fit.block.n_parameters, fit.rmse, r2]
        errors[model] = {
            title: rms(experiment.simulate(model, one)[HYSTERESIS] - one[HYSTERESIS])
            for title, one in found.runs.items()
        }
    experiment.table("closed", ["parameters", "RMSE [N]", "r²"], rows, at=found.chosen)
    few, ours, many = (found.fitted[CLOSED[model]] for model in FRICTIONS)
    best = min(few.rmse, ours.rmse)
    experiment.says(
        r2=rows[PAPERS][-1],
        r2_ours=rows[OURS][-1],
        eleven=few.rmse,
        ours=ours.rmse,
        eighteen=many.rmse,
        near_eleven=_near(few),
        near_eighteen=_near(many),
        closer=", ".join(m for m, n in CLOSED.items() if found.fitted[n].rmse < best) or "none",
    )
    worst: dict[str, float] = {
        model: max((own[t] / errors[STATIC][t] for t in found.unused), default=math.nan)
        for model, own in errors.items()
    }
    every: dict[str, list[Cell]] = {}
    for model in (STATIC, *sorted(MODELS, key=lambda name: worst[name])):
        last = worst[model] if found.unused else None
        every[model] = [rows.get(model, [None])[0], *errors[model].values(), last]
    columns = ["parameters", *found.runs, "at most, of the static law's"]
    experiment.table("loops", columns, every, at=found.chosen)
    if found.unused:
        better = [n for n in every if worst[n] < min(worst[PAPERS], worst[OURS])]
        experiment.says(
            worst=worst[PAPERS],
            worst_ours=worst[OURS],
            unused=len(found.unused),
            better=", ".join(f"{name} {worst[name]:.2f}" for name in better) or "none",
            won=sum(errors[EIGHTEEN][t] < errors[PAPERS][t] for t in found.unused),
        )


EVERY, NEAR = 16, 1.05
"""Evaluations from one report of a search to the next, and how near to its least error is near."""


def _near(fit: Fitted) -> int:
    """Return after how many evaluations a search was near its least error."""
    return EVERY * (1 + int(np.argmax(np.array(fit.search) < NEAR * min(fit.search))))


WIDE = 10.0
"""Ratio of the ends of a range beyond which a parameter is called not determined."""


def _parameters(experiment: Experiment, key: str, model: str, found: Hysteresis) -> None:
    """Add the parameters of a friction, and how far the closed loop determines them."""
    fits = [found.fitted[CLOSED[model]]]
    for seed in range(experiment.seed + 1, experiment.seed + (2 if experiment.quick else 5)):
        fits.append(experiment.fit(f"{model}, seed {seed}", _estimator(model, seed), found.loop))
    blocks = [fit.block for fit in fits if isinstance(fit.block, MultistateFriction)]
    orders = [block.by_strength() for block in blocks]
    friction, *others = (
        replace(block, values=tuple(block.values[place] for place in order))
        for block, order in zip(blocks, orders, strict=True)
    )
    ranges = parameter_ranges(friction, found.loop, others=others)
    errors = np.array(fits[0].standard_errors)[orders[0]]
    theirs = printed_friction().values if model == PAPERS else [None] * len(friction.values)
    rows: dict[str, list[Cell]] = {}
    for name, *three, (low, high) in zip(
        friction.parameter_names, theirs, friction.values, errors, ranges.tolist(), strict=True
    ):
        cells = [None if x is None or math.isnan(x) else float(x) for x in three]
        ends: list[Cell] = [low, high if math.isfinite(high) else "any larger"]
        rows[name] = [*cells, *ends, "" if high < WIDE * low else "not determined"]
    columns = ["printed", "here", "standard error", "from", "to", "determined?"]
    experiment.table(key, columns, rows, wide=WIDE, at=found.chosen)
    if model == PAPERS:
        vague = [name for name, cells in rows.items() if cells[-1]]
        experiment.says(n_vague=len(vague), vague="; ".join(vague) or "none")


def _figures(experiment: Experiment, isometric: Sequence[Recording], found: Hysteresis) -> None:
    """Add the runs, what is extracted of them, and what models leave of it."""
    length, extracted = found.loop["length"], found.loop[HYSTERESIS]
    modelled = {n: experiment.simulate(CLOSED[n], found.loop)[HYSTERESIS] for n in FRICTIONS}
    held = {f"{one['length'].mean():.0f} mm": one for one in isometric}
    forces = {title: (one["pressure"], one["force"]) for title, one in held.items()}
    laws: dict[str, Curves] = {}
    for title in [*held][:: max(1, (len(held) - 1) // 2)]:
        law = held[title]["pressure"], experiment.simulate(LAW, held[title])["force"]
        laws[title] = {held[title].origin: forces[title], "static law": law}
    costs = {name: np.array(found.fitted[CLOSED[name]].search) for name in FRICTIONS}
    of_loop = {"extracted": extracted} | modelled
    total: dict[str, Curves] = {}
    for title in found.unused:
        one = found.runs[title]
        static = one["force"] - one[HYSTERESIS]
        sums = {n: static + experiment.simulate(n, one)[HYSTERESIS] for n in (PAPERS, OURS)}
        curves = {one.origin: one["force"], STATIC: static} | sums
        total[title] = {name: (one["length"], force) for name, force in curves.items()}
    figures: dict[str, Mapping[str, Curves]] = {
        "isobaric": {"": {n: (one["length"], one["force"]) for n, one in found.runs.items()}},
        "isometric": {"": forces},
        "law": laws,
        "loop": {"": {name: (length, force) for name, force in of_loop.items()}},
        "search": {"": {n: (EVERY * np.arange(1.0, c.size + 1), c) for n, c in costs.items()}},
        "left": {"": {name: (length, force - extracted) for name, force in modelled.items()}},
        "unused": total,
    }
    for key, panels in figures.items():
        if panels:
            experiment.figure(key, panels)


STROKE, APPROACH, SWINGING = 0.8, 10.0, 7.0
"""Imposed motion, by that of the fitted loop; time to the first force, and period of the sine [s]."""


def _feedforward(experiment: Experiment, found: Hysteresis) -> None:
    """Add forces tracked on the rig without feedback; references are ours, as the paper tries none."""
    if experiment.rig is None:
        return
    law, quick = found.law, experiment.quick
    duration = 40.0 if quick else 80.0
    time = np.arange(round(duration / SAMPLE_TIME) + 1) * SAMPLE_TIME
    stroke, turns = STROKE * float(np.ptp(found.loop["length"])), 2 * round(duration / 20.0) + 1
    longest = float(found.loop["length"].max())
    length = longest - irregular_triangle(time, turns, stroke, seed=7)
    (strongest,) = np.dot(
        (experiment.rig.limits("pressure").high, 1.0), law.terms(np.array([longest]))
    )
    held = float(f"{strongest / 4:.2g}")
    references = {
        f"static law at {found.chosen}": np.dot((found.bar, 1.0), law.terms(length)),
        f"{held:.0f} N": np.full(time.size, held),
        f"{held:.0f} N ± {held / 3:.0f} N": held * (1 + np.sin(2 * np.pi * time / SWINGING) / 3),
    }
    ways = {STATIC: ForceFeedforward(law)}
    for name in FRICTIONS[: 2 if quick else 3]:
        friction: Any = experiment.models[name]
        ways[name] = ForceFeedforward(law, replace(friction, output=law.outputs[0]))
    rows: list[list[Cell]] = []
    panels: dict[str, dict[str, tuple[Array, Array]]] = {}
    for title, force in [*references.items()][: 1 if quick else 3]:
        reference = Recording({"force": force, "length": length}, SAMPLE_TIME)
        panels[title] = {"reference": (length, force)}
        for name, way in ways.items():
            experiment.tell(0.75 + len(rows) / 48, f"feedforward of {title}")
            done = track(way, experiment.rig, reference, approach=APPROACH, seed=experiment.seed)
            errors = [done.rmse["force"], done.largest["force"], float(done.clipped)]
            rows.append([title, name, *errors])
            last = done.recording.slice(len(done.recording) - time.size, len(done.recording))
            panels[title][name] = last["length"], last["force"]
    columns = ["compensated by", "RMSE [N]", "largest [N]", "steps at a limit"]
    experiment.table("feedforward", columns, rows, stroke=stroke, at=found.chosen)
    experiment.figure("feedforward", panels)
    keys = ("track_static", "track_eleven", "track_ours")
    experiment.says(**{key: row[2] for key, row in zip(keys, rows, strict=False)})


HELD, STROKES = 0.2, 0.1
"""What is held moves less than this share of what is driven, where a tenth of the length is as much as
the highest pressure."""

NEEDED = {"length": 3, "pressure": 1}
"""Values that each must be held at."""


def sort(recordings: Sequence[Recording]) -> list[Labels | None]:
    """Return which runs are isometric and isobaric, and which one identifies friction.

    That is the largest loop at the pressure nearest to two thirds of the highest, as 4 of 6 bar.
    """
    at: dict[str, dict[int, float]] = {held: {} for held in NEEDED}
    strokes = []
    for place, one in enumerate(recordings):
        for channel in ("length", "pressure", "force"):
            if channel not in one:
                remedy = f"record it, or name its column with --column {channel}=COLUMN"
                raise DataError("it is missing", file=one.source, channel=channel, remedy=remedy)
        length, bar = one["length"], one["pressure"]
        stroke, swing = (float(np.ptp(np.percentile(x, [1, 99]))) for x in (length, bar))
        strokes.append(stroke)
        moved, driven = stroke / (STROKES * length.max()), swing / bar.max()
        if min(moved, driven) < HELD * max(moved, driven):
            held = "length" if moved < driven else "pressure"
            at[held][place] = round(float(np.median(one[held])), 1)
    for (held, values), driven in zip(at.items(), ("pressure", "length"), strict=True):
        if len({*values.values()}) < NEEDED[held]:
            raise DataError(
                f"{len(values)} of {len(recordings)} recordings hold the {held} while the {driven} "
                f"moves, at {len({*values.values()})} values",
                channel=held,
                remedy=f"record such runs at {NEEDED[held]} values of the {held} or more",
            )
    bars = at["pressure"]
    wanted = 2 / 3 * max(bars.values())
    chosen = min(bars, key=lambda place: (abs(bars[place] - wanted), -strokes[place]))
    found: list[Labels | None] = [None] * len(recordings)
    for place, held_at in at["length"].items():
        found[place] = Labels("train", {"stage": "static", "length": held_at})
    for place, held_at in bars.items():
        role: Role = "train" if place == chosen else "test"
        found[place] = Labels(role, {"stage": "friction", "pressure": held_at})
    return found


RERUN = Rerun(run, sort)
