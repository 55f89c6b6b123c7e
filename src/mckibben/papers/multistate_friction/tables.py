"""The tables and figures, the paper's printed numbers beside."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.force.laws import ForceLaw
from mckibben.blocks.force.multistate_friction import MultistateFriction
from mckibben.metrics import score
from mckibben.papers.keeping import Fitted
from mckibben.papers.multistate_friction.models import (
    EIGHTEEN,
    HYSTERESIS,
    LAWS,
    NAMES,
    OURS,
    PAPERS,
    Model,
    in_order,
)
from mckibben.papers.multistate_friction.published import multistate_friction as printed_friction
from mckibben.papers.multistate_friction.published import static_force as printed_law
from mckibben.papers.multistate_friction.ranges import parameter_ranges
from mckibben.papers.reproduction import (
    Cell,
    Figure,
    Points,
    Table,
    rms,
    thinned,
)
from mckibben.recording import Recording

PRINTED_SIZES = {
    PAPERS: 11,
    EIGHTEEN: 18,
    "modified Maxwell-slip": 42,
    "modified PI": 40,
    "generalised Bouc-Wen": 9,
}
"""Numbers of parameters that the paper gives its models, and those of others, in Sections 1 and 4."""

PRINTED_STATIC = (15.429, 0.9848)
PRINTED_FRICTION = (3.5568, 0.9970)
"""RMSE [N] and r² as printed, of the static law and of the friction at 4 bar."""

MINOR = "isobaric-minor-loops"
SLACK_RANGE = 10.0
"""Ratio of the ends of a range beyond which a parameter is called not determined."""


def r2_of(fit: Fitted, recordings: Sequence[Recording], output: str) -> float:
    """Return R² of the free-running output over recordings."""
    measured = np.concatenate([recording[output] for recording in recordings])
    modelled = np.concatenate([fit.block.simulate(r)[output] for r in recordings])
    return score(measured, modelled).r2


def static_laws(laws: Mapping[str, Fitted], isometric: list[Recording]) -> Table:
    """Return the errors of force laws on the isometric runs."""
    rows: list[tuple[Cell, ...]] = []
    for name, fit in laws.items():
        printed = PRINTED_STATIC if name == "force-bilinear" else (None, None)
        r2 = r2_of(fit, isometric, "force")
        rows.append((LAWS[name], printed[0], fit.rmse, printed[1], r2, fit.block.n_parameters))
    return Table(
        "Static force from isometric runs (its Section 2)",
        ("law", "RMSE [N], printed", "RMSE [N], here", "r², printed", "r², here", "parameters"),
        tuple(rows),
        drawn=Points("RMSE [N]", ("RMSE [N], printed", "RMSE [N], here")),
    )


def closed_loop(models: Mapping[str, Model], loop: Recording) -> Table:
    """Return the errors of all models on the loop that they are fitted to."""
    rows: list[tuple[Cell, ...]] = []
    for name, model in models.items():
        printed = PRINTED_FRICTION if name == PAPERS else (None, None)
        r2 = r2_of(model.closed, [loop], HYSTERESIS)
        rows.append((name, *_sizes(model), printed[0], model.closed.rmse, printed[1], r2))
    return Table(
        "Extracted hysteresis at 4 bar, the closed loop (its Section 4)",
        ("model", *SIZES, "RMSE [N], printed", "RMSE [N], here", "r², printed", "r², here"),
        tuple(rows),
        "Fitted and scored on the same loop, as the paper does. Ours has one element shared and one for "
        "each direction.",
        Points("RMSE [N]", ("RMSE [N], printed", "RMSE [N], here")),
    )


SIZES = ("parameters, printed", "parameters, here")


def _sizes(model: Model) -> tuple[Cell, Cell]:
    return PRINTED_SIZES.get(model.name), model.closed.block.n_parameters


def isobaric_loops(
    models: Mapping[str, Model], worst: Mapping[str, float], isobaric: Mapping[str, Recording]
) -> Table:
    """Return the errors of the total force on all isobaric loops, best model first."""
    alone: tuple[Cell, ...] = tuple(rms(r[HYSTERESIS]) for r in isobaric.values())
    rows: list[tuple[Cell, ...]] = [(STATIC, None, None, *alone, 1.0)]
    for name in sorted(models, key=lambda name: worst[name]):
        model = models[name]
        errors = tuple(rms(model.errors(r)) for r in isobaric.values())
        rows.append((name, *_sizes(model), *errors, worst[name]))
    named = (n.removeprefix("isobaric-").replace("-", " ").replace("bar", " bar") for n in isobaric)
    return Table(
        "Total force on isobaric loops, RMSE [N]",
        ("model", *SIZES, *named, WORST),
        tuple(rows),
        "The static law with each model of the hysteresis, fitted at 4 bar alone, from rest on, and not "
        "scaled with pressure; best first. The last column is by the static law's own error, over all "
        "but 4 bar.",
    )


STATIC = "static law alone"
WORST = "at most, of the static law's"


def parameters(
    name: str, fit: Fitted, loop: Recording, again: Sequence[MultistateFriction]
) -> Table:
    """Return the parameters of a friction, and how far the loop determines them."""
    assert isinstance(fit.block, MultistateFriction)
    friction, order = in_order(fit.block)
    printed = printed_friction()
    theirs: Sequence[Cell] = [None] * friction.n_parameters
    if friction.elements == printed.elements:
        theirs = printed.pack().tolist()
    ranges = parameter_ranges(friction, loop, others=again)
    rows: list[tuple[Cell, ...]] = []
    for told, value, own, error, (low, high) in zip(
        friction.parameter_names,
        theirs,
        friction.pack().tolist(),
        [fit.standard_errors[place] for place in order],
        ranges.tolist(),
        strict=True,
    ):
        vague = not high < SLACK_RANGE * low
        rows.append(
            (
                told,
                value,
                own,
                None if math.isnan(error) else error,
                low,
                high if math.isfinite(high) else "any larger",
                "not determined" if vague else "",
            )
        )
    return Table(
        f"Friction on the closed loop: {name}" + (" (its Table 2)" if name == PAPERS else ""),
        ("parameter", "printed", "here", "standard error", "from", "to", "determined?"),
        tuple(rows),
        "Standard errors are as if residuals were independent, which they are not. From and to: where "
        "the RMSE is within 1 % of the least, all others fitted again, round this minimum and those "
        "that other seeds of the search end in; 0 where a thousandth does as well. "
        f"Not determined: the ends differ by more than a factor of {SLACK_RANGE:.0f}. Two muscles "
        "of one type: alike in size, not equal. Elements of one kind are by falling F_c.",
    )


def static_forces(law: ForceLaw) -> Table:
    """Return static forces by the printed law and by ours."""
    rows: list[tuple[Cell, ...]] = []
    published = printed_law()
    span = np.array([184.0, 200.0])
    for p in (1.0, 4.0, 6.0):
        for length, theirs, ours in zip(
            span.tolist(), _at(published, span, p), _at(law, span, p), strict=True
        ):
            rows.append((f"static force at {length:.0f} mm, {p:.0f} bar [N]", theirs, ours))
    return Table(
        "Static forces (by its Table 1)",
        ("quantity", "printed", "here"),
        tuple(rows),
        "Two muscles of one type: alike in size, not equal.",
    )


def _at(law: ForceLaw, lengths: np.ndarray, pressure: float) -> list[float]:
    per_bar, rest = law.terms(lengths)
    forces: list[float] = (pressure * per_bar + rest).tolist()
    return forces


def figures(
    isometric: list[Recording],
    isobaric: Mapping[str, Recording],
    loop: Recording,
    law: ForceLaw,
    models: Mapping[str, Model],
) -> tuple[Figure, ...]:
    """Return the loops, what is extracted of them, and what models leave of it."""

    def curve(x: Array, y: Array) -> tuple[Array, Array]:
        return thinned(x, 1500), thinned(y, 1500)

    cycles = {n: r for n, r in isobaric.items() if n.endswith("bar")}
    minor = isobaric[MINOR]
    static = law.simulate(minor)["force"]
    of_loop = {
        name: models[name].closed.block.simulate(loop)[HYSTERESIS] for name in NAMES.values()
    }
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
                **{name: curve(loop["length"], force) for name, force in of_loop.items()},
            },
        ),
        Figure(
            "What eleven and eighteen parameters leave of it (on the claim of its Figure 7)",
            "length [mm]",
            "model less extracted [N]",
            {
                name: curve(loop["length"], force - loop[HYSTERESIS])
                for name, force in of_loop.items()
            },
        ),
        Figure(
            "Total force through minor loops, not used for fitting",
            "length [mm]",
            "force [N]",
            {
                minor.origin: curve(minor["length"], minor["force"]),
                STATIC: curve(minor["length"], static),
                **{
                    name: curve(
                        minor["length"],
                        static + models[name].rested.block.simulate(minor)[HYSTERESIS],
                    )
                    for name in (PAPERS, OURS)
                },
            },
        ),
    )
