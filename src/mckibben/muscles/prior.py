"""What the library says of a muscle before it is recorded: a Gaussian over its traits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import ValidationError
from scipy.stats import t as student

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.muscles.library import FORMAT, Muscle, load, parsed
from mckibben.muscles.library import list as all_muscles
from mckibben.muscles.sheet import Sheet, refused
from mckibben.muscles.traits import COUNT, PLACES

ALIKE = 0.05
"""Logarithm by which muscles of one make and size differ: no spread is less."""

FEWEST = 3
"""Muscles that tell of a spread."""

MIDDLE = 0.8413
"""Quantile at which a Gaussian is one deviation from its mean."""

UNTOLD = 1.0
"""Spread of what fewer tell."""


@dataclass(frozen=True)
class Prior:
    """What is likely of a muscle's traits.

    Traits of a name go up and down together by a level, and each differs from that by its shape.

    Parameters
    ----------
    sheet : Sheet
        Of the muscle.
    mean : array, shape (COUNT,)
        NaN of what no muscle tells.
    levels, shapes : dict of str to float
        Standard deviations.
    nearest : Muscle
        From which to begin.
    """

    sheet: Sheet
    mean: Array
    levels: dict[str, float]
    shapes: dict[str, float]
    nearest: Muscle

    def weights(self) -> Array:
        """Return rows that make independent numbers of deviation 1 of traits less their mean."""
        rows = []
        for name, place in PLACES.items():
            known = np.flatnonzero(np.isfinite(self.mean[place])) + place.start
            if not known.size:
                continue
            part = np.zeros((1 + known.size, COUNT))
            part[0, known] = 1.0 / (known.size * self.levels[name])
            part[1:, known] = (np.eye(known.size) - 1.0 / known.size) / self.shapes[name]
            rows.append(part if known.size > 1 else part[:1])
        return np.concatenate(rows)


def prior_of(given: str | Path, *, without: Sequence[str] = ()) -> Prior:
    """Return what the library says of a muscle.

    Parameters
    ----------
    given : str or path
        A muscle of the library, from which to begin, or the TOML file of a data sheet (or of an
        identified muscle).
    without : sequence of str
        Muscles of the library that are not asked.

    Raises
    ------
    DataError
        On an unknown name, or a file that is neither.
    """
    muscles = [muscle for muscle in all_muscles() if muscle.name not in without]
    path = Path(given)
    if path.suffix != ".toml":
        return of_muscles(muscles, load(given).sheet, load(given))
    content = parsed(path)
    if content.get("format") == FORMAT:
        return of_muscles(muscles, load(path).sheet, load(path))
    try:
        sheet = Sheet.model_validate(content)
    except ValidationError as error:
        raise refused(error, path, "numbers of a data sheet") from None
    return of_muscles(muscles, sheet, load(sheet.like) if sheet.like else None)


def of_muscles(muscles: Sequence[Muscle], sheet: Sheet, like: Muscle | None = None) -> Prior:
    """Return what some muscles say of one with a data sheet, or like one of them."""
    if not muscles:
        raise DataError("there are no muscles to tell of others", remedy="name fewer to leave out")
    table = np.array([muscle.traits for muscle in muscles])
    told = np.isfinite(table)
    mean = np.where(told, table, 0.0).sum(axis=0) / np.where(told.any(axis=0), told.sum(axis=0), np.nan)
    levels, shapes = {}, {}
    centre = mean.copy()
    for name, place in PLACES.items():
        levels[name], shapes[name] = _spreads(table[:, place] - mean[place])
        if like is not None:
            away = (like.traits - mean)[place]
            known = np.isfinite(away)
            if known.any():
                centre[place] += np.where(known, away, away[known].mean())
    nearest = like or min(
        (m for m in muscles), key=lambda m: (_distance(m.sheet, sheet), m.name)
    )
    return Prior(sheet, centre, levels, shapes, nearest)


def _spreads(away: Array) -> tuple[float, float]:
    """Return the deviations of muscles' levels, and of shapes from these, as few muscles tell them.

    A new one's is Student's; the Gaussian with the same middle two thirds is taken.
    """
    told = np.isfinite(away)
    muscles = told.any(axis=1)
    n = int(muscles.sum())
    if n < FEWEST:
        return UNTOLD, UNTOLD
    away, told = away[muscles], told[muscles]
    level = np.nansum(away, axis=1) / told.sum(axis=1)
    shape = np.where(told, away - level[:, np.newaxis], 0.0)
    free = n - 1
    new = (1.0 + 1.0 / n) * float(student.ppf(MIDDLE, free)) ** 2
    of_level = float(np.sqrt(new * (level - level.mean()) @ (level - level.mean()) / free))
    apart = max((away.shape[1] - 1) * free, 1)
    of_shape = float(np.sqrt(new * (shape**2).sum() / apart))
    return max(of_level, ALIKE), max(of_shape, ALIKE)


def _distance(one: Sheet, other: Sheet) -> float:
    """Return how much braids differ, in logarithms."""
    lengths = np.log(one.rest_length_mm / other.rest_length_mm)
    return float(abs(np.log(one.area / other.area)) + 0.1 * abs(lengths))
