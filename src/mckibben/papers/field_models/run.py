"""Four methods on one recording, tested on another, and all models of the field on both."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.compose import Series
from mckibben.blocks.memoryless import Affine
from mckibben.comparison.leaderboard import Leaderboard, Row
from mckibben.comparison.ranking import compare
from mckibben.errors import MckibbenError, ModelError
from mckibben.metrics import score
from mckibben.papers.experiment import Cell, Curves, Experiment, Verdict
from mckibben.papers.field_models.protocol import HIGH, LOW
from mckibben.papers.paper import paper
from mckibben.recording import Recording

SEEDS, QUICK_SEEDS = 10, 3
"""Seeds that each of the paper's methods is identified with."""

QUICK = ("balance", "bj", "cpi", "duhem", "gpi", "mpi", "oe", "p2uz", "pi", "preisach")
"""Models of the quick run."""

PRINTED_PI, PRINTED_P2UZ = "field-models-pi", "field-models-p2uz"
NARX, BJ, P2UZ, SLOPES = PAPERS = ("NARX", "BJ", "P2UZ", "PI")
ALL_LAGS, LEAST_SQUARES = "BJ, B with q^-1", "PI by least squares, ours"

GOOD = 90.0
"""Fitness that all four methods exceed in the paper [%]."""

FAILED = [np.inf, -np.inf, np.inf, -np.inf]
"""RMSE and fitness on calibration, then on test, of a seed that gave no model."""


def methods(share: float) -> dict[str, tuple[str, dict[str, Any]]]:
    """Return the paper's four methods as published, and other readings of two of them.

    Of the NARX model the paper prints neither regressors nor mapping: this one is a sigmoid network on
    two past outputs and inputs, one sample late, fitted to one-step errors, of five starts the one with
    the least free-running error. Box-Jenkins has the printed orders, Eqs. (6) to (9): B has terms in q^0
    and q^-2, or, as its text has it ("second-order polynomials"), one in q^-1 as well. Like P2UZ it
    starts at rest, as the muscle does. PI has that share of the printed thresholds, and weights by the
    slopes of segments, Eqs. (14) and (15).
    """
    printed = paper("field-models").models[PRINTED_PI]["thresholds"]
    thresholds = [share * r for r in printed]
    network = {"n_units": 10, "delay": 1, "refine": False, "allow_unstable": True, "n_starts": 5}
    return {
        NARX: ("narx-network", network),
        BJ: ("bj", {"lags": (0, 2), "initial": "first_sample"}),
        ALL_LAGS: ("bj", {"lags": (0, 1, 2), "initial": "first_sample"}),
        P2UZ: ("p2uz", {"initial": "first_sample"}),
        SLOPES: ("pi", {"thresholds": thresholds, "method": "slopes"}),
        LEAST_SQUARES: ("pi", {"thresholds": thresholds}),
    }


class MethodResult(NamedTuple):
    """A method: its plain and matched model of the first successful seed; errors; reasons of failure.

    Errors have the shape (2, seeds, 4), plain first; the last axis is that of `FAILED`.
    """

    models: tuple[Any, Series] | None
    errors: Array
    failures: list[str]

    @property
    def medians(self) -> list[tuple[float, float]]:
        """RMSE [mm] and fitness [%] on the test, plain, then matched; infinite if most seeds failed."""
        return [(row[2], row[3]) for row in np.median(self.errors, axis=1).tolist()]


def finite(values: Array) -> list[Cell]:
    """Return cells, empty where a value is not finite."""
    return [value if np.isfinite(value) else None for value in values.tolist()]


def run(experiment: Experiment) -> None:
    """Record the calibration and the test, and identify the paper's methods and the field."""
    runs = experiment.record(until=0.05)
    (train, *_), (test, *_) = runs.select("train"), runs.select("test")
    seeds = range(experiment.seed, experiment.seed + (QUICK_SEEDS if experiment.quick else SEEDS))
    results = _identify(experiment, train, test, seeds)
    leaderboard = compare(
        train,
        test,
        models=QUICK if experiment.quick else "all",
        seed=experiment.seed,
        jobs=experiment.jobs,
        folder=experiment.checkpoints.inside("field"),
        clear=False,
        progress=lambda now: experiment.within(0.3, 0.95)(now.share, str(now)),
    )
    if leaderboard.stopped:
        raise KeyboardInterrupt
    experiment.add_facts(seeds=f"{seeds[0]} to {seeds[-1]}", n_seeds=len(seeds))
    _error_tables(experiment, results)
    _parameter_tables(experiment, results, train.step)
    _field_table(experiment, leaderboard)
    charted = _summarise(experiment, results, leaderboard)
    _figures(experiment, {"calibration": train, "test": test}, results, charted)


def matched(model: Block, recording: Recording) -> Series:
    """Return a model followed by the paper's match, Eqs. (1) to (3): gain by ranges, then offset.

    Raises
    ------
    ModelError
        If the model's output does not move.
    """
    channel = model.outputs[0]
    x = model.simulate(recording.select([c.name for c in model.inputs]))[channel.name]
    z = recording["displacement"]
    if np.ptp(x) == 0:
        raise ModelError("its output does not move", remedy="give another recording, or model")
    gain = float(np.ptp(z) / np.ptp(x))
    return Series((model, Affine(gain, float(z[0] - gain * x[0]), channel, channel)))


def _identify(
    experiment: Experiment, train: Recording, test: Recording, seeds: range
) -> dict[str, MethodResult]:
    span = float(np.ptp(np.percentile(train["pressure"], (1, 99))))
    candidates = methods(1.0 if experiment.of_its_size else span / (HIGH - LOW))
    results: dict[str, MethodResult] = {}
    for name, (model, settings) in experiment.steps(0.05, 0.3, [*candidates.items()]):
        models: list[tuple[Block, Series]] = []
        errors, failures, part = [], [], experiment.part
        for seed in experiment.steps(*part, seeds):
            try:
                seeded = settings | {"seed": seed}
                unmatched = experiment.fit(f"{name} {seed}", model, train, seeded).block
                pair = unmatched, matched(unmatched, train)
                errors.append([_free_run_errors(model, train, test) for model in pair])
                models.append(pair)
            except MckibbenError as error:
                failures.append(str(error))
                errors.append([FAILED, FAILED])
        first = models[0] if models else None
        results[name] = MethodResult(first, np.array(errors).swapaxes(0, 1), failures)
    return results


def _free_run_errors(model: Block, *recordings: Recording) -> list[float]:
    errors: list[float] = []
    with np.errstate(over="ignore", invalid="ignore"):
        for recording in recordings:
            fit = score(recording["displacement"], model.simulate(recording)["displacement"])
            errors += [fit.rmse, 100 * fit.r2]
    if not np.isfinite(errors).all():
        raise ModelError(
            "its free run overflows", remedy="use fewer units or terms, or another seed"
        )
    return errors


def _error_tables(experiment: Experiment, results: Mapping[str, MethodResult]) -> None:
    columns = ("RMSE calibration [mm]", "fitness [%]", "RMSE test [mm]", "fitness [%] test")
    rows: dict[str, list[Cell]] = {}
    spread: list[list[Cell]] = []
    for name, result in results.items():
        n_seeds, n_failed = result.errors.shape[1], len(result.failures)
        reason = f"{n_failed} of {n_seeds} seeds: {result.failures[0]}" if result.failures else None
        rows[name] = [*finite(np.median(result.errors[1], axis=0)), reason]
        for match, errors in (("by range", result.errors[1]), ("none", result.errors[0])):
            rmses = errors[:, ::2]
            extremes = rmses.min(axis=0), np.where(np.isinf(rmses), -np.inf, rmses).max(axis=0)
            cells = finite(np.ravel([np.median(rmses, axis=0), *extremes], order="F"))
            spread.append([name, match, *cells, n_seeds - n_failed])
    experiment.table("errors", [*columns, "failed because"], rows, **experiment.facts)
    sides, statistics = ("calibration", "test"), ("median", "lowest", "highest")
    seed_columns = [f"RMSE {side} [mm], {way}" for side in sides for way in statistics]
    experiment.table(
        "seeds", ["match", *seed_columns, "seeds that worked"], spread, **experiment.facts
    )


def _parameter_tables(
    experiment: Experiment, fits: Mapping[str, MethodResult], step: float
) -> None:
    """Add Table 1, and the parameters of P2UZ, Box-Jenkins and PI with the printed ones."""
    models = {name: result.models for name, result in fits.items() if result.models is not None}
    match: dict[str, Any] = {name: pair[1].parts[1] for name, pair in models.items()}
    plain = {name: pair[0] for name, pair in models.items()}
    lines = {name: [line.gain, line.offset] for name, line in match.items()}
    experiment.table("match", ["a", "b [mm]"], lines)
    if P2UZ in plain:
        pair = experiment.paper.printed(PRINTED_P2UZ), plain[P2UZ]
        rows = {
            "K": [p2uz.gain for p2uz in pair],
            "T_z [s]": [p2uz.zero_time for p2uz in pair],
            "T_w [s]": [p2uz.time_constants[0] for p2uz in pair],
            "zeta": [p2uz.damping for p2uz in pair],
        }
        experiment.table("p2uz", ["printed", "here"], rows)
    if BJ in plain:
        bj = plain[BJ]
        monic = {"C": bj.noise_numerator, "D": bj.noise_denominator, "F": bj.denominator}
        terms: dict[str, list[Cell]] = {"B": [*map(float, bj.numerator)]}
        terms |= {name: [1.0, *map(float, values)] for name, values in monic.items()}
        experiment.table("bj", ["z^0", "z^-1", "z^-2"], terms, step=step)
    sources = {
        "share printed": experiment.paper.printed(PRINTED_PI),
        "share by slopes": plain.get(SLOPES),
        "share by least squares, ours": plain.get(LEAST_SQUARES),
    }
    shares = {n: np.divide(pi.weights, sum(pi.weights)).tolist() for n, pi in sources.items() if pi}
    thresholds = experiment.paper.models[PRINTED_PI]["thresholds"]
    weights = {f"{r:g}": row for r, *row in zip(thresholds, *shares.values(), strict=True)}
    experiment.table("weights", [*shares], weights)


def _field_table(experiment: Experiment, leaderboard: Leaderboard) -> None:
    columns = {
        "CV RMSE [mm]": "validation_rmse",
        "test RMSE [mm]": "test.rmse",
        "fit RMSE [mm]": "train.rmse",
        "R² [%]": "test.r2",
        "width reproduced [%]": "memory.gap_ratio",
        "width held [%]": "memory.hold_ratio",
        "parameters": "n_parameters",
    }
    rows: dict[str, list[Cell]] = {}
    for row in sorted(leaderboard.rows, key=lambda row: row.test_error):
        values = row.to_dict()
        cells = [
            _value_at(values, path, 100.0 if "[%]" in column else 1)
            for column, path in columns.items()
        ]
        rows[row.model] = [*cells, row.reason or None]
    experiment.table("field", [*columns, "failed because"], rows)


def _value_at(row: Mapping[str, Any], path: str, scale: float) -> Cell:
    value: Any = row
    for name in path.split("."):
        value = (value or {}).get(name)
    return None if value is None else scale * value


def _summarise(
    experiment: Experiment, results: Mapping[str, MethodResult], leaderboard: Leaderboard
) -> dict[str, Row]:
    """Set the summary's facts, and return the named models of the field.

    The field runs plain, so that is compared with the paper's methods run plain; their order is that of
    the paper's own errors, matched.
    """
    plain, matched_ = ({n: results[n].medians[k] for n in PAPERS} for k in (0, 1))
    printed = experiment.paper.tables["errors"].printed["RMSE test [mm]"]
    order, paper_order = (sorted(PAPERS, key=lambda n: by[n]) for by in (matched_, printed))
    n_good = sum(fitness > GOOD for _, fitness in matched_.values())
    experiment.add_facts(
        order=", ".join(f"{n} {matched_[n][0]:.2f} mm" for n in order),
        order_theirs=", ".join(paper_order),
        same_order=Verdict(order == paper_order),
        good=n_good,
        all_good=Verdict(n_good == len(PAPERS)),
    )
    usable = {name: test for name, (test, fitness) in plain.items() if fitness > 0}
    best = min(usable, key=usable.__getitem__, default=None)
    if best is not None:
        n_worked = len(results[best].errors[0]) - len(results[best].failures)
        errors = {"best_plain": plain[best][0], "best_matched": matched_[best][0]}
        experiment.add_facts(best=best, best_seeds=n_worked, **errors)
    charted = {}
    choice_key = "fitted" if leaderboard.chosen_by == "fit" else "chosen"
    for key, row in ((choice_key, leaderboard.best), ("lowest", leaderboard.lowest)):
        if row is not None and row.sound:
            experiment.add_facts(**{key: row.model, f"{key}_error": row.test_error})
            if best is not None:
                experiment.add_facts(**{f"{key}_ratio": row.test_error / usable[best]})
            charted[row.model] = row
    if leaderboard.not_recommended:
        experiment.add_facts(none=leaderboard.not_recommended)
    return charted


def _figures(
    experiment: Experiment,
    runs: Mapping[str, Recording],
    results: Mapping[str, MethodResult],
    charted: Mapping[str, Row],
) -> None:
    """Add signals, loops and responses."""
    paper_models = {name: pair[1] for name in PAPERS if (pair := results[name].models)}
    our_models: dict[str, Block] = {name: row.block for name, row in charted.items() if row.block}
    if (pair := results[LEAST_SQUARES].models) is not None:
        our_models[LEAST_SQUARES] = pair[0]
    experiment.figure(
        "signals", {which: {"": (r.time, r["pressure"])} for which, r in runs.items()}
    )
    loops = {which: {r.origin: (r["pressure"], r["displacement"])} for which, r in runs.items()}
    experiment.figure("loops", loops)
    for title, recording in runs.items():
        y = recording["displacement"]
        panels: dict[str, Curves] = {}
        for owner, models in (("the paper's methods", paper_models), ("ours", our_models)):
            outputs = {
                name: model.simulate(recording)["displacement"] for name, model in models.items()
            }
            panels[owner] = {
                name: (recording.time, output)
                for name, output in ({recording.origin: y} | outputs).items()
            }
        experiment.figure(title, panels)
