"""Paper D again: hysteresis under a varying load, and its compensation on the rail.

Source: "High-Precision Displacement and Force Hybrid Modeling of Pneumatic Artificial Muscle Using 3D
PI-NARMAX Model", Actuators 2022, 11(2), 51.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mckibben import registry
from mckibben.blocks.base import Block
from mckibben.blocks.coupled.load_estimate import load_of
from mckibben.comparison.checkpoints import Checkpoints
from mckibben.control import (
    BlockController,
    EstimatedLoad,
    Tracked,
    control_law,
    track,
    tune_pid,
)
from mckibben.estimators.coupled.balance import BalanceEstimator
from mckibben.papers.free_runs import FreeRuns
from mckibben.papers.keeping import recorded
from mckibben.papers.mpi_narmax.found import Found
from mckibben.papers.mpi_narmax.models import (
    AS_PRINTED,
    HELD_RUNS,
    MORE,
    OURS,
    PLAIN,
    QUICK_SAMPLE_TIME,
    RANDOM,
    SAMPLE_TIME,
    STATUSES,
    TEST,
    THREE_RATES,
    UNLOADED,
    fit_models,
)
from mckibben.papers.mpi_narmax.tables import by_status, figures, folded, held, pulls, unrepeated
from mckibben.papers.reproduction import Progress, Reproduction, Source, Table, rms
from mckibben.recording import Recording
from mckibben.rigs import load_rig
from mckibben.signals import resample

SOURCE = Source(
    "High-Precision Displacement and Force Hybrid Modeling of Pneumatic Artificial Muscle Using 3D "
    "PI-NARMAX Model",
    "Can one model that is told the force predict the displacement under any load, where a "
    "Prandtl-Ishlinskii model holds for the load it was identified at?",
    authors="Qin, Xu, Shi, Han",
    published="Actuators 11(2), 51, 2022",
    doi="10.3390/act11020051",
)

LOOP_TIME = 60.0
"""Of the closed loops [s]."""

HOUR = 3600.0
"""Of the random load under which models run free [s]."""

LEVEL = 0.95
"""Share of samples of left-out runs that the interval of an estimated force holds."""


def mpi_narmax(
    *, quick: bool, seed: int, jobs: int | None, tell: Progress, kept: Checkpoints
) -> Reproduction:
    """Run statuses, pulls, random and held-voltage runs, and identify models with and without force."""
    del jobs
    names = list(dict.fromkeys((*STATUSES, *MORE, RANDOM, *HELD_RUNS)))
    step = QUICK_SAMPLE_TIME if quick else SAMPLE_TIME
    recordings = {
        run.name: resample(recording, step)
        for run, recording in recorded(
            kept, "mpi-narmax", names, seed, lambda share, text: tell(0.15 * share, text)
        )
    }
    models, facts = fit_models(recordings, quick, seed, tell, kept)
    free = FreeRuns(models)
    displacements = {
        name: {run: free(name, recording)["displacement"] for run, recording in recordings.items()}
        for name in models
    }
    tell(0.75, "force")
    estimate, half_width = _estimated([recordings[name] for name in MORE])
    tell(0.8, "closed loops")
    loops = {} if quick else _loops(models[OURS], estimate, recordings, seed)
    tell(0.9, "an hour of random load")
    found = Found(
        recordings,
        models,
        displacements,
        facts,
        estimate,
        half_width,
        loops,
        _bounded(models, step, quick, seed),
        free.warned,
        quick,
    )
    return _reported(found)


def _estimated(recordings: Sequence[Recording]) -> tuple[Block, float]:
    """Return an estimate of the force by a balance, and the half width of its interval [N].

    The interval is from runs that the estimate was not fitted to, each left out in turn (conformal
    prediction, run by run), so it holds for loads like those recorded.
    """

    def fitted(runs: Sequence[Recording]) -> Block:
        balance = BalanceEstimator(
            input=("pressure",), output=("displacement",), scheduling=("force",)
        )
        return load_of(balance.fit(runs).fitted)

    missed = []
    for place, left_out in enumerate(recordings):
        estimate = fitted([*recordings[:place], *recordings[place + 1 :]])
        missed.append(np.abs(estimate.simulate(left_out)["force"] - left_out["force"]))
    return fitted(recordings), float(np.quantile(np.concatenate(missed), LEVEL))


def _loops(
    model: Block, estimate: Block, recordings: Mapping[str, Recording], seed: int
) -> dict[str, Tracked]:
    """Return what came of following a sine under the pulls of status 4, with every controller."""
    rig = load_rig("rail")
    time = np.arange(round(LOOP_TIME / SAMPLE_TIME)) * SAMPLE_TIME
    pulls = recordings[TEST]
    force = np.interp(time, pulls.time - pulls.time[0], pulls["force"]).clip(0.0)
    reference = Recording(
        {"displacement": 22.0 + 14.0 * np.sin(0.2 * np.pi * time), "force": force}, SAMPLE_TIME
    )
    unloaded = registry.load("estimators", "balance")(scheduling=(), seed=seed)
    blind = unloaded.fit(recordings["status-1"]).model_
    pid = tune_pid(rig, sample_time=SAMPLE_TIME, scheduled={"force": 0.0}, seed=seed)
    inverse = model.inverse()
    laws = {
        "inverse without force": blind.inverse(),
        "inverse told the force": inverse,
        "inverse with estimated force": EstimatedLoad(BlockController(inverse), estimate),
        "PID": pid,
        "inverse told the force + PID": control_law("feedforward-pid", inverse, lambda: pid),
    }
    return {
        name: track(law, rig, reference, approach=10.0, settle=5.0, seed=seed)
        for name, law in laws.items()
    }


def _bounded(models: Mapping[str, Block], step: float, quick: bool, seed: int) -> dict[str, float]:
    """Return the largest displacement of models that run free under an hour of random load [mm]."""
    rng = np.random.default_rng(seed)
    time = np.arange(round((HOUR / 10 if quick else HOUR) / step)) * step
    knots = np.arange(0.0, time[-1] + 5.0, 5.0)
    inputs = Recording(
        {
            "voltage": np.interp(time, knots, rng.uniform(0.1, 10.0, knots.size)),
            "force": np.interp(time, knots, rng.uniform(0.0, 200.0, knots.size)),
        },
        step,
    )
    return {
        name: float(np.abs(models[name].simulate(inputs)["displacement"]).max())
        for name in (AS_PRINTED, PLAIN, OURS)
    }


def _reported(found: Found) -> Reproduction:
    tables = [unrepeated(found), held(found), *by_status(found), pulls(found), folded()]
    measured, estimated = found.forces[TEST]
    half = found.half_width
    within = 100 * float(np.mean(np.abs(estimated - measured) <= half))
    tables.append(
        Table(
            "Force estimated from pressure and displacement",
            ("run", "RMSE [N]", "range [N]"),
            tuple((name, rms(b - a), float(np.ptp(a))) for name, (a, b) in found.forces.items()),
            f"A 95 % interval of ±{half:.1f} N, from training runs left out in turn, holds "
            f"{within:.0f} % of the test's samples.",
        )
    )
    if found.loops:
        tables.append(
            Table(
                "Following 22 + 14 sin(0.2 pi t) mm under the pulls of status 4",
                ("controller", "RMSE [mm]", "largest [mm]"),
                tuple(
                    (name, r.rmse["displacement"], r.largest["displacement"])
                    for name, r in found.loops.items()
                ),
            )
        )
    headings = ("model", "learned from", "time [s]", "parameters")
    tables.append(Table("Identification", headings, tuple(found.facts)))
    return Reproduction(
        name="mpi-narmax",
        source=SOURCE,
        summary=_summary(found),
        tables=tuple(tables),
        figures=figures(found),
        notes=(
            "The rig's physics is not the paper's muscle: levels differ.",
            "Recorded at 1 kHz, resampled to "
            f"{1 / (QUICK_SAMPLE_TIME if found.quick else SAMPLE_TIME):g} Hz.",
            f"{AS_PRINTED!r} is trained as Sections 4.1 and 4.2 say: the MPI on 0.1 Hz without load, "
            "the network on one record of three pulls of 100 N. Along one sine, rate follows from "
            "place, so weights by rate are not determined; three rates without load determine them.",
            "The paper's fourth layer has no constant, nor have the consequents of these models; ours "
            "have one.",
            "The paper writes 3N rules; taken as 3^N, one for every combination of sets. Its "
            "N = n_a + n_b + n_c does not count what its Eq. (7) lists: here N = 3, the last output, f "
            "and F.",
            "The paper leaves open lags and what its swarm searches: here antecedents and feedbacks, on "
            "the free-running error; consequents by least squares.",
            f"{PLAIN!r} has two sets for each input, even ones without feedback.",
            "The maps of the models fitted here increase; the printed map folds (its table above).",
            "How the hand pulls, the random runs, and the voltages held are ours.",
            *found.warned,
        ),
    )


def _summary(found: Found) -> tuple[str, ...]:
    headline = (AS_PRINTED, THREE_RATES, PLAIN, OURS)

    def both(*runs: str) -> str:
        best = min(UNLOADED, key=lambda name: found.errors(name, *runs)[0])
        return "; ".join(
            "{} {:.2f} / {:.2f} mm".format(name, *found.errors(name, *runs))
            for name in (best, *headline)
        )

    def no_better(*runs: str) -> str:
        blind = min(found.errors(name, *runs)[0] for name in UNLOADED)
        names = [name for name in found.told if found.errors(name, *runs)[0] >= blind]
        return "all" if names == found.told else "; ".join(names) or "none"

    best = min(found.errors(name, TEST)[0] for name in UNLOADED)
    gains = (f"{best / found.errors(name, TEST)[0]:.1f}" for name in (AS_PRINTED, THREE_RATES))
    swings = []
    for name in headline:
        shares = [found.swing(run, name) / found.swing(run) for run in HELD_RUNS]
        swings.append(f"{name} {min(shares):.2f} to {max(shares):.2f}")
    force, estimated = found.forces[TEST]
    return (
        f"Status 4, MAE / RMSE, the best MPI first: {both(TEST)}.",
        "MPI-NARMAX trained on one record over the best MPI there, in MAE: {} times with the front end "
        "of one sine, {} times with that of three rates; printed 3.9 times (2.0 times in "
        "RMSE).".format(*gains),
        f"Random voltage and force, MAE / RMSE: {both(RANDOM)}.",
        f"Voltage held while the force is cycled, MAE / RMSE: {both(*HELD_RUNS)}. Swing over the "
        f"muscle's: {'; '.join(swings)}; every MPI 0.",
        "Only good near the patterns of their training: models that are told the force, and are yet no "
        "better in MAE than the best MPI, which is not told it. On random voltage and force: "
        f"{no_better(RANDOM)}. With the voltage held: {no_better(*HELD_RUNS)}.",
        f"Force estimated on the test: {100 * rms(estimated - force) / float(np.ptp(force)):.1f} % of "
        "its range RMSE.",
        "Largest displacement under random load, free-running"
        + (" for six minutes: " if found.quick else " for an hour: ")
        + ", ".join(f"{name} {value:.0f} mm" for name, value in found.drift.items())
        + ".",
    )
