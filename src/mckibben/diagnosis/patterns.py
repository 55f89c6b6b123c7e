"""A residual in figures: its autocorrelation, and its means over what it should not depend on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.diagnosis.free_runs import Run
from mckibben.diagnosis.regression import Regression
from mckibben.diagnosis.suspects import Suspects, averaged
from mckibben.statistics import NORMAL_95

TESTED = 12
"""Lags that are tested together at most."""

PER_LAG = 20
"""Samples to a lag that is tested, of all recordings, at least."""

SHOWN = 50
"""Lags that are drawn one by one at most, and as many thinned ones beyond."""

PAIRS = 5
"""Pairs of samples of one recording to a lag at least, as a multiple of the lag."""

NORMAL_99 = 2.5758
"""Standard deviations in which 99 % of a normal distribution lie."""

Ways = Sequence[Array] | None

BINS = 10
"""Bins of as many samples each."""


@dataclass(frozen=True)
class Whiteness:
    """The autocorrelation of a residual.

    Parameters
    ----------
    lags : tuple of int
        In samples, from 1.
    autocorrelation, band : tuple of float
        At every lag, and how far from zero 99 % of those of white noise are.
    n_tested : int
        Lags tested together, the first ones.
    p_value : float or None
        Probability of white noise as far from zero; None where recordings are too short.
    """

    lags: tuple[int, ...]
    autocorrelation: tuple[float, ...]
    band: tuple[float, ...]
    n_tested: int
    p_value: float | None


@dataclass(frozen=True)
class Bin:
    """Mean residual of ``n`` samples between two ends, and its 95 % interval where noise is correlated.

    ``label`` is the branch, "rising" or "falling", where there are two.
    """

    label: str
    low: float
    high: float
    n: int
    mean: float
    interval: tuple[float, float]


@dataclass(frozen=True)
class Pattern:
    """A residual against one thing.

    Parameters
    ----------
    against : str
        ``input``, ``load``, ``output`` or ``branch``.
    channel, unit : str
        What it is against.
    bins : tuple of Bin
    """

    against: str
    channel: str
    unit: str
    bins: tuple[Bin, ...]


def whiteness(residuals: Sequence[Array]) -> Whiteness:
    """Return the autocorrelation of a residual, pieces (n,), and whether it is that of white noise.

    Products of samples at a lag are compared with their own scatter, so that white noise whose size
    depends on the input or the run passes as what it is.
    """
    from scipy.special import chdtrc

    room = max(map(len, residuals)) // (PAIRS + 1)
    lags = np.arange(1, min(SHOWN, room) + 1)
    if room > SHOWN:
        lags = np.union1d(lags, np.geomspace(SHOWN, room, SHOWN).astype(int))
    n = sum(map(len, residuals))
    mean = float(np.concatenate(residuals).mean())
    left = [e - mean for e in residuals]
    power = float(sum(e @ e for e in left))
    found, scatter = np.zeros(lags.size), np.zeros(lags.size)
    for place, lag in enumerate(lags.tolist()):
        for e in (e for e in left if len(e) > lag):
            products = e[lag:] * e[:-lag]
            # the mean was taken off: what noise itself would give is below zero
            found[place] += products.sum() + len(products) / n * power / n
            scatter[place] += products @ products
    tested = min(TESTED, SHOWN, room, n // PER_LAG)
    deviation = np.sqrt(scatter)
    ratio = np.divide(found, deviation, out=np.zeros(lags.size), where=deviation > 0)
    p_value = float(chdtrc(tested, float(np.sum(ratio[:tested] ** 2)))) if tested else None
    size = power if power > 0 else 1.0
    band = NORMAL_99 * deviation / size
    return Whiteness(
        tuple(lags.tolist()), tuple((found / size).tolist()), tuple(band.tolist()), tested, p_value
    )


def patterns(
    block: Block,
    runs: Sequence[Run],
    output: int,
    left: Sequence[Array],
    table: Suspects,
    regression: Regression,
) -> tuple[Pattern, ...]:
    """Return means of a residual, averaged over blocks (n,), over all that moves and over branches."""
    found = []

    def add(against: str, name: str, unit: str, values: Sequence[Array], ways: Ways = None) -> None:
        parts = [averaged(x, table.every) for x in values]
        bins = _bins(left, parts, table.every, regression, ways)
        found.append(Pattern(against, name, unit, bins))

    for group in table.groups:
        if group.kind in ("curve", "load", "hysteresis"):
            samples = [run.recording[group.channel] for run in runs]
            unit = runs[0].recording.units[group.channel]
            against = {"curve": "input", "load": "load", "hysteresis": "branch"}[group.kind]
            ways = None
            if group.kind == "hysteresis":
                ways = [np.sign(part[:, group.columns[0]]) for part in table.tables]
            add(against, group.channel, unit, samples, ways)
    channel = block.outputs[output]
    add("output", channel.name, channel.unit, [run.modelled[:, output] for run in runs])
    return tuple(found)


def _bins(
    left: Sequence[Array],
    values: Sequence[Array],
    every: int,
    regression: Regression,
    ways: Ways,
) -> tuple[Bin, ...]:
    """Return means where values are in bins of as many samples each, and on either branch."""
    ends = np.unique(np.quantile(np.concatenate(values), np.linspace(0, 1, BINS + 1)))
    branches: Sequence[tuple[str, int]] = (("", 0),)
    if ways is not None:
        branches = (("rising", 1), ("falling", -1))
    ways = [np.zeros(len(x)) for x in values] if ways is None else ways
    found = []
    for k in range(ends.size - 1):
        place = [np.clip(np.searchsorted(ends, x, "right") - 1, 0, ends.size - 2) for x in values]
        for label, way in branches:
            chosen = [(p == k) & (w == way) for p, w in zip(place, ways, strict=True)]
            n = int(sum(own.sum() for own in chosen))
            if n == 0:
                continue
            weights = [own / n for own in chosen]
            mean = float(sum(w @ e for w, e in zip(weights, left, strict=True)))
            half = NORMAL_95 * regression.deviation(weights)
            interval = (mean - half, mean + half)
            found.append(Bin(label, float(ends[k]), float(ends[k + 1]), n * every, mean, interval))
    return tuple(found)
