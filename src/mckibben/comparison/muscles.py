"""Models of several muscles, ranked on runs that they were not fitted to."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from mckibben import registry
from mckibben.blocks.base import Block
from mckibben.comparison.kept import Kept
from mckibben.comparison.results import Standing
from mckibben.errors import DataError, MckibbenError
from mckibben.estimators.search import whole_searches
from mckibben.recording import Recording
from mckibben.threads import cores
from mckibben.workers import Tell, all_of, checked, outcomes

Array = NDArray[np.float64]
Runs = tuple[Recording, ...]
Data = tuple[Runs, Runs, Runs]
"""To fit, to test on, and to validate with."""

Item = tuple[str, Mapping[str, Any]]
"""A model's short name, and its settings."""

QUICK = ("coupled-memory", "coupled-pi", "force-balance")
"""Models that are fitted in seconds."""

HELD_OUT = 3
"""Every so many-th level of what schedules, or run, is held out where no test runs are given."""


@dataclass(frozen=True)
class MuscleRow:
    """One model.

    Parameters
    ----------
    model : str
        Short name.
    n_parameters : int
    seconds : float
        Of the fit.
    train, test : mapping of str to float
        Free-running RMSE of every displacement [mm].
    worst : float
        Largest error on the test runs [mm].
    block : Block or None
    inverse : Block or None
        Where it has one.
    reason : str or None
        Why it failed.
    """

    __pydantic_config__: ClassVar[dict[str, bool]] = {"arbitrary_types_allowed": True}

    model: str
    n_parameters: int = 0
    seconds: float = 0.0
    train: Mapping[str, float] = field(default_factory=dict)
    test: Mapping[str, float] = field(default_factory=dict)
    worst: float = float("inf")
    block: Block | None = None
    inverse: Block | None = None
    reason: str | None = None

    @property
    def mean(self) -> float:
        """Mean test RMSE over all displacements [mm]."""
        return float(np.mean(list(self.test.values()))) if self.test else float("inf")

    def to_dict(self) -> dict[str, Any]:
        """Return the row as ``leaderboard.json`` holds it."""
        return {
            "model": self.model,
            "n_parameters": self.n_parameters,
            "fit_seconds": self.seconds,
            "train": dict(self.train),
            "test": dict(self.test),
            "worst": self.worst if np.isfinite(self.worst) else None,
            "invertible": self.inverse is not None,
            "reason": self.reason,
        }


def compare_muscles(
    train: Sequence[Recording],
    test: Sequence[Recording],
    *,
    validation: Sequence[Recording] = (),
    models: str | Sequence[str] = "all",
    settings: Mapping[str, Mapping[str, Any]] | None = None,
    seed: int = 0,
    jobs: int | None = None,
    folder: str | Path | None = None,
    progress: Callable[[Standing], None] | None = None,
    found: Callable[[tuple[MuscleRow, ...]], None] | None = None,
) -> tuple[MuscleRow, ...]:
    """Fit models of several muscles and rank them on other runs, free-running.

    Parameters
    ----------
    train, test : sequence of Recording
        Channels ``pressure_1`` ..., ``displacement_1`` ... and what schedules.
    validation : sequence of Recording
        To stop searches early.
    models : "all", "quick" or sequence of str
        Short names.
    settings : mapping of str to mapping, optional
        By model.
    seed : int
        Of everything random.
    jobs : int, optional
        Processes; default as many as there are cores and models.
    folder : path, optional
        Where finished models are kept, so that a comparison that was stopped goes on from there;
        whoever calls clears it.
    progress : callable, optional
        Told how far it is.
    found : callable, optional
        Told the rows so far, whenever a model is finished.

    Returns
    -------
    tuple of MuscleRow
        Best first; models that failed last, with their reasons.

    Raises
    ------
    DataError
        If there is nothing to test on.
    """
    if not test:
        raise DataError("there is no run to test on", remedy="give --test, or more runs")
    names = {"all": registry.names("coupled"), "quick": QUICK}.get(str(models), tuple(models))
    efforts = {name: registry.load("coupled", name).effort for name in names}
    items = [
        (name, {"seed": seed} | dict((settings or {}).get(name, {})))
        for name in sorted(names, key=efforts.__getitem__)
    ]
    data = (tuple(train), tuple(test), tuple(validation))
    kept = Kept(folder, data)
    found_before = {name: kept.get(name, MuscleRow, own) for name, own in items}
    rows = {
        name: row
        for name, row in found_before.items()
        if row is not None and row.model == name and row.block is not None
    }
    remaining = [item for item in items if item[0] not in rows]
    begun: list[str] = []

    def ranked() -> tuple[MuscleRow, ...]:
        return tuple(sorted(rows.values(), key=lambda row: row.mean))

    def told(index: int, *_: Any) -> None:
        begun.append(remaining[index][0])
        tell()

    def tell() -> None:
        best = next((f"{row.model} {row.mean:.3g} mm" for row in ranked() if row.block), "")
        fitting = tuple(name for name in begun if name not in rows)
        if progress is not None:
            progress(Standing(len(rows), len(items), fitting, best))

    if rows:
        tell()
    for outcome in outcomes(_try, data, remaining, checked(jobs) or cores(), told):
        name, own = remaining[outcome.index]
        rows[name] = outcome.value or MuscleRow(name, reason=str(outcome.error))
        if rows[name].block is not None:
            kept.put(name, rows[name], own)
        tell()
        if found is not None:
            found(ranked())
    return ranked()


def _try(data: Data, item: Item, tell: Tell) -> MuscleRow:
    del tell
    (train, test, validation), (name, settings) = data, item
    try:
        estimator = registry.load("coupled", name)(**settings)
        return _row(name, estimator.fit(list(train), validation=list(validation)), test)
    except MckibbenError as error:
        return MuscleRow(name, reason=str(error))
    except Exception as error:  # one model must not take the comparison down, whatever it does
        return MuscleRow(name, reason=f"{type(error).__name__}: {error}")


def _row(name: str, estimator: Any, test: Sequence[Recording]) -> MuscleRow:
    block: Block = estimator.model_
    names = [channel.name for channel in block.outputs]
    outputs = [block.simulate(recording) for recording in test]
    errors = {
        channel: np.concatenate(
            [out[channel] - run[channel] for out, run in zip(outputs, test, strict=True)]
        )
        for channel in names
    }
    try:
        inverse: Block | None = block.inverse()
    except MckibbenError:
        inverse = None
    return MuscleRow(
        name,
        block.n_parameters,
        estimator.diagnostics_.seconds,
        dict(zip(names, estimator.diagnostics_.rmse, strict=True)),
        {channel: float(np.sqrt(np.mean(error**2))) for channel, error in errors.items()},
        float(max(np.abs(error).max() for error in errors.values())),
        block,
        inverse,
    )


def held_out_levels(
    recordings: Sequence[Recording], scheduling: str = "pressure_extensor"
) -> tuple[list[Recording], list[Recording], str]:
    """Return runs to fit and to test, and how they were chosen, in words.

    Every third level of what schedules, ends excepted, is tested on; without several levels, every
    third run.
    """
    if all(scheduling in recording for recording in recordings):
        means = [round(float(recording[scheduling].mean()), 1) for recording in recordings]
        levels = sorted(set(means))
        unseen = set(levels[1:-1][::HELD_OUT])
        if unseen:
            train = [r for r, m in zip(recordings, means, strict=True) if m not in unseen]
            test = [r for r, m in zip(recordings, means, strict=True) if m in unseen]
            listed = ", ".join(f"{level:g}" for level in sorted(unseen))
            return train, test, f"runs at {scheduling} {listed} bar held out"
    test = list(recordings[HELD_OUT - 1 :: HELD_OUT])
    train = [r for place, r in enumerate(recordings) if place % HELD_OUT != HELD_OUT - 1]
    return train, test, "every third run held out"


def per_load(
    train: Sequence[Recording],
    test: Sequence[Recording],
    *,
    load: str = "force",
    input: str = "voltage",  # noqa: A002
    output: str = "displacement",
    model: str = "mpi",
    seed: int = 0,
    jobs: int | None = None,
) -> tuple[MuscleRow, ...]:
    """Return one model of a single muscle for every load it was recorded under, tested on all loads.

    Parameters
    ----------
    train, test : sequence of Recording
        Each training run is taken to be at its mean load.
    load, input, output : str
        Channels.
    model : str
        Short name of the model to fit to each run.
    seed : int
        Of everything random.
    jobs : int, optional
        Processes; default as many as there are cores.
    """
    names = [f"{model} at {run[load].mean():.0f} {run.units[load]} ({run.name})" for run in train]
    how = {"input": input, "output": output, "seed": seed}
    items = [(name, model, how, run, tuple(test)) for name, run in zip(names, train, strict=True)]
    return tuple(all_of(_try_single, items, jobs))


def _try_single(common: None, item: Any, tell: Tell) -> MuscleRow:
    del common, tell
    name, model, how, run, test = item
    output = how["output"]
    try:
        with whole_searches():
            estimator = registry.load("estimators", model)(**how).fit(run)
    except MckibbenError as error:
        return MuscleRow(name, reason=str(error))
    block: Block = estimator.model_
    errors = np.concatenate([block.simulate(r)[output] - r[output] for r in test])
    return MuscleRow(
        name,
        block.n_parameters,
        estimator.diagnostics_.seconds,
        {output: estimator.diagnostics_.rmse},
        {output: float(np.sqrt(np.mean(errors**2)))},
        float(np.abs(errors).max()),
        block,
    )
