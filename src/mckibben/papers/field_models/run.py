"""Four methods on one recording, tested on another, and the whole field beside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.compose import Series
from mckibben.blocks.dynamics.process_model import ProcessModel
from mckibben.blocks.dynamics.transfer_function import TransferFunction
from mckibben.blocks.hysteresis.pi import PI
from mckibben.blocks.memoryless import Affine
from mckibben.comparison.leaderboard import Leaderboard, Row
from mckibben.comparison.ranking import compare
from mckibben.errors import DataError, MckibbenError, ModelError
from mckibben.estimators.core.estimator import Estimator
from mckibben.estimators.hysteresis.pi import PIEstimator
from mckibben.metrics import score
from mckibben.papers.experiment import Cell, Curves, Experiment, Labels, Rerun
from mckibben.papers.paper import paper
from mckibben.recording import Recording
from mckibben.registry import load
from mckibben.signals import reversals

SEEDS, QUICK_SEEDS = 10, 3
"""Seeds that each of the paper's methods is identified with."""

QUICK = ("balance", "bj", "cpi", "duhem", "gpi", "mpi", "oe", "p2uz", "pi", "preisach")
"""Models of the quick run."""

N_FOLDS = 4
"""Of the cross-validation that chooses a model of the field; the quick run has none."""

PRINTED_PI, PRINTED_P2UZ = "field-models-pi", "field-models-p2uz"
NARX, BJ, P2UZ, SLOPES = "NARX", "BJ", "P2UZ", "PI"
LEAST_SQUARES = "PI by least squares, ours"
PAPERS = (NARX, BJ, P2UZ, SLOPES)

NOTHING = (np.inf, -np.inf, np.inf, -np.inf)
"""Errors of no model."""


def methods(seed: int) -> dict[str, Estimator]:
    """Return the paper's four methods as published, and its PI model by least squares.

    Of the NARX model the paper prints neither regressors nor mapping: this one is a sigmoid network on
    two past outputs and inputs, one sample late, fitted to one-step errors, of five starts the one with
    the least free-running error. Box-Jenkins has the printed orders, Eqs. (6) to (9): B has terms in q^0
    and q^-2. Like P2UZ it starts at rest, as the muscle does. PI has the printed thresholds, and weights
    by the slopes of segments, Eqs. (14) and (15).
    """
    thresholds = paper("field-models").models[PRINTED_PI]["thresholds"]
    return {
        NARX: load("estimators", "narx-network")(
            n_units=10, delay=1, refine=False, allow_unstable=True, n_starts=5, seed=seed
        ),
        BJ: load("estimators", "bj")(lags=(0, 2), initial="first_sample", seed=seed),
        P2UZ: load("estimators", "p2uz")(initial="first_sample", seed=seed),
        SLOPES: PIEstimator(thresholds=thresholds, method="slopes", seed=seed),
        LEAST_SQUARES: PIEstimator(thresholds=thresholds, seed=seed),
    }


@dataclass(frozen=True)
class Tried:
    """What came of one method.

    Parameters
    ----------
    matched, plain : Block or None
        Found with the first seed that gave one, with the paper's match behind and without.
    matched_errors, plain_errors : array, shape (seeds, 4)
        RMSE [mm] and fitness [%] on calibration, then on test; infinite where there is no model, or its
        free run overflows.
    failures : tuple of str
        Why, one a seed that failed.
    """

    matched: Series | None
    plain: Block | None
    matched_errors: Array
    plain_errors: Array
    failures: tuple[str, ...]

    @property
    def lowest_test(self) -> float | None:
        """The lower median test RMSE of plain and matched [mm].

        None where most seeds failed, or are worse than the mean of what was measured: what is broken is
        nothing to compare with.
        """
        medians = [median(self.plain_errors), median(self.matched_errors)]
        return min((one[2] for one in medians if one is not None and one[3] > 0), default=None)

    @property
    def reason(self) -> str:
        """Why it failed, and how often."""
        if not self.failures:
            return ""
        return f"{len(self.failures)} of {len(self.plain_errors)} seeds: {self.failures[0]}"


def median(errors: Array) -> list[float] | None:
    """Return the median errors over all seeds, those that failed counted as the worst."""
    found = np.median(errors, axis=0)
    return found.tolist() if np.isfinite(found).all() else None


def run(experiment: Experiment) -> None:
    """Record the calibration and the test, and identify the paper's methods and the field."""
    runs = experiment.record(until=0.05)
    (train, *_), (test, *_) = runs.select("train"), runs.select("test")
    seeds = range(experiment.seed, experiment.seed + (QUICK_SEEDS if experiment.quick else SEEDS))
    tried = _tried(experiment, train, test, seeds)
    board = compare(
        train,
        test,
        models=QUICK if experiment.quick else "all",
        n_folds=0 if experiment.quick else N_FOLDS,
        seed=experiment.seed,
        jobs=experiment.jobs,
        folder=experiment.kept.inside("field"),
        progress=lambda now: experiment.within(0.3, 0.95)(now.done / now.total, str(now)),
    )
    if board.pending:
        raise KeyboardInterrupt
    experiment.says(seeds=f"{seeds[0]} to {seeds[-1]}", n_seeds=len(seeds))
    _errors_tables(experiment, tried)
    _parameters(experiment, tried)
    _board_table(experiment, board)
    shown = _summary(experiment, tried, board)
    _figures(experiment, (train, test), tried, shown)


def sort(recordings: Sequence[Recording]) -> list[Labels | None]:
    """Take what turns ever lower, or else the longest, to calibrate; the longest of the rest tests."""
    if len(recordings) < 2:
        raise DataError(
            "there is one recording",
            file=recordings[0].source,
            remedy="give one to calibrate and one to test, or cut it in two files",
        )

    def rank(one: Recording) -> tuple[bool, float]:
        pressure = one["pressure"]
        peaks = pressure[reversals(pressure)]
        peaks = peaks[peaks > pressure.mean()]
        rises = np.diff(peaks).max(initial=-np.inf)
        return bool(peaks.size > 2 and rises < 0.02 * np.ptp(pressure)), one.duration or len(one)

    train = max(recordings, key=rank)
    test = max((one for one in recordings if one is not train), key=lambda one: rank(one)[1])
    roles = {id(train): Labels("train", {}), id(test): Labels("test", {})}
    return [roles.get(id(one)) for one in recordings]


def matched(model: Block, recording: Recording) -> Series:
    """Return a model with the paper's match behind it, Eqs. (1) to (3): gain by ranges, then offset.

    Raises
    ------
    DataError
        If the model's output does not move.
    """
    x = model.simulate(recording.select([c.name for c in model.inputs]))[model.outputs[0].name]
    z = recording["displacement"]
    if np.ptp(x) == 0:
        raise DataError(
            "the model's output does not move on it, so there is nothing to match",
            file=recording.source,
            remedy="give another recording, or another model",
        )
    gain = float(np.ptp(z) / np.ptp(x))
    channel = model.outputs[0]
    return Series((model, Affine(gain, float(z[0] - gain * x[0]), channel, channel)))


def _tried(
    experiment: Experiment, train: Recording, test: Recording, seeds: range
) -> dict[str, Tried]:
    every = {seed: methods(seed) for seed in seeds}
    tell, names = experiment.within(0.05, 0.3), [*every[seeds[0]]]
    found: dict[str, Tried] = {}
    for place, name in enumerate(names):
        models: list[tuple[Series, Block]] = []
        errors, failures = [], []
        for at, seed in enumerate(seeds):
            tell((place + at / len(seeds)) / len(names), f"{name}, seed {seed}")
            try:
                plain = experiment.fit(f"{name} {seed}", every[seed][name], train).block
                both = matched(plain, train), plain
                errors.append(tuple(_errors(model, train, test) for model in both))
                models.append(both)
            except MckibbenError as error:
                failures.append(str(error))
                errors.append((NOTHING, NOTHING))
        model, plain_model = models[0] if models else (None, None)
        of_matched, of_plain = np.array(errors).swapaxes(0, 1)
        found[name] = Tried(model, plain_model, of_matched, of_plain, tuple(failures))
    return found


def _errors(model: Block, train: Recording, test: Recording) -> tuple[float, ...]:
    found: list[float] = []
    with np.errstate(over="ignore", invalid="ignore"):
        for recording in (train, test):
            scored = score(recording["displacement"], model.simulate(recording)["displacement"])
            found += [scored.rmse, 100 * scored.r2]
    if not np.isfinite(found).all():
        raise ModelError(
            "its free run overflows. Remedy: use fewer units or terms, or another seed."
        )
    return tuple(found)


def _errors_tables(experiment: Experiment, tried: Mapping[str, Tried]) -> None:
    columns = ("RMSE calibration [mm]", "fitness [%]", "RMSE test [mm]", "fitness [%] test")
    rows: dict[str, list[Cell]] = {}
    for name, one in tried.items():
        cells: Sequence[Cell] = median(one.matched_errors) or (None,) * 4
        rows[name] = [*cells, one.reason or None]
    experiment.table("errors", [*columns, "failed because"], rows, **experiment.facts)
    spread: list[list[Cell]] = []
    for name, one in tried.items():
        for match, errors in (("by range", one.matched_errors), ("none", one.plain_errors)):
            worked = np.isfinite(errors[:, 0])
            cells = []
            for column in (errors[:, 0], errors[:, 2]):
                ends = (
                    (column[worked].min(), column[worked].max()) if worked.any() else (None, None)
                )
                middle = float(np.median(column))
                cells += [middle if np.isfinite(middle) else None, *ends]
            spread.append([name, match, *cells, len(errors) - len(one.failures)])
    ways = [
        f"RMSE {on} [mm], {way}"
        for on in ("calibration", "test")
        for way in ("median", "lowest", "highest")
    ]
    experiment.table("seeds", ["match", *ways, "seeds that worked"], spread, **experiment.facts)


def _parameters(experiment: Experiment, tried: Mapping[str, Tried]) -> None:
    """Add Table 1, and the parameters of P2UZ, Box-Jenkins and PI beside the printed."""
    match = {name: one.matched.parts[1] for name, one in tried.items() if one.matched is not None}
    experiment.table(
        "match",
        ["a", "b [mm]"],
        {name: [m.gain, m.offset] for name, m in match.items() if isinstance(m, Affine)},
    )
    printed, found = experiment.paper.printed(PRINTED_P2UZ), tried[P2UZ].plain
    if isinstance(found, ProcessModel):
        rows: dict[str, list[Cell]] = {
            "K": [printed.gain, found.gain],
            "T_z [s]": [printed.zero_time, found.zero_time],
            "T_w [s]": [printed.time_constants[0], found.time_constants[0]],
            "zeta": [printed.damping, found.damping],
        }
        experiment.table("p2uz", ["printed", "here"], rows)
    linear = tried[BJ].plain
    if isinstance(linear, TransferFunction):
        polynomials = {
            "B": linear.numerator,
            "C": linear.noise_numerator,
            "D": linear.noise_denominator,
            "F": linear.denominator,
        }
        terms = {
            name: [*map(float, values), None, None][:3] for name, values in polynomials.items()
        }
        experiment.table("bj", ["z^0", "z^-1", "z^-2"], terms)
    models = [experiment.paper.printed(PRINTED_PI), tried[SLOPES].plain, tried[LEAST_SQUARES].plain]
    columns = ["share printed", "share by slopes", "share by least squares, ours"]
    shares = {
        column: (np.array(model.weights) / np.sum(model.weights)).tolist()
        for column, model in zip(columns, models, strict=True)
        if isinstance(model, PI)
    }
    thresholds = experiment.paper.models[PRINTED_PI]["thresholds"]
    rows_of = {f"{r:g}": row for r, *row in zip(thresholds, *shares.values(), strict=True)}
    experiment.table("weights", [*shares], rows_of)


def _board_table(experiment: Experiment, board: Leaderboard) -> None:
    columns = {
        "CV RMSE [mm]": "validation_rmse" if board.chosen_by != "fit" else "",
        "test RMSE [mm]": "test.rmse",
        "fit RMSE [mm]": "train.rmse",
        "R² [%]": "test.r2",
        "width reproduced [%]": "memory.gap_ratio",
        "width held [%]": "memory.hold_ratio",
        "parameters": "n_parameters",
    }
    rows: dict[str, list[Cell]] = {}
    for row in sorted(board.rows, key=lambda row: row.test_error):
        given = row.to_dict()
        cells = [_inside(given, at, 100.0 if "[%]" in of else 1) for of, at in columns.items()]
        rows[row.model] = [*cells, row.reason or None]
    experiment.table("field", [*columns, "failed because"], rows)


def _inside(row: Mapping[str, Any], path: str, scale: float) -> Cell:
    found: Any = row
    for name in path.split("."):
        found = (found or {}).get(name)
    return None if found is None else scale * found


def _summary(
    experiment: Experiment, tried: Mapping[str, Tried], board: Leaderboard
) -> dict[str, Row]:
    """Give what came out, and return the models of the field that are named, each by its name."""
    worked = {name: low for name in PAPERS if (low := tried[name].lowest_test) is not None}
    name = min(worked, key=worked.__getitem__, default=None)
    if name is not None:
        experiment.says(best=name, best_error=worked[name])
    shown = {}
    for key, row in (("chosen", board.best), ("lowest", board.lowest)):
        if row is not None and row.sound and row.test is not None:
            key = "fitted" if key == "chosen" and board.chosen_by == "fit" else key
            experiment.says(**{key: row.model, f"{key}_error": row.test.rmse})
            if name is not None:
                experiment.says(**{f"{key}_ratio": row.test.rmse / worked[name]})
            shown[row.model] = row
    if board.not_recommended:
        experiment.says(none=board.not_recommended)
    return shown


def _figures(
    experiment: Experiment,
    recordings: tuple[Recording, Recording],
    tried: Mapping[str, Tried],
    shown: Mapping[str, Row],
) -> None:
    paper = {name: tried[name].matched for name in PAPERS}
    ours = {row.model: row.block for row in shown.values()}
    ours[LEAST_SQUARES] = tried[LEAST_SQUARES].plain
    both = dict(zip(("calibration", "test"), recordings, strict=True))
    experiment.figure(
        "signals", {title: {"": (run.time, run["pressure"])} for title, run in both.items()}
    )
    experiment.figure(
        "loops",
        {t: {run.origin: (run["pressure"], run["displacement"])} for t, run in both.items()},
    )
    for title, run in both.items():
        panels: dict[str, Curves] = {
            whose: {run.origin: (run.time, run["displacement"])} | _outputs(run, models)
            for whose, models in (("the paper's methods", paper), ("ours", ours))
        }
        experiment.figure(title, panels)


def _outputs(
    recording: Recording, models: Mapping[str, Block | None]
) -> dict[str, tuple[Array, Array]]:
    """Return what models give over time; those far out of the measured range would hide the others."""
    found = {}
    measured = recording["displacement"]
    for name, model in models.items():
        if model is not None:
            modelled = model.simulate(recording)["displacement"]
            if np.abs(modelled - measured.mean()).max() < 2 * np.ptp(measured):
                found[name] = (recording.time, modelled)
    return found


RERUN = Rerun(run, sort)
