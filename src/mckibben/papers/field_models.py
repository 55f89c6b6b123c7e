"""Paper B again: four models of a muscle with a hanging load, and the whole field beside them.

Source: "Analysis and modeling of a pneumatic artificial muscle system".
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mckibben.blocks.base import Block
from mckibben.blocks.published.field_models import THRESHOLDS
from mckibben.comparison.kept import Kept
from mckibben.comparison.ranking import compare
from mckibben.comparison.results import Leaderboard
from mckibben.errors import MckibbenError
from mckibben.estimators.affine_match import affine_match
from mckibben.estimators.base import Estimator
from mckibben.estimators.linear.models import BoxJenkinsEstimator
from mckibben.estimators.linear.process import P2UZEstimator
from mckibben.estimators.narx.network import NarxNetworkEstimator
from mckibben.estimators.pi import PIEstimator
from mckibben.metrics import score
from mckibben.papers.keeping import fitted
from mckibben.papers.reproduction import Cell, Figure, Progress, Reproduction, Table, thinned
from mckibben.recording import Recording
from mckibben.rigs import record

PRINTED = {
    "NARX": (1.90, 96.83, 2.10, 96.72),
    "Box-Jenkins": (3.25, 90.79, 3.17, 92.55),
    "P2UZ": (1.80, 97.15, 1.91, 97.31),
    "PI": (2.60, 94.08, 2.48, 95.44),
}
"""Table 2: RMSE [mm] and fitness [%] on calibration, then on test."""

QUICK = ("bj", "cpi", "duhem", "gpi", "grey-box", "mpi", "oe", "p2uz", "pi", "preisach")
"""Models of the quick run."""


def published(seed: int) -> dict[str, Estimator]:
    """Return the paper's four methods, as published.

    NARX is MATLAB's: a sigmoid network on two past outputs and inputs, one sample late, fitted to
    one-step errors, the best of five starts. PI has the thresholds printed, and non-negative weights by
    least squares, which do better here than slopes of segments.
    """
    return {
        "NARX": NarxNetworkEstimator(
            n_units=10, delay=1, refine=False, allow_unstable=True, n_starts=5, seed=seed
        ),
        "Box-Jenkins": BoxJenkinsEstimator(seed=seed),
        "P2UZ": P2UZEstimator(seed=seed),
        "PI": PIEstimator(thresholds=THRESHOLDS, seed=seed),
    }


def field_models(
    *,
    quick: bool,
    seed: int,
    jobs: int | None,
    tell: Progress,
    kept: Kept,
    train: Recording | None = None,
    test: Recording | None = None,
) -> Reproduction:
    """Run the calibration and test of the rig, or given ones: the paper's methods, and the field."""
    if train is None or test is None:
        tell(0.0, "recording")
        recordings = {run.name: recording for run, recording in record("field-models", seed=seed)}
        train, test = recordings["decaying-triangle"], recordings["irregular-triangle"]
    models, failures = _as_published(train, seed, tell, kept)
    tell(0.2, "the whole field")
    board = compare(
        train,
        test,
        models=QUICK if quick else "all",
        n_folds=0 if quick else 4,
        seed=seed,
        jobs=jobs,
        folder=kept.inside("field"),
        progress=lambda standing: tell(0.2 + 0.75 * standing.done / standing.total, str(standing)),
    )
    if board.pending:
        raise KeyboardInterrupt
    paper = {name: _errors(model, train, test) for name, model in models.items()}
    best = board.best
    assert best is not None
    assert best.test is not None
    assert best.block is not None
    lowest = min((row[2] for row in paper.values()), default=float("nan"))
    summary = [
        f"Best of the paper's methods as published: {lowest:.2f} mm RMSE on the test.",
        f"Best of the field: {best.model}, {best.test.rmse:.3f} mm, "
        f"{best.test.rmse / lowest:.2f} times that.",
        *failures,
    ]
    rows: list[tuple[Cell, ...]] = []
    for name, printed in PRINTED.items():
        ours = paper.get(name, (None,) * 4)
        rows.append((name, *_pairs(printed, ours)))
    columns = ("RMSE calibration [mm]", "fitness [%]", "RMSE test [mm]", "fitness [%] test")
    headings = [f"{column}, {which}" for column in columns for which in ("printed", "here")]
    table = Table(
        "The paper's methods (its Table 2)",
        ("model", *headings),
        tuple(rows),
        "Printed: the paper's rig. Here: the same methods on these recordings, each matched by range "
        "and first sample, run free from their own start. Fitness is R² times 100.",
    )
    outputs = dict(models) | {best.model: best.block}
    return Reproduction(
        name="field-models",
        title="Analysis and modeling of a pneumatic artificial muscle system",
        summary=tuple(summary),
        tables=(table, _leaderboard(board)),
        figures=_figures(train, test, outputs),
        notes=(
            "The rig's physics is not the paper's muscle: levels differ, the order of methods may.",
            "The paper does not print its signals: peaks and turning points are ours.",
            "A NARX model that leaves all bounds when it runs free is shown as it is.",
        ),
    )


def _as_published(
    train: Recording, seed: int, tell: Progress, kept: Kept
) -> tuple[dict[str, Block], list[str]]:
    models: dict[str, Block] = {}
    failures = []
    for place, (name, estimator) in enumerate(published(seed).items()):
        tell(0.05 + 0.04 * place, name)
        try:
            found = fitted(kept, name, estimator, train).block
            models[name] = affine_match(found, train, "range")
        except MckibbenError as error:
            failures.append(f"{name} failed here: {error}")
    return models, failures


def _errors(model: Block, train: Recording, test: Recording) -> tuple[float, float, float, float]:
    found = []
    for recording in (train, test):
        try:
            modelled = model.simulate(recording)["displacement"]
        except MckibbenError:
            found += [float("inf"), float("-inf")]
            continue
        scored = score(recording["displacement"], modelled)
        found += [scored.rmse, 100 * scored.r2]
    return found[0], found[1], found[2], found[3]


def _pairs(printed: Sequence[Cell], ours: Sequence[Cell]) -> list[Cell]:
    return [cell for pair in zip(printed, ours, strict=True) for cell in pair]


def _leaderboard(board: Leaderboard) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for row in board.rows:
        if row.test is None or row.train is None:
            rows.append((row.model, None, None, None, None, None, None, row.reason))
            continue
        memory = row.memory
        gap = None if memory is None else memory.gap_ratio
        hold = None if memory is None else memory.hold_ratio
        cells = (row.train.rmse, row.test.rmse, 100 * row.test.r2, gap, hold)
        rows.append((row.model, *cells, row.n_parameters, ""))
    return Table(
        "The whole field on the same data, best first",
        (
            *("model", "RMSE calibration [mm]", "RMSE test [mm]", "fitness test [%]"),
            *("branch gap kept", "kept in a hold", "parameters", "failed because"),
        ),
        tuple(rows),
        "Free-running; branch gap: slope of the model's gaps between branches over the measured ones "
        "(1 is perfect); hold: share of the model's own gap that survives a long hold.",
    )


def _figures(train: Recording, test: Recording, outputs: dict[str, Block]) -> tuple[Figure, ...]:
    def over_time(recording: Recording, channel: str) -> tuple[np.ndarray, np.ndarray]:
        return thinned(recording.time), thinned(recording[channel])

    figures = [
        Figure(f"{title}: {channel} (its Figure 2)", "time [s]", label, {"": over_time(r, channel)})
        for title, r in (("Calibration", train), ("Test", test))
        for channel, label in (
            ("pressure", "pressure [bar]"),
            ("displacement", "displacement [mm]"),
        )
    ]
    figures += [
        Figure(
            f"{title}: loops",
            "pressure [bar]",
            "displacement [mm]",
            {"measured": (thinned(r["pressure"]), thinned(r["displacement"]))},
        )
        for title, r in (("Calibration", train), ("Test", test))
    ]
    for name, model in outputs.items():
        try:
            modelled = model.simulate(test)["displacement"]
        except MckibbenError:
            continue
        figures.append(
            Figure(
                f"Test: measured and {name}",
                "time [s]",
                "displacement [mm]",
                {
                    "measured": over_time(test, "displacement"),
                    name: (thinned(test.time), thinned(modelled)),
                },
            )
        )
    return tuple(figures)
