"""Paper C again: static force from isometric runs, friction from an isobaric loop, and their sum.

Source: "A Multistate Friction Model for the Compensation of the Asymmetric Hysteresis in the Mechanical
Response of Pneumatic Artificial Muscles".
"""

from __future__ import annotations

from collections.abc import Mapping

from mckibben import registry
from mckibben.blocks.force.laws import ForceLaw
from mckibben.blocks.force.multistate_friction import MultistateFriction
from mckibben.comparison.checkpoints import Checkpoints
from mckibben.estimators.force.multistate import (
    extract_hysteresis,
)
from mckibben.papers.keeping import fitted, recorded
from mckibben.papers.multistate_friction.force_feedforward import ALONE, feedforward_on_the_stand
from mckibben.papers.multistate_friction.models import (
    BASELINES,
    EIGHTEEN,
    ELONGATION,
    HYSTERESIS,
    IDENTIFIED,
    LAWS,
    NAMES,
    OURS,
    PAPERS,
    Model,
    fit_models,
    other_ends,
)
from mckibben.papers.multistate_friction.protocol import IDENTIFIED_AT, LONGEST
from mckibben.papers.multistate_friction.published import multistate_friction as printed_friction
from mckibben.papers.multistate_friction.tables import (
    PRINTED_FRICTION,
    closed_loop,
    figures,
    isobaric_loops,
    parameters,
    r2_of,
    static_forces,
    static_laws,
)
from mckibben.papers.reproduction import (
    Progress,
    Reproduction,
    Source,
    Table,
    rms,
)
from mckibben.recording import Recording
from mckibben.signals.protocol import protocol

SOURCE = Source(
    "A Multistate Friction Model for the Compensation of the Asymmetric Hysteresis in the "
    "Mechanical Response of Pneumatic Artificial Muscles",
    "Do a few friction elements, which differ by direction, describe the loop of force over length as "
    "well as models of four times as many parameters?",
    authors="Capace, Cosentino, Amato, Merola",
    published="Actuators 8(2), 49, 2019",
    doi="10.3390/act8020049",
)


def multistate_friction(
    *, quick: bool, seed: int, jobs: int | None, tell: Progress, kept: Checkpoints
) -> Reproduction:
    """Run the isometric and isobaric protocol, and identify force laws and friction."""
    del jobs
    runs = [run.name for run in protocol("multistate-friction").runs]
    recordings = {
        run.name: recording
        for run, recording in recorded(
            kept, "multistate-friction", runs, seed, lambda share, text: tell(0.4 * share, text)
        )
    }
    isometric = [r for name, r in recordings.items() if name.startswith("isometric")]
    tell(0.42, "static laws")
    laws = {
        name: fitted(kept, name, registry.load("estimators", name)(seed=seed), isometric)
        for name in (("force-bilinear",) if quick else LAWS)
    }
    law = laws["force-bilinear"].block
    assert isinstance(law, ForceLaw)
    isobaric = {
        name: _extracted(r, law) for name, r in recordings.items() if name.startswith("isobaric")
    }
    # the largest closed loop, as the paper's: from the first turn on
    whole = isobaric[IDENTIFIED]
    loop = whole.slice(len(whole) // 3, len(whole))
    tell(0.45, "friction")
    models = fit_models(kept, loop, whole, seed, quick=quick)
    tell(0.65, "how far parameters are determined")
    shown = {name: models[name].closed for name in ((PAPERS,) if quick else (PAPERS, OURS))}
    known = {
        name: parameters(name, fit, loop, other_ends(kept, name, loop, seed, quick=quick))
        for name, fit in shown.items()
    }
    frictions = {name: models[name].rested.block for name in NAMES.values()}
    if quick:
        del frictions[EIGHTEEN]
    driven, forces, reached = feedforward_on_the_stand(
        law,
        {name: f for name, f in frictions.items() if isinstance(f, MultistateFriction)},
        quick=quick,
        seed=seed,
        tell=lambda share, text: tell(0.75 + 0.25 * share, text),
    )
    worst = {name: _worst(model, isobaric) for name, model in models.items()}
    return Reproduction(
        name="multistate-friction",
        source=SOURCE,
        summary=(
            _headline(worst, models),
            _eighteen(models, worst, isobaric),
            _closed(models, loop),
            _vague(known[PAPERS]),
            f"On the test stand, with the static law at {IDENTIFIED_AT:.0f} bar as the force wished "
            f"for, feedforward is off by {reached[ALONE]:.1f} N (RMSE) with the static law alone, "
            f"{reached[PAPERS]:.1f} N with the paper's eleven parameters and {reached[OURS]:.1f} N with "
            "ours.",
        ),
        tables=(
            isobaric_loops(models, worst, isobaric),
            closed_loop(models, loop),
            driven,
            *known.values(),
            static_laws(laws, isometric),
            static_forces(law),
        ),
        figures=(*figures(isometric, isobaric, loop, law, models), forces),
        notes=(
            "Lengths, speeds and minor loops are ours; isometric runs stop at 184 mm, where the "
            "muscle is slack while its friction is released.",
            "The paper leaves open what becomes of an element while its direction is inactive; here it "
            "is unloaded by the motion.",
            _printed_third(),
            "The paper takes friction to be independent of rate over the speeds of its isobaric runs. "
            "All runs here have one speed, so they cannot tell: sigma then only says how soon an "
            "element gives way, and most values of it have no lower end.",
            "The paper compares sizes only, and fits no other model. Sizes here are the paper's where "
            "it gives one; the reversible part is a straight line, since a polynomial is wild at "
            "lengths that 4 bar does not reach. All models start from rest at 200 mm.",
            "Our modified PI has play operators with weights of at least 0 and a map behind: with them "
            "force cannot level off while the length goes on, whatever their number. With weights of "
            "either sign it can, which is Maxwell-slip in other words.",
            "Friction identified at 4 bar is not scaled with pressure; on the rig it grows with it.",
        ),
    )


def _extracted(recording: Recording, law: ForceLaw) -> Recording:
    (left,) = extract_hysteresis(recording, law)
    return left.with_channels({ELONGATION: "mm"}, **{ELONGATION: left["length"] - LONGEST})


def _worst(model: Model, isobaric: Mapping[str, Recording]) -> float:
    """Return the largest error on loops not used for fitting, by that of the static law alone."""
    return max(
        rms(model.errors(recording)) / rms(recording[HYSTERESIS])
        for name, recording in isobaric.items()
        if name != IDENTIFIED
    )


def _headline(worst: Mapping[str, float], models: Mapping[str, Model]) -> str:
    best_of_both = min(worst[PAPERS], worst[OURS])
    better = sorted((share, name) for name, share in worst.items() if share < best_of_both)
    listed = ", ".join(
        f"{name} {share:.2f}"
        + ("" if name == EIGHTEEN else f" ({models[name].rested.block.n_parameters} parameters)")
        for share, name in better
    )
    return (
        f"On isobaric loops not used for fitting, from rest on, the total force is off by at most "
        f"{worst[PAPERS]:.2f} times what the static law alone is with the paper's eleven parameters, "
        f"and {worst[OURS]:.2f} times with our eleven (one element for each direction). "
        + (f"Other models do better there: {listed}." if better else "No other model does better.")
    )


def _eighteen(
    models: Mapping[str, Model], worst: Mapping[str, float], isobaric: Mapping[str, Recording]
) -> str:
    """Say whether the paper's finding holds that eighteen parameters are no better than eleven."""
    few, many = models[PAPERS], models[EIGHTEEN]
    unused = [name for name in isobaric if name != IDENTIFIED]
    lost = [n for n in unused if rms(many.errors(isobaric[n])) > rms(few.errors(isobaric[n]))]
    holds = many.closed.rmse > 0.95 * few.closed.rmse
    exceptions = f"; they are worse on {', '.join(lost)}" if lost else ""
    return (
        ("As the paper finds" if holds else "Against the paper's finding (its Figure 7)")
        + f", eighteen parameters leave {many.closed.rmse:.2f} N of the fitted loop, its eleven "
        f"{few.closed.rmse:.2f} N; at most {worst[EIGHTEEN]:.2f} and {worst[PAPERS]:.2f} times the "
        f"static law's error on loops not used, where eighteen are better on {len(unused) - len(lost)} "
        f"of {len(unused)}{exceptions}."
    )


def _closed(models: Mapping[str, Model], loop: Recording) -> str:
    ours = models[OURS].closed
    better = [
        n for n in BASELINES if models[n].closed.rmse < min(ours.rmse, models[PAPERS].closed.rmse)
    ]
    r2 = {name: r2_of(models[name].closed, [loop], HYSTERESIS) for name in (PAPERS, OURS)}
    return (
        f"On the closed loop fitted, the paper's eleven parameters reach r² {r2[PAPERS]:.4f} (printed "
        f"{PRINTED_FRICTION[1]:.4f}) and ours {r2[OURS]:.4f}, {ours.rmse:.2f} N; closer than both come "
        f"{', '.join(better) or 'no others'}."
    )


def _vague(table: Table) -> str:
    vague = [str(row[0]) for row in table.rows if row[-1] != ""]
    return (
        f"Of the paper's eleven parameters that loop leaves {len(vague)} undetermined: "
        f"{'; '.join(vague) or 'none'}."
    )


def _printed_third() -> str:
    k, _, limit = printed_friction().table()[2, 3:]
    return (
        f"The paper's third element never slips: with F_c / k = {limit / k / 1000:.1f} m it is a spring "
        f"of {1000 * k:.1f} N/m, 1 or 2 mN over the stroke, and the eight parameters of the others make "
        "the loop."
    )
