"""Broadband signals: random waves, multisines and chirps."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from mckibben.arrays import Array
from mckibben.errors import DataError, require
from mckibben.signals.checking import as_time, generator, require_order, require_positive

N_WAVES = 64
"""Sines in a random wave: enough for it to look random, few enough to be quick."""

MOST_HARMONICS = 10_000
"""Sines in a multisine."""


def random_wave(
    time: ArrayLike,
    max_frequency: float,
    high: float,
    low: float = 0.0,
    min_frequency: float = 0.0,
    *,
    seed: int,
) -> Array:
    """Return a sum of sines with random frequencies and phases: smooth, with loops of all sizes.

    Parameters
    ----------
    time : array_like, shape (n,)
        Time [s].
    max_frequency : float
        Highest frequency in it [Hz], positive; all are equally strong.
    high, low : float
        Its highest and lowest sample, high above low.
    min_frequency : float
        Lowest frequency in it [Hz], not negative and below the highest.
    seed : int
        Of frequencies and phases.

    Raises
    ------
    DataError
        On frequencies that are negative or not in order, or high not above low.
    """
    t = as_time(time)
    require_positive("max_frequency", max_frequency)
    require_order(low, high)
    lower = 0 <= min_frequency < max_frequency
    require(lower, "min_frequency", min_frequency, f"0 to {max_frequency:g} Hz", DataError)
    rng = generator(seed)
    frequencies = rng.uniform(min_frequency, max_frequency, N_WAVES)
    phases = rng.uniform(0.0, 2 * np.pi, N_WAVES)
    wave = np.zeros_like(t)
    for frequency, phase in zip(frequencies, phases, strict=True):
        wave += np.cos(2 * np.pi * frequency * t + phase)
    return _between(wave, low, high)


def multisine(
    time: ArrayLike,
    period: float,
    max_frequency: float,
    high: float,
    low: float = 0.0,
    phases: Literal["low-crest", "random"] = "low-crest",
    seed: int = 0,
) -> Array:
    """Return a periodic sum of all harmonics up to a frequency, equally strong.

    Parameters
    ----------
    time : array_like, shape (n,)
        Time [s].
    period : float
        Time after which it repeats [s], positive; its inverse is the lowest frequency.
    max_frequency : float
        Highest frequency [Hz], at least that of the first harmonic.
    high, low : float
        Its highest and lowest sample, high above low.
    phases : {"low-crest", "random"}
        Schroeder's (1970), which spread the energy evenly over the period, or random ones.
    seed : int
        Of random phases.

    Raises
    ------
    DataError
        On a period or frequency that is not positive, no harmonic below the highest frequency, more
        than 10 000, or high not above low.
    """
    t = as_time(time)
    require_positive("period", period)
    require_positive("max_frequency", max_frequency)
    require_order(low, high)
    n = int(max_frequency * period * (1 + 1e-12))
    if not 1 <= n <= MOST_HARMONICS:
        raise DataError(
            f"a period of {period:g} s has {n} harmonics up to {max_frequency:g} Hz",
            parameter="max_frequency",
            remedy=f"choose them so that there are 1 to {MOST_HARMONICS}",
        )
    order = np.arange(1, n + 1)
    if phases == "random":
        shifts = generator(seed).uniform(0.0, 2 * np.pi, n)
    elif phases == "low-crest":
        shifts = -np.pi * order * (order - 1) / n
    else:
        raise DataError(f"phases is {phases!r}", remedy="give low-crest or random")
    wave = np.zeros_like(t)
    for k, shift in zip(order, shifts, strict=True):
        wave += np.cos(2 * np.pi * k * t / period + shift)
    return _between(wave, low, high)


def chirp(
    time: ArrayLike,
    start_frequency: float,
    end_frequency: float,
    high: float,
    low: float = 0.0,
    law: Literal["linear", "logarithmic"] = "linear",
) -> Array:
    """Return a sine whose frequency sweeps over the whole time; it starts at ``low``.

    Parameters
    ----------
    time : array_like, shape (n,)
        Time [s], increasing; the sweep takes from the first to the last.
    start_frequency, end_frequency : float
        At the first and at the last instant [Hz], positive.
    high, low : float
        Its highest and lowest value, high above low.
    law : {"linear", "logarithmic"}
        Whether the frequency grows by equal amounts or by equal factors in equal times.

    Raises
    ------
    DataError
        On frequencies that are not positive, or high not above low.
    """
    t = as_time(time)
    require_positive("start_frequency", start_frequency)
    require_positive("end_frequency", end_frequency)
    require_order(low, high)
    require(law in ("linear", "logarithmic"), "law", law, "linear or logarithmic", DataError)
    duration = float(t[-1] - t[0])
    if not duration > 0:
        raise DataError("one instant makes no sweep", remedy="give more than one time")
    share = (t - t[0]) / duration
    growth = np.log(end_frequency / start_frequency)
    if law == "linear" or abs(growth) < 1e-9:
        turns = start_frequency * share + 0.5 * (end_frequency - start_frequency) * share**2
    else:
        turns = start_frequency * np.expm1(growth * share) / growth
    return np.asarray(low + (high - low) * (0.5 - 0.5 * np.cos(2 * np.pi * duration * turns)))


def _between(wave: Array, low: float, high: float) -> Array:
    bottom, top = wave.min(), wave.max()
    if bottom == top:
        raise DataError("one instant makes no wave", remedy="give more than one time")
    # Clipped, because rounding may carry the extreme samples past the limits.
    return np.asarray(np.clip(low + (high - low) * (wave - bottom) / (top - bottom), low, high))
