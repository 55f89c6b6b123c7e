"""Identification of a model family, with orders chosen by cross-validated free-running error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from mckibben import registry
from mckibben.comparison.channels import Channels
from mckibben.comparison.fitting import (
    Data,
    FitResult,
    Item,
    Task,
    effort_of,
    processes_for,
    results,
    squares_of,
    validated,
)
from mckibben.comparison.splits import folds, given_split
from mckibben.errors import ModelError
from mckibben.estimators.core.estimator import Estimator
from mckibben.recording import Recording, listed
from mckibben.system.progress import Tell, telling
from mckibben.system.workers import checked


@dataclass(frozen=True)
class Identified:
    """Result of `identify`.

    Parameters
    ----------
    estimator : Estimator
        Fitted to all recordings with the orders chosen; its block is ``model_``.
    orders : mapping
        The orders chosen.
    tried : tuple of (mapping, float, str)
        All orders with their cross-validated free-run RMSE, infinite where they failed, and why.
    """

    estimator: Estimator
    orders: Mapping[str, Any]
    tried: tuple[tuple[Mapping[str, Any], float, str], ...]


def identify(
    recordings: Recording | Sequence[Recording],
    family: str,
    orders: Mapping[str, Sequence[Any]] | None = None,
    *,
    n_folds: int = 4,
    jobs: int | None = None,
    progress: bool | Tell | None = None,
    **settings: Any,
) -> Identified:
    """Identify a model family, with orders chosen by cross-validated free-running error.

    Parameters
    ----------
    recordings : Recording or sequence of Recording
        Folds are recordings, or blocks of cycles of a single one.
    family : str
        Short name of a model, such as ``"oe"``.
    orders : mapping of str to sequence, optional
        Setting -> values to try; every combination is. Default: what is usual for the family.
    n_folds : int
        Parts of the cross-validation, at least 2.
    jobs : int, optional
        Processes; default as many as there are cores, or none for little work.
    progress : bool or callable, optional
        Whether to show a bar; or a callback for the share done, and a text.
    **settings
        Further settings of the estimator.

    Returns
    -------
    Identified

    Raises
    ------
    ModelError
        On an unknown family, a family without default orders if none are given, or where every
        combination fails.
    """
    estimator_class = registry.load("estimators", family)
    grid = orders or estimator_class.param_grid
    if not grid:
        raise ModelError(
            f"{family!r} has no default orders",
            remedy="give orders, settings with the values to try",
        )
    runs = listed(recordings)
    channels = _channels(estimator_class(**settings), runs)
    parts = tuple(folds(runs, channels.inputs[0], max(n_folds, 2)))
    data = Data(given_split(runs, ()), parts, channels)
    orders_tried = [dict(zip(grid, values, strict=True)) for values in product(*grid.values())]
    every = tuple(range(len(parts)))
    tasks = [Task(family, Item(family, settings | one), every, whole=False) for one in orders_tried]
    n = checked(jobs) or processes_for(effort_of(family, data) * len(parts) * len(tasks))
    found: dict[int, FitResult] = {}
    with telling(progress, f"identifying {family}") as tell:
        for outcome in results(data, tasks, n):
            found[outcome.index] = outcome.result()
            if tell is not None:
                tell(len(found) / len(tasks), f"{len(found)} of {len(tasks)} orders")
    tried = []
    for place, one in enumerate(orders_tried):
        reason = found[place].invalid or found[place].reason or ""
        squares = None if reason else squares_of(data, found[place].predictions)
        errors = [np.inf] if squares is None else list(validated(data, squares).values())
        tried.append((one, float(np.mean(errors)), reason))
    best, lowest, reason = min(tried, key=lambda item: item[1])
    if not np.isfinite(lowest):
        raise ModelError(
            f"every order of {family!r} failed: {reason}",
            remedy="give other orders, or other recordings",
        )
    fitted: Estimator = estimator_class(**settings, **best).fit(runs)
    return Identified(fitted, best, tuple(tried))


def _channels(estimator: Estimator, recordings: Sequence[Recording]) -> Channels:
    if isinstance(estimator.input, str) and isinstance(estimator.output, str):
        return Channels((estimator.input,), (estimator.output,))
    data = estimator.data(recordings)
    names = ([channel.name for channel in of] for of in (data.inputs, data.outputs, data.scheduled))
    return Channels(*map(tuple, names))
