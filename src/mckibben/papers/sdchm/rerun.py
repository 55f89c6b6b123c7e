"""Paper A again: coupled hysteresis of a soft arm, its prediction and its compensation.

Source: "Modeling and Compensation of Stiffness-Dependent Hysteresis Coupling Behavior for Parallel
Pneumatic Artificial Muscle-Driven Soft Manipulator".
"""

from __future__ import annotations

from mckibben.comparison.checkpoints import Checkpoints
from mckibben.papers.reproduction import Progress, Reproduction, Source, Table
from mckibben.papers.sdchm import printed
from mckibben.papers.sdchm.compensation import run_loops
from mckibben.papers.sdchm.models import PUBLISHED, Models, fit_models
from mckibben.papers.sdchm.parts import gains, orders
from mckibben.papers.sdchm.prediction import Predictions
from mckibben.papers.sdchm.recordings import record_arm

SOURCE = Source(
    "Modeling and Compensation of Stiffness-Dependent Hysteresis Coupling Behavior for Parallel "
    "Pneumatic Artificial Muscle-Driven Soft Manipulator",
    "Can the hysteresis of a soft arm, whose muscles move one another and whose stiffness changes, be "
    "predicted and undone by play operators, couplings and a fuzzy network in series?",
    published="Applied Sciences 14(22), 10240, 2024",
    doi="10.3390/app142210240",
)

NOTES = (
    "The arm's physics is not the paper's: levels differ.",
    "Runs with all pressures random are ours: the paper tests along the patterns it trains on.",
    "Every sine starts at its minimum; Eq. (21) starts in the middle and jumps with the amplitude. "
    "The network's runs have a cycle of 1.5 and one of 2.5 bar; of the paper's two the peaks are not "
    "told (the first two of Eq. (22) are of 1.0 and 1.5).",
    "The operators' start, f_r(0) in Eq. (1), is taken as the play of the first pressure on an output "
    "of 0: as published they start from rest. Ours start as if pressure had risen from its least.",
    "As published: the swarm's inertia is not printed (0.7), nor any bounds (none). Gains and "
    "consequents are solved for, whatever their printed start. The search for the GPI models does not "
    "start from weights and envelopes of 0, where nothing moves. Firing is normalised in the log "
    "domain, for in mm the printed centres are so far from most displacements that products underflow. "
    "The swarm compares on 6000 samples spread over all; consequents are then solved for on all. "
    "Decoupling is solved directly, where the paper iterates to within 0.01, Eq. (28).",
    "SDCHM, ours, and the damped raw network stop their searches by the validation patterns; the paper "
    "does not say what it uses them for.",
    "A compensator of ours is the inverse of the model that predicts: one fit, one damping.",
    "Compensators are identified on recorded pressures, so pressures are regulated by an inner loop in "
    "all trials, PID's too.",
    "e_w of every muscle is relative to the range of the reference that moves.",
)

QUICK_NOTE = (
    "Quick: three stiffnesses to learn from and parts of every run; no validation patterns, so that no "
    "search stops by them; a swarm of 8 particles and 6 iterations where the paper has 20 and 50, on "
    "1000 samples; fewer starts of every search; one muscle moved in Table 5."
)


def sdchm(
    *, quick: bool, seed: int, jobs: int | None, tell: Progress, kept: Checkpoints
) -> Reproduction:
    """Run the arm's protocol, identify the coupled models, and track with their inverses."""

    def within(low: float, high: float) -> Progress:
        return lambda share, text: tell(low + (high - low) * share, text)

    runs = record_arm(quick, seed, within(0.0, 0.3), kept)
    sizes = (10,) if quick else tuple(printed.ORDERS)
    (first, *_) = runs.select("train", stage="hysteresis")
    by_order = orders(first, sizes, seed)
    models = fit_models(runs, quick, seed, within(0.32, 0.7), kept)
    predictions = Predictions(models, runs)
    tell(0.7, "closed loops")
    loops, beyond = run_loops(models, runs.patterns, quick, seed, jobs, kept)
    predicted = tuple(predictions.tables())
    tables = [
        *predicted,
        by_order,
        gains(models[PUBLISHED]),
        *loops.tables(),
        *([] if beyond is None else [beyond]),
        _identification(models),
    ]
    return Reproduction(
        name="sdchm",
        source=SOURCE,
        summary=(*predictions.summary(), *loops.summary()),
        tables=tuple(tables),
        figures=(*predictions.figures(), *loops.figures()),
        notes=(*NOTES, *([QUICK_NOTE] if quick else []), *predictions.found.warned),
    )


def _identification(models: Models) -> Table:
    rows = tuple((name, models.seconds[name], models[name].n_parameters) for name in models.blocks)
    return Table("Identification", ("model", "time [s]", "parameters"), rows)
