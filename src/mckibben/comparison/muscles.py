"""Models of several muscles, ranked on runs that they were not fitted to."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mckibben import registry
from mckibben.blocks.base import Block
from mckibben.errors import DataError, MckibbenError
from mckibben.recording import Recording

Array = NDArray[np.float64]

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
    progress: Callable[[float, str], None] | None = None,
) -> tuple[MuscleRow, ...]:
    """Fit models of several muscles and rank them on other runs, free-running.

    Parameters
    ----------
    train, test : sequence of Recording
        Channels ``pressure_1`` ..., ``displacement_1`` ... and what schedules.
    validation : sequence of Recording
        To stop searches early.
    models : "all" or sequence of str
        Short names.
    settings : mapping of str to mapping, optional
        By model.
    seed : int
        Of everything random.
    progress : callable, optional
        Told the share of the work done, and what is next.

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
    names = registry.names("coupled") if models == "all" else tuple(models)
    classes = [registry.load("coupled", name) for name in names]
    rows = []
    for place, (name, estimator_class) in enumerate(zip(names, classes, strict=True)):
        if progress is not None:
            progress(place / len(names), name)
        try:
            given = {"seed": seed} | dict((settings or {}).get(name, {}))
            estimator = estimator_class(**given).fit(list(train), validation=list(validation))
            rows.append(_row(name, estimator, test))
        except MckibbenError as error:
            rows.append(MuscleRow(name, reason=str(error)))
        except Exception as error:  # one model must not take the comparison down, whatever it does
            rows.append(MuscleRow(name, reason=f"{type(error).__name__}: {error}"))
    return tuple(sorted(rows, key=lambda row: row.mean))


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
    """
    rows = []
    for run in train:
        name = f"{model} at {run[load].mean():.0f} {run.units[load]} ({run.name})"
        try:
            estimator = registry.load("estimators", model)(input=input, output=output, seed=seed)
            estimator.fit(run)
            block: Block = estimator.model_
            errors = np.concatenate([block.simulate(r)[output] - r[output] for r in test])
            rows.append(
                MuscleRow(
                    name,
                    block.n_parameters,
                    estimator.diagnostics_.seconds,
                    {output: estimator.diagnostics_.rmse},
                    {output: float(np.sqrt(np.mean(errors**2)))},
                    float(np.abs(errors).max()),
                    block,
                )
            )
        except MckibbenError as error:
            rows.append(MuscleRow(name, reason=str(error)))
    return tuple(rows)
