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

NEAR = 0.25
"""Correlation length of the logarithm of size, slenderness and braid."""

ZERO = 0.03
"""Standard deviation of the origin of displacements, relative to the rest length."""

SMOOTH, FINE = 1.0, 0.03
"""Correlation length of a trait's numbers, in neighbours, and the independent part of each."""

FEWEST_MUSCLES = 3
"""Smallest number of muscles for estimating a spread."""

MIDDLE = 0.8413
"""Quantile of a normal distribution at one standard deviation."""

DEFAULT_SPREAD = 1.0
"""Spread assumed with fewer muscles."""


@dataclass(frozen=True)
class Prior:
    """Prior of a muscle's traits.

    Traits of a name go up and down together by a level, and differ from it by a smooth shape.

    Parameters
    ----------
    sheet : Sheet
        Of the muscle.
    mean : array, shape (COUNT,)
        NaN of what no muscle tells.
    levels, shapes : dict of str to float
        Standard deviations.
    zero : float
        Standard deviation of where displacements count from, beyond rest [mm].
    """

    sheet: Sheet
    mean: Array
    levels: dict[str, float]
    shapes: dict[str, float]
    zero: float

    def covariance(self, name: str) -> Array:
        """Return the covariance of traits of a name."""
        place = POSITIONS[name]
        apart = ((place[:, np.newaxis] - place) / SMOOTH) ** 2
        curved = self.shapes[name] ** 2 * np.exp(-0.5 * apart.sum(axis=2))
        return np.asarray(self.levels[name] ** 2 + curved + FINE**2 * np.eye(len(place)))

    def weights(self) -> Array:
        """Return rows that normalise deviations of traits from their mean to unit covariance."""
        rows = []
        for name, place in PLACES.items():
            known = np.flatnonzero(np.isfinite(self.mean[place]))
            part = np.zeros((known.size, COUNT))
            factor = np.linalg.cholesky(self.covariance(name)[np.ix_(known, known)])
            part[:, known + place.start] = np.linalg.inv(factor)
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
        Muscles of the library that are not asked.

    Raises
    ------
    DataError
        On an unknown name, or a file that is neither.
    """
    muscles = [muscle for muscle in all_muscles() if muscle.name not in without]
    if isinstance(given, Sheet):
        without = (*without, *(given.without or ()))
        like = load(given.like) if given.like else None
        asked = [muscle for muscle in muscles if muscle.name not in without]
        return of_muscles(_with(like, asked, without), given, like)
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
    known = np.isfinite(table)
    shapes = np.array([muscle.sheet.shape for muscle in muscles])
    here = sheet.shape if like is None else like.sheet.shape
    mean = np.full(COUNT, np.nan)
    of_levels, of_shapes = {}, {}
    for name, place in PLACES.items():
        level, shape = _spreads(table[:, place])
        spread = float(np.hypot(level, shape))
        for number in range(place.start, place.stop):
            which = known[:, number]
            if which.any():
                middle = float(table[which, number].mean())
                share, _ = _shares(shapes[which], here, spread)
                mean[number] = middle + share @ (table[which, number] - middle)
        left = _shares(shapes[known[:, place].any(axis=1)], here, spread)[1]
        of_levels[name] = float(np.hypot(left * level, ALIKE))
        of_shapes[name] = float(np.hypot(left * shape, ALIKE))
    return Prior(sheet, mean, of_levels, of_shapes, ZERO * sheet.rest_length_mm)


def _shares(shapes: Array, here: Array, spread: float) -> tuple[Array, float]:
    """Return the weight of each muscle's deviation, and the remaining share of the spread."""
    if not len(shapes):
        return np.zeros(0), 1.0

    def alike(one: Array, other: Array) -> Array:
        apart = (one[:, np.newaxis] - other) / NEAR
        return np.asarray(np.exp(-0.5 * (apart**2).sum(axis=2)))

    near = alike(shapes, here[np.newaxis])[:, 0]
    among = alike(shapes, shapes) + (ALIKE / spread) ** 2 * np.eye(len(shapes))
    share: Array = np.asarray(np.linalg.solve(among, near), dtype=np.float64)
    return share, max(1.0 - float(near @ share), 0.0) ** 0.5


def _spreads(table: Array) -> tuple[float, float]:
    """Return the spreads of muscles' levels, and of shapes about these, allowing for few muscles.

    A new one's is Student's; the Gaussian with the same middle two thirds is taken.
    """
    known = np.isfinite(table)
    muscles = known.any(axis=1)
    n = int(muscles.sum())
    if n < FEWEST_MUSCLES:
        return DEFAULT_SPREAD, DEFAULT_SPREAD
    table, known = table[muscles], known[muscles]
    away = np.where(known, table, 0.0)
    away = np.where(known, away - away.sum(axis=0) / np.maximum(known.sum(axis=0), 1), 0.0)
    level = away.sum(axis=1) / known.sum(axis=1)
    shape = np.where(known, away - level[:, np.newaxis], 0.0)
    free = n - 1
    new = (1.0 + 1.0 / n) * float(stdtrit(free, MIDDLE)) ** 2
    of_level = float(np.sqrt(new * (level - level.mean()) @ (level - level.mean()) / free))
    of_shape = float(np.sqrt(new * (shape**2).sum() / max((table.shape[1] - 1) * free, 1)))
    return max(of_level, ALIKE), max(of_shape, ALIKE)
