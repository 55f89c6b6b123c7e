"""Prior of a muscle from the library: a Gaussian over its traits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import ValidationError
from scipy.special import stdtrit

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.muscles.library import FORMAT, Muscle, load, parsed
from mckibben.muscles.library import list as all_muscles
from mckibben.muscles.sheet import Sheet
from mckibben.muscles.traits import COUNT, PLACES, POSITIONS
from mckibben.system.validation import invalid

ALIKE = 0.1
"""Standard deviation of the logarithm among muscles of one make and size."""

CORRELATION_LENGTH = 0.25
"""Correlation length of the logarithm of size, slenderness and braid."""

ZERO = 0.03
"""Standard deviation of the origin of displacements, relative to the rest length."""

SMOOTH, FINE = 1.0, 0.03
"""Correlation length of a trait's numbers, in neighbours, and the independent part of each."""

FEWEST_MUSCLES = 3
"""Smallest number of muscles for estimating a spread."""

ONE_SIGMA_PROBABILITY = 0.8413
"""Probability that a normal variable is below one standard deviation."""

DEFAULT_SPREAD = 1.0
"""Spread assumed with fewer muscles."""


@dataclass(frozen=True)
class Prior:
    """Prior of a muscle's traits.

    The deviations of a name's traits (such as the friction after several travels) from their mean are
    a level that all have in common, a shape that is smooth along them, and an independent part.

    Parameters
    ----------
    sheet : Sheet
        Of the muscle.
    mean : array, shape (COUNT,)
        NaN where no muscle has the trait.
    levels, shapes : dict of str to float
        Standard deviations of the level and of the shape, by name of the traits.
    zero : float
        Standard deviation of the origin of displacements, relative to the muscle at rest [mm].
    """

    sheet: Sheet
    mean: Array
    levels: dict[str, float]
    shapes: dict[str, float]
    zero: float

    def covariance(self, name: str) -> Array:
        """Return the covariance of traits of a name: of level, shape and independent part."""
        positions = POSITIONS[name]
        distances = ((positions[:, np.newaxis] - positions) / SMOOTH) ** 2
        shape = self.shapes[name] ** 2 * np.exp(-0.5 * distances.sum(axis=2))
        return np.asarray(self.levels[name] ** 2 + shape + FINE**2 * np.eye(len(positions)))

    def weights(self) -> Array:
        """Return the whitening matrix: it maps deviations from the mean to unit covariance.

        Shape (traits with a mean, COUNT).
        """
        rows = []
        for name, columns in PLACES.items():
            finite = np.flatnonzero(np.isfinite(self.mean[columns]))
            factor = np.linalg.cholesky(self.covariance(name)[np.ix_(finite, finite)])
            part = np.zeros((finite.size, COUNT))
            part[:, finite + columns.start] = np.linalg.inv(factor)
            rows.append(part)
        return np.concatenate(rows)


def prior_of(given: str | Path | Sheet, *, without: Sequence[str] = ()) -> Prior:
    """Return the prior of a muscle from the library.

    Parameters
    ----------
    given : str, path or Sheet
        A muscle of the library, from which to begin; a data sheet, or its TOML file (or that of an
        identified muscle).
    without : sequence of str
        Names of muscles of the library to leave out.

    Raises
    ------
    DataError
        On an unknown name, or a file that is neither.
    """
    muscles = [muscle for muscle in all_muscles() if muscle.name not in without]
    if isinstance(given, Sheet):
        without = (*without, *(given.without or ()))
        like = load(given.like) if given.like else None
        muscles = [muscle for muscle in muscles if muscle.name not in without]
        return of_muscles(_with(like, muscles, without), given, like)
    path = Path(given)
    if path.suffix != ".toml":
        return of_muscles(muscles, load(given).sheet, load(given))
    content = parsed(path)
    if content.get("format") == FORMAT:
        own = load(path)
        return of_muscles(_with(own, muscles, without), own.sheet, own)
    try:
        sheet = Sheet.model_validate(content)
    except ValidationError as error:
        raise invalid(error, path, "give [sheet] as files of the library have it") from None
    return prior_of(sheet, without=without)


def _with(own: Muscle | None, muscles: list[Muscle], without: Sequence[str]) -> list[Muscle]:
    """Return the muscles used: also a user's own, unless it is one of them already."""
    if own is None or own.name in without or any(one.balance == own.balance for one in muscles):
        return muscles
    return [*(one for one in muscles if one.name != own.name), own]


def of_muscles(muscles: Sequence[Muscle], sheet: Sheet, like: Muscle | None = None) -> Prior:
    """Return the prior by some muscles of one with a data sheet, or of the same make as one of them.

    Their traits are taken for a Gaussian process over size, slenderness and braid (kriging): near a
    muscle its own traits are likely, and far from all their mean, with the spread of all.
    """
    if not muscles:
        raise DataError("there are no muscles to derive a prior from", remedy="leave fewer out")
    muscles = sorted(muscles, key=lambda muscle: muscle.name)
    table = np.array([muscle.traits for muscle in muscles])
    is_known = np.isfinite(table)
    similarity = np.array([muscle.sheet.shape for muscle in muscles])
    shape = sheet.shape if like is None else like.sheet.shape

    mean = np.full(COUNT, np.nan)
    levels, shapes = {}, {}
    for name, columns in PLACES.items():
        level_std, shape_std = _spreads(table[:, columns])
        spread = float(np.hypot(level_std, shape_std))
        for trait in range(columns.start, columns.stop):
            rows = is_known[:, trait]
            if rows.any():
                average = float(table[rows, trait].mean())
                weights, _ = _kriging_weights(similarity[rows], shape, spread)
                mean[trait] = average + weights @ (table[rows, trait] - average)
        informed = is_known[:, columns].any(axis=1)
        remaining = _kriging_weights(similarity[informed], shape, spread)[1]
        levels[name] = float(np.hypot(remaining * level_std, ALIKE))
        shapes[name] = float(np.hypot(remaining * shape_std, ALIKE))
    return Prior(sheet, mean, levels, shapes, ZERO * sheet.rest_length_mm)


def _kriging_weights(similarity: Array, target: Array, spread: float) -> tuple[Array, float]:
    """Return the weight of each muscle's deviation from the mean, and the remaining share of the spread.

    Parameters
    ----------
    similarity : array, shape (muscles, 3)
        Coordinates of the muscles: `Sheet.shape`.
    wanted : array, shape (3,)
        Those of the muscle whose traits are wanted.
    spread : float
        Standard deviation of the traits over all muscles.
    """
    if not len(similarity):
        return np.zeros(0), 1.0

    def correlation(some: Array, points: Array) -> Array:
        distances = (some[:, np.newaxis] - points) / CORRELATION_LENGTH
        return np.asarray(np.exp(-0.5 * (distances**2).sum(axis=2)))

    to_wanted = correlation(similarity, target[np.newaxis])[:, 0]
    independent = (ALIKE / spread) ** 2 * np.eye(len(similarity))
    among = correlation(similarity, similarity) + independent
    weights: Array = np.asarray(np.linalg.solve(among, to_wanted), dtype=np.float64)
    return weights, max(1.0 - float(to_wanted @ weights), 0.0) ** 0.5


def _spreads(table: Array) -> tuple[float, float]:
    """Return the standard deviations of a new muscle's level, and of its shape about the level.

    With few muscles, the prediction of a new one follows Student's distribution: the Gaussian with the
    same probability within one standard deviation is taken.

    Parameters
    ----------
    table : array, shape (muscles, traits)
        Traits of one name; NaN where a muscle does not have it.
    """
    is_known = np.isfinite(table)
    has_any = is_known.any(axis=1)
    n = int(has_any.sum())
    if n < FEWEST_MUSCLES:
        return DEFAULT_SPREAD, DEFAULT_SPREAD
    table, is_known = table[has_any], is_known[has_any]

    # deviations from the mean over muscles, 0 where unknown
    deviations = np.where(is_known, table, 0.0)
    means = deviations.sum(axis=0) / np.maximum(is_known.sum(axis=0), 1)
    deviations = np.where(is_known, deviations - means, 0.0)

    # a muscle's mean deviation is its level, the rest its shape
    level = deviations.sum(axis=1) / is_known.sum(axis=1)
    shape = np.where(is_known, deviations - level[:, np.newaxis], 0.0)

    # variance of the prediction for a new muscle, relative to that of the sample
    freedom = n - 1
    factor = (1.0 + 1.0 / n) * float(stdtrit(freedom, ONE_SIGMA_PROBABILITY)) ** 2
    centred = level - level.mean()
    level_std = float(np.sqrt(factor * centred @ centred / freedom))
    shape_freedom = max((table.shape[1] - 1) * freedom, 1)
    shape_std = float(np.sqrt(factor * (shape**2).sum() / shape_freedom))
    return max(level_std, ALIKE), max(shape_std, ALIKE)
