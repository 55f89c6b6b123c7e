"""Paper C again: static force from isometric runs, friction from an isobaric loop, and their sum.

Source: "A Multistate Friction Model for the Compensation of the Asymmetric Hysteresis in the Mechanical
Response of Pneumatic Artificial Muscles".
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, get_args

import numpy as np

from mckibben import registry
from mckibben.blocks.base import Block
from mckibben.blocks.compose import Parallel
from mckibben.blocks.force.law import ForceLaw
from mckibben.blocks.force.multistate_friction import MultistateFriction
from mckibben.blocks.published.multistate import multistate_friction as printed_friction
from mckibben.blocks.published.multistate import static_force as printed_law
from mckibben.comparison.free_run import run_free
from mckibben.comparison.kept import Kept
from mckibben.estimators.force.multistate import (
    MultistateEstimator,
    Structure,
    extract_hysteresis,
)
from mckibben.metrics import score
from mckibben.papers.keeping import Fitted, fitted, recorded
from mckibben.papers.reproduction import (
    Cell,
    Figure,
    Progress,
    Reproduction,
    Table,
    rms,
    thinned,
)
from mckibben.recording import Recording
from mckibben.signals.protocols import protocol

LAWS = {
    "force-bilinear": "bilinear-quadratic (the paper's)",
    "force-chou": "Chou and Hannaford",
    "force-tondu": "Tondu and Lopez, with Kerscher's corrections",
    "force-petrovic": "Petrovic",
    "force-minh": "Minh's cubic",
    "force-schindele": "Schindele and Aschemann",
}
BASELINES = ("pi", "maxwell-slip", "mms", "bouc-wen", "gbw", "duhem")
"""Other hysteresis models, on the extracted hysteresis."""

OURS = "11 parameters, ours"
NAMES = {"eleven": "11 parameters, the paper's", "each-way": OURS, "eighteen": "18 parameters"}
"""Structures of the friction."""

PRINTED_STATIC = (15.429, 0.9848)
PRINTED_FRICTION = (3.5568, 0.9970)
"""RMSE [N] and r² as printed, of the static law and of the friction at 4 bar."""

IDENTIFIED = "isobaric-4bar"
HYSTERESIS = "force_hysteresis"


def multistate_friction(
    *, quick: bool, seed: int, jobs: int | None, tell: Progress, kept: Kept
) -> Reproduction:
    """Run the isometric and isobaric protocol, and identify force laws and friction."""
    del jobs
    runs = [run.name for run in protocol("multistate").runs]
    recordings = {
        run.name: recording
        for run, recording in recorded(
            kept, "multistate", runs, seed, lambda share, text: tell(0.6 * share, text)
        )
    }
    isometric = [r for name, r in recordings.items() if name.startswith("isometric")]
    isobaric = {name: r for name, r in recordings.items() if name.startswith("isobaric")}
    tell(0.62, "static laws")
    laws = {
        name: fitted(kept, name, registry.load("estimators", name)(seed=seed), isometric)
        for name in (("force-bilinear",) if quick else LAWS)
    }
    law = laws["force-bilinear"].block
    assert isinstance(law, ForceLaw)
    # the largest closed loop, as the paper's: from the first turn on
    whole = isobaric[IDENTIFIED]
    (loop,) = extract_hysteresis(whole.slice(len(whole) // 3, len(whole)), law)
    tell(0.7, "friction")
    (from_rest,) = extract_hysteresis(whole, law)
    found, totals = {}, {}
    search: dict[str, Any] = {"n_refined": 4} if quick else {}
    for name in get_args(Structure):
        estimator = MultistateEstimator(
            output=HYSTERESIS,
            static="none",
            elements=name,
            initial="first_sample",
            seed=seed,
            **search,
        )
        found[name] = fitted(kept, name, estimator, loop)
        at_rest = replace(estimator, initial="virgin")
        alone = fitted(kept, f"{name} from rest", at_rest, from_rest).block
        totals[NAMES[name]] = _total(law, alone)
    tell(0.85, "other models of hysteresis")
    others = {}
    for name in () if quick else BASELINES:
        estimator_class = registry.load("estimators", name)
        estimator = estimator_class(input="length", output=HYSTERESIS, seed=seed)
        others[name] = fitted(kept, name, estimator, loop)
    scores = {name: (fit.rmse, _r2(fit, [loop], HYSTERESIS)) for name, fit in found.items()}
    loops = _loops(isobaric, law, totals)
    unused = [row for row in loops.rows if row[0] != IDENTIFIED]
    worst = max(float(row[3] or 0) / float(row[1] or 1) for row in unused)
    best = scores["each-way"]
    return Reproduction(
        name="multistate-friction",
        title="A Multistate Friction Model for the Compensation of the Asymmetric Hysteresis in the "
        "Mechanical Response of Pneumatic Artificial Muscles",
        summary=(
            f"Eleven parameters as published: r² {scores['eleven'][1]:.4f} on the extracted hysteresis; "
            f"eleven with one element for each direction: r² {best[1]:.4f}, {best[0]:.2f} N.",
            f"On isobaric loops not used for fitting, the total force is off by at most {worst:.2f} "
            "times what the static law alone is.",
        ),
        tables=(
            _static(laws, isometric),
            _friction(scores, others, loop),
            loops,
            _values(law, found["eleven"].block),
        ),
        figures=_figures(isometric, isobaric, loop, law, found, totals),
        notes=(
            "Lengths, speeds and minor loops are ours; isometric runs stop at 184 mm, where the "
            "muscle is slack while its friction is released.",
            "The paper leaves open what becomes of an element while its direction is inactive; here it "
            "is unloaded by the motion.",
        ),
    )


def _r2(fit: Fitted, recordings: Sequence[Recording], output: str) -> float:
    """Return R² of the free-running output over recordings."""
    measured = np.concatenate([recording[output] for recording in recordings])
    modelled = np.concatenate([fit.block.simulate(r)[output] for r in recordings])
    return score(measured, modelled).r2


def _total(law: ForceLaw, friction: Block) -> Parallel:
    assert isinstance(friction, MultistateFriction)
    same = replace(friction, output=law.outputs[0], initial="virgin")
    return Parallel((law, same))


def _static(laws: Mapping[str, Fitted], isometric: list[Recording]) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for name, fit in laws.items():
        printed = PRINTED_STATIC if name == "force-bilinear" else (None, None)
        r2 = _r2(fit, isometric, "force")
        rows.append((LAWS[name], printed[0], fit.rmse, printed[1], r2, fit.block.n_parameters))
    return Table(
        "Static force from isometric runs (its Section 2)",
        ("law", "RMSE [N], printed", "RMSE [N], here", "r², printed", "r², here", "parameters"),
        tuple(rows),
    )


def _friction(
    scores: Mapping[str, tuple[float, float]], others: Mapping[str, Fitted], loop: Recording
) -> Table:
    counts = {"eleven": 11, "each-way": 11, "eighteen": 18}
    rows: list[tuple[Cell, ...]] = []
    for name, (rmse, r2) in scores.items():
        printed = PRINTED_FRICTION if name == "eleven" else (None, None)
        rows.append((NAMES[name], printed[0], rmse, printed[1], r2, counts[name]))
    for name, fit in others.items():
        r2 = _r2(fit, [loop], HYSTERESIS)
        rows.append((name, None, fit.rmse, None, r2, fit.block.n_parameters))
    return Table(
        "Extracted hysteresis at 4 bar (its Section 4)",
        ("model", "RMSE [N], printed", "RMSE [N], here", "r², printed", "r², here", "parameters"),
        tuple(rows),
        "On the closed loop. Ours has one element shared and one for each direction. Other models "
        "include a reversible polynomial of the length.",
    )


def _loops(isobaric: dict[str, Recording], law: ForceLaw, totals: dict[str, Parallel]) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for name, recording in isobaric.items():
        measured = recording["force"]
        alone = rms(law.simulate(recording)["force"] - measured)
        errors = [rms(run_free(total, recording, "force") - measured) for total in totals.values()]
        rows.append((name, alone, *errors))
    return Table(
        "Total force on isobaric loops",
        ("loop", "static law alone, RMSE [N]", *(f"{name}, RMSE [N]" for name in totals)),
        tuple(rows),
        f"Friction was identified on {IDENTIFIED} alone, from rest on, and is not scaled with "
        "pressure.",
    )


def _values(law: ForceLaw, friction: Block) -> Table:
    rows: list[tuple[Cell, ...]] = []
    published = printed_law()
    span = np.array([184.0, 200.0])
    for p in (1.0, 4.0, 6.0):
        for length, theirs, ours in zip(
            span.tolist(), _at(published, span, p), _at(law, span, p), strict=True
        ):
            rows.append((f"static force at {length:.0f} mm, {p:.0f} bar [N]", theirs, ours))
    assert isinstance(friction, MultistateFriction)
    tables = printed_friction().table(), friction.table()
    for element in range(3):
        for column, quantity in enumerate(("k [N/mm]", "sigma [N s/mm]", "F_c [N]")):
            for offset, way in ((0, "lengthening"), (3, "shortening")):
                if element > 0 and offset == 0:
                    continue
                both = [float(table[element, column + offset]) for table in tables]
                rows.append((f"element {element + 1}, {way}: {quantity}", *both))
    return Table(
        "Forces and parameters (its Tables 1 and 2)",
        ("quantity", "printed", "here"),
        tuple(rows),
        "Two muscles of one type: alike in size, not equal. Elements are not in any order.",
    )


def _at(law: ForceLaw, lengths: np.ndarray, pressure: float) -> list[float]:
    per_bar, rest = law.terms(lengths)
    forces: list[float] = (pressure * per_bar + rest).tolist()
    return forces


def _figures(
    isometric: list[Recording],
    isobaric: dict[str, Recording],
    loop: Recording,
    law: ForceLaw,
    found: Mapping[str, Fitted],
    totals: dict[str, Parallel],
) -> tuple[Figure, ...]:
    def curve(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return thinned(x, 1500), thinned(y, 1500)

    cycles = {n: r for n, r in isobaric.items() if n.endswith("bar")}
    minor = isobaric["isobaric-minor-loops"]
    total = run_free(totals[OURS], minor, "force")
    return (
        Figure(
            "Isobaric loops (its Figure 2)",
            "length [mm]",
            "force [N]",
            {name: curve(r["length"], r["force"]) for name, r in cycles.items()},
        ),
        Figure(
            "Isometric runs (its Figure 3)",
            "pressure [bar]",
            "force [N]",
            {
                f"{r['length'].mean():.0f} mm": curve(r["pressure"], r["force"])
                for r in isometric[::2]
            },
        ),
        Figure(
            "Extracted hysteresis at 4 bar and the models (its Figure 6)",
            "length [mm]",
            "hysteresis force [N]",
            {
                "extracted": curve(loop["length"], loop[HYSTERESIS]),
                **{
                    name: curve(loop["length"], found[name].block.simulate(loop)[HYSTERESIS])
                    for name in ("eleven", "each-way")
                },
            },
        ),
        Figure(
            "Total force through minor loops, not used for fitting",
            "length [mm]",
            "force [N]",
            {
                "measured": curve(minor["length"], minor["force"]),
                "static law alone": curve(minor["length"], law.simulate(minor)["force"]),
                "static law and friction": curve(minor["length"], total),
            },
        ),
    )
