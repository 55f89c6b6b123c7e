"""Paper B again: four models of a muscle with a hanging load, and the whole field beside them.

Source: "Analysis and modeling of a pneumatic artificial muscle system".
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.hysteresis.pi import PI
from mckibben.checkpoints import Checkpoints
from mckibben.comparison.leaderboard import Leaderboard, Row
from mckibben.comparison.ranking import compare
from mckibben.errors import MckibbenError, ModelError
from mckibben.metrics import score
from mckibben.papers.field_models.affine_match import affine_match
from mckibben.papers.field_models.methods import (
    LEAST_SQUARES,
    NOTHING,
    PRINTED,
    Errors,
    Tried,
    published,
)
from mckibben.papers.field_models.published import THRESHOLDS, prandtl_ishlinskii
from mckibben.papers.keeping import fitted
from mckibben.papers.reproduction import (
    Cell,
    Figure,
    Points,
    Progress,
    Reproduction,
    Source,
    Table,
    thinned,
)
from mckibben.recording import Recording
from mckibben.rigs import record

SOURCE = Source(
    "Analysis and modeling of a pneumatic artificial muscle system",
    "Which of four models comes closest to a muscle that lifts 20 kg: NARX, Box-Jenkins, "
    "Prandtl-Ishlinskii, or a second-order process with a zero?",
    authors="Vinh-Phuc Tran, Chanh-Nghiem Nguyen, and others",
)

SEEDS, QUICK_SEEDS = 10, 3
"""Seeds that each of the paper's methods is identified with."""

QUICK = ("balance", "bj", "cpi", "duhem", "gpi", "mpi", "oe", "p2uz", "pi", "preisach")
"""Models of the quick run."""

N_FOLDS = 4
"""Of the cross-validation that chooses a model of the field; the quick run has none."""


def field_models(
    *,
    quick: bool,
    seed: int,
    jobs: int | None,
    tell: Progress,
    kept: Checkpoints,
    train: Recording | None = None,
    test: Recording | None = None,
) -> Reproduction:
    """Run the calibration and test of the rig, or given ones: the paper's methods, and the field."""
    if train is None or test is None:
        tell(0.0, "recording")
        recordings = {run.name: recording for run, recording in record("field-models", seed=seed)}
        train, test = recordings["decaying-triangle"], recordings["irregular-triangle"]
    seeds = range(seed, seed + (QUICK_SEEDS if quick else SEEDS))
    tried = _as_published(train, test, seeds, tell, kept)
    tell(0.3, "the whole field")
    board = compare(
        train,
        test,
        models=QUICK if quick else "all",
        n_folds=0 if quick else N_FOLDS,
        seed=seed,
        jobs=jobs,
        folder=kept.inside("field"),
        progress=lambda standing: tell(0.3 + 0.65 * standing.done / standing.total, str(standing)),
    )
    if board.pending:
        raise KeyboardInterrupt
    shown = _shown(board)
    return Reproduction(
        name="field-models",
        source=SOURCE,
        summary=_summary(tried, board, len(seeds)),
        tables=(
            _table_2(tried, seeds),
            _by_seed(tried, seeds),
            _weights(tried),
            _leaderboard(board),
        ),
        figures=_figures(train, test, tried, shown),
        notes=(
            "The rig's physics is not the paper's muscle: levels differ, the order of methods may.",
            "The paper does not print its signals: peaks and turning points are ours.",
            "Of the NARX model the paper prints no regressors, lags or mapping, only the toolbox that "
            "made it: ours is a network of ten sigmoids on two past outputs and two past inputs, fitted "
            "to one-step errors; of five starts, the one that runs free best over the calibration.",
            "Matched as in the paper: gain by ranges, offset by first samples of the calibration. Its "
            "Eq. (2) prints the offset as z(0) - x(0); with the gain in it, first samples do agree.",
            "PI by slopes: the paper does not say which branches its segments are of; here it is the "
            "longest rise and fall together. Slopes are pooled where weights would be negative.",
            "A model whose free run is out of all bounds keeps its errors in the tables; figures leave "
            "it out.",
        ),
    )


def _as_published(
    train: Recording, test: Recording, seeds: range, tell: Progress, kept: Checkpoints
) -> dict[str, Tried]:
    methods = {seed: published(seed) for seed in seeds}
    names = list(published(0))
    found: dict[str, Tried] = {}
    for place, name in enumerate(names):
        models: list[tuple[Block, Block]] = []
        errors: list[tuple[Errors, Errors]] = []
        failures = []
        for at, seed in enumerate(seeds):
            tell(0.05 + 0.25 * (place + at / len(seeds)) / len(names), f"{name}, seed {seed}")
            try:
                plain = fitted(kept, f"{name} {seed}", methods[seed][name], train).block
                matched = affine_match(plain, train, "range")
                errors.append((_errors(matched, train, test), _errors(plain, train, test)))
                models.append((matched, plain))
            except MckibbenError as error:
                failures.append(str(error))
                errors.append((NOTHING, NOTHING))
        model, plain_model = models[0] if models else (None, None)
        matched_errors, plain_errors = np.array(errors).swapaxes(0, 1)
        found[name] = Tried(model, plain_model, matched_errors, plain_errors, tuple(failures))
    return found


def _errors(model: Block, train: Recording, test: Recording) -> Errors:
    found = []
    with np.errstate(over="ignore", invalid="ignore"):
        for recording in (train, test):
            scored = score(recording["displacement"], model.simulate(recording)["displacement"])
            found += [scored.rmse, 100 * scored.r2]
    if not np.isfinite(found).all():
        raise ModelError(
            "its free run overflows. Remedy: use fewer units or terms, or another seed."
        )
    return found[0], found[1], found[2], found[3]


def _shown(board: Leaderboard) -> dict[str, Row]:
    """Return the models of the field that the summary names, by how they were chosen."""
    named = {
        f"Chosen from the field by {board.chosen_by}": board.best,
        "Lowest test error in the field, known only from the test itself": board.lowest,
    }
    return {how: row for how, row in named.items() if row is not None and row.sound}


def _summary(tried: Mapping[str, Tried], board: Leaderboard, n_seeds: int) -> tuple[str, ...]:
    medians = {name: tried[name].lowest_test for name in PRINTED}
    worked = {name: median for name, median in medians.items() if median is not None}
    name = min(worked, key=worked.__getitem__, default=None)
    sentences = []
    if name is not None:
        sentences.append(
            f"Of the paper's methods as published, {name} has the lowest test error: median of "
            f"{n_seeds} seeds {worked[name]:.2f} mm RMSE, the lower of plain and matched."
        )
    shown = _shown(board)
    for how, row in shown.items():
        assert row.test is not None
        times = "" if name is None else f", {row.test.rmse / worked[name]:.2f} times {name}'s"
        sentences.append(f"{how}: {row.model}, {row.test.rmse:.3f} mm on the test{times}.")
    if board.not_recommended:
        sentences.append(f"None of the field beats the mean in {board.not_recommended}.")
    failed = [f"{name} failed in {one.reason}" for name, one in tried.items() if one.failures]
    return (*sentences, *failed)


def _table_2(tried: Mapping[str, Tried], seeds: range) -> Table:
    columns = ("RMSE calibration [mm]", "fitness [%]", "RMSE test [mm]", "fitness [%] test")
    headings = [f"{column}, {which}" for column in columns for which in ("printed", "here")]
    rows: list[tuple[Cell, ...]] = []
    for name, one in tried.items():
        printed: Sequence[Cell] = PRINTED.get(name, (None,) * 4)
        here: Sequence[Cell] = one.median(one.matched_errors) or (None,) * 4
        pairs = [cell for pair in zip(printed, here, strict=True) for cell in pair]
        rows.append((name, *pairs, one.reason))
    return Table(
        "The paper's methods (its Table 2)",
        ("model", *headings, "failed because"),
        tuple(rows),
        "Printed: the paper's rig. Here: the same methods on these recordings, each matched by range "
        "and first sample of the calibration, run free from their own start; median over seeds "
        f"{seeds[0]} to {seeds[-1]}. Fitness is R² times 100.",
        Points("RMSE on the test [mm]", ("RMSE test [mm], printed", "RMSE test [mm], here")),
    )


def _by_seed(tried: Mapping[str, Tried], seeds: range) -> Table:
    ways = ("median", "lowest", "highest")
    rows: list[tuple[Cell, ...]] = []
    for name, one in tried.items():
        for match, errors in (("by range", one.matched_errors), ("none", one.plain_errors)):
            spread = [
                float(value) if np.isfinite(value) else None
                for column in (errors[:, 0], errors[:, 2])
                for value in (np.median(column), column.min(), _highest(column))
            ]
            rows.append((name, match, *spread, len(errors) - len(one.failures)))
    return Table(
        "The same by seed, matched as in the paper and plain",
        (
            *("model", "match"),
            *(f"RMSE calibration [mm], {way}" for way in ways),
            *(f"RMSE test [mm], {way}" for way in ways),
            "seeds that worked",
        ),
        tuple(rows),
        f"Seeds {seeds[0]} to {seeds[-1]} of what is random in the method, on the same recordings. "
        "Plain is the model as identified, in mm. In the median a seed that failed counts as the worst; "
        "lowest and highest are of those that worked.",
    )


def _highest(column: Array) -> float:
    """Return the highest finite number, or minus infinity where there is none."""
    return float(column[np.isfinite(column)].max(initial=-np.inf))


def _weights(tried: Mapping[str, Tried]) -> Table:
    """Return the PI models' weights as shares of their sums: their scale is the match's."""
    printed = prandtl_ishlinskii()
    models = [printed, tried["PI by slopes"].plain, tried[LEAST_SQUARES].plain]
    shares = [
        np.array(model.weights) / np.sum(model.weights)
        if isinstance(model, PI)
        else [None] * len(THRESHOLDS)
        for model in models
    ]
    rows = [(r, *row) for r, *row in zip(THRESHOLDS, *shares, strict=True)]
    return Table(
        "Weights of the PI models (its Eqs. 16 and 17)",
        ("threshold [bar]", "share printed", "share by slopes", "share by least squares, ours"),
        tuple(tuple(None if cell is None else float(cell) for cell in row) for row in rows),
        "Shares of the sum of weights, the slope at the end of a long branch. The reversible weight and "
        "that of threshold 0 are one.",
    )


def _inside(row: Mapping[str, Any], path: str, scale: float) -> Cell:
    found: Any = row
    for name in path.split("."):
        found = (found or {}).get(name)
    return None if found is None else scale * found


def _leaderboard(board: Leaderboard) -> Table:
    validated = [("CV RMSE [mm]", "validation_rmse")] if board.chosen_by != "fit" else []
    columns = [
        *validated,
        ("test RMSE [mm]", "test.rmse"),
        ("fit RMSE [mm]", "train.rmse"),
        ("R² [%]", "test.r2"),
        ("width reproduced [%]", "memory.gap_ratio"),
        ("width held [%]", "memory.hold_ratio"),
        ("parameters", "n_parameters"),
    ]
    rows: list[tuple[Cell, ...]] = []
    for row in sorted(board.rows, key=lambda row: row.test_error):
        cells = [_inside(row.to_dict(), path, 100.0 if "[%]" in of else 1) for of, path in columns]
        rows.append((row.model, *cells, row.reason))
    return Table(
        "The whole field on the same data, lowest test error first",
        ("model", *(heading for heading, _ in columns), "failed because"),
        tuple(rows),
        "Free-running, plain; cross-validated within the calibration run (not in the quick run). Width "
        "reproduced: the model's gaps between branches over the recorded ones (100 % is exact); width "
        "held: what is left of the model's own gap in a hold.",
    )


def _figures(
    train: Recording, test: Recording, tried: Mapping[str, Tried], shown: Mapping[str, Row]
) -> tuple[Figure, ...]:
    paper = {name: tried[name].model for name in PRINTED}
    ours = {row.model: row.block for row in shown.values()} | {
        LEAST_SQUARES: tried[LEAST_SQUARES].plain
    }
    figures = []
    for title, run, place in (("Calibration", train, 3), ("Test", test, 4)):
        measured = (thinned(run.time), thinned(run["displacement"]))
        figures += [
            Figure(
                f"{title}: pressure (its Figure 2)",
                "time [s]",
                "pressure [bar]",
                {"": (measured[0], thinned(run["pressure"]))},
            ),
            Figure(
                f"{title}: loops",
                "pressure [bar]",
                "displacement [mm]",
                {run.origin: (thinned(run["pressure"]), measured[1])},
            ),
            Figure(
                f"{title}: the paper's methods, matched by range (its Figure {place})",
                "time [s]",
                "displacement [mm]",
                {run.origin: measured} | _outputs(run, paper),
            ),
            Figure(
                f"{title}: ours",
                "time [s]",
                "displacement [mm]",
                {run.origin: measured} | _outputs(run, ours),
            ),
        ]
    return tuple(figures)


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
                found[name] = (thinned(recording.time), thinned(modelled))
    return found
