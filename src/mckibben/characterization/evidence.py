"""Whether the output depends on the input at all, and on its direction: what noise alone does not give.

The output is fitted by functions of the input, and of its direction. Noise is fitted by them too, the
better the slower it is, so that its spectrum is taken from what is left over, and what noise of that
spectrum would give is compared: weighted sums of chi-square, by their mean and variance, over what is
known from few frequencies, as in an F-test. The fit itself
takes frequencies out of what is left over, all of them where the input repeats; a frequency's power is
therefore the mean over its neighbours, divided by the share that the fit can leave of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mckibben.arrays import Array
from mckibben.characterization.tracks import Scale, Track

LEVEL = 0.01
"""Of the tests: white noise passes for a dependence, or a loop, in about one of a hundred recordings.

Noise that wanders as slowly as the input moves passes more often, and drift over a single cycle cannot
be told from a loop: record several.
"""

MOST = 4096
"""Samples looked at; of more, means over as many as it takes."""

FEWEST = 40
"""Samples below which nothing is tested."""

KNOTS = 12
"""Of the static curve beside which a loop is looked for."""

BAND = 31
"""Frequencies over which the spectrum of what is left over is averaged."""


@dataclass(frozen=True)
class Evidence:
    """How likely noise alone would give what is seen; None where there are too few samples to tell.

    Parameters
    ----------
    dependence : float or None
        p-value of the output depending on the input, or on its direction.
    loop : float or None
        p-value of the output depending on the direction of the input, beside a curve without memory.
    widest : float or None
        How far apart the branches may be on average, beside what is seen of that, before noise would
        no longer pass for it [share of the output range].
    """

    dependence: float | None
    loop: float | None
    widest: float | None = None


def evidence(tracks: Sequence[Track], scale: Scale) -> Evidence:
    """Test the output of recordings for dependence on the input, and for a loop.

    Each has a curve of its own: at another zero, length or load it is another.
    """
    from scipy.linalg import block_diag

    every = -(-sum(track.u.size for track in tracks) // MOST)
    parts = [_means(track, every) for track in tracks if track.u.size >= every]
    if not parts:
        return Evidence(None, None)
    u, y, way = (np.concatenate(some) for some in zip(*parts, strict=True))
    n = u.size
    if n < FEWEST:
        return Evidence(None, None)
    x = 2 * (u - scale.u_low) / scale.u_span - 1
    y = (y - y.mean()) / scale.y_span
    turned = [way, way * x]
    ends = np.cumsum([0, *(part[0].size for part in parts)])
    knots = KNOTS if len(parts) == 1 else int(np.clip(n // (20 * len(parts)), 2, KNOTS))
    own = [hats(x[start:stop], knots) for start, stop in pairwise(ends)]
    static, level = block_diag(*own), block_diag(*(np.ones((part.shape[0], 1)) for part in own))
    curve = _added(np.column_stack([level, x, x**2, x**3, *turned]), level.shape[1])
    loop = _added(np.column_stack([static, *turned]), static.shape[1])
    spectrum = _spectrum_left(_basis(np.column_stack([static, *turned])), y)
    return Evidence(
        _p_value(curve, y, spectrum),
        _p_value(loop, y, spectrum),
        _widest(loop, way, y, spectrum),
    )


def _means(track: Track, every: int) -> tuple[Array, Array, Array]:
    """Return input and output, means over so many samples each, and the direction amid them.

    Only swings of some size have a direction: on a way up in steps that overshoot, it is up.
    """
    n = track.u.size // every
    u, y = (x[: n * every].reshape(n, every).mean(axis=1) for x in (track.u, track.y))
    amid = every * np.arange(n) + every // 2
    branch = (
        np.searchsorted(track.major_turns, amid) - 1
    )  # a turning point is reached by what is before it
    ways = np.sign(np.diff(track.u[track.major_turns]))
    return u, y, ways[np.clip(branch, 0, ways.size - 1)]


def hats(x: Array, n_knots: int) -> Array:
    """Return piecewise-linear functions on levels between which samples are equally many."""
    knots = np.unique(np.quantile(x, np.linspace(0, 1, n_knots)))
    return np.column_stack([np.interp(x, knots, row) for row in np.eye(knots.size)])


def _added(columns: Array, known: int) -> Array:
    """Return a basis of what the later columns add to the first ones."""
    base, more = _basis(columns[:, :known]), columns[:, known:]
    return _basis(more - base @ (base.T @ more), float(np.sum(more**2)))


def _basis(columns: Array, size: float | None = None) -> Array:
    """Return an orthonormal basis of columns, without directions that are nothing but rounding."""
    energies, ways = np.linalg.eigh(columns.T @ columns)
    kept = energies > 1e-10 * (float(energies[-1]) if size is None else size)
    return np.asarray(columns @ ways[:, kept] / np.sqrt(energies[kept]))


def _spectrum_left(base: Array, y: Array) -> Array:
    """Return the power at every frequency of what a basis leaves of an output, as if it took nothing."""
    from scipy.ndimage import uniform_filter1d

    band = min(BAND, y.size // 2)
    left = np.abs(np.fft.fft(y - base @ (base.T @ y))) ** 2 / y.size
    share = 1 - np.sum(np.abs(np.fft.fft(base, axis=0)) ** 2, axis=1) / y.size
    smooth = [uniform_filter1d(part, band, mode="wrap") for part in (left, share)]
    return np.asarray(np.maximum(smooth[0], 0) / np.maximum(smooth[1], 1 / band))


def _p_value(basis: Array, y: Array, spectrum: Array) -> float | None:
    """Return how likely noise of a spectrum is fitted as well as an output by a basis."""
    from scipy.special import fdtrc

    if basis.shape[1] == 0:
        return None
    fitted = float(np.sum((basis.T @ y) ** 2))
    mean, freedom = _of_noise(basis, spectrum)
    if mean <= 1e-20:
        return 0.0 if fitted > 1e-20 else 1.0
    return float(fdtrc(freedom, min(BAND, y.size // 2), fitted / mean))


def _widest(basis: Array, way: Array, y: Array, spectrum: Array) -> float | None:
    """Return the largest distance of branches that what is fitted, and noise beside it, may hide."""
    from scipy.special import fdtri

    reach = float(np.linalg.norm(basis.T @ way)) if basis.shape[1] else 0.0
    if reach == 0.0:
        return None
    mean, freedom = _of_noise(basis, spectrum)
    hidden = mean * float(fdtri(freedom, min(BAND, y.size // 2), 1 - LEVEL))
    return 2 * (float(np.linalg.norm(basis.T @ y)) + float(np.sqrt(hidden))) / reach


def _of_noise(basis: Array, spectrum: Array) -> tuple[float, float]:
    """Return the energy that a basis fits to noise of a spectrum, and its degrees of freedom."""
    waves = np.fft.fft(basis, axis=0)
    covariance = np.real(waves.conj().T @ (spectrum[:, np.newaxis] * waves)) / spectrum.size
    mean, variance = float(np.trace(covariance)), 2 * float(np.sum(covariance**2))
    return mean, 2 * mean**2 / max(variance, 1e-300)
