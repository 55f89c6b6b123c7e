"""Standard errors of a force balance: how far its parameters may be from those of the muscle.

A parameter is off for three reasons, and the mean squares add up:

- Errors of the fit. They are alike wherever the muscle does the same, and not only from one sample to
  the next. So nothing is assumed of them within a few long blocks: each is left out in turn, by a step
  from the fit, and the spread is wider as Student's t is of so few.
- What was likely before. The fit draws every parameter to none by its natural scale; what that makes of
  a parameter of natural size is its bias. A parameter that data do not determine is as unsure as its
  scale. Those at a bound are no better known than others.
- Noise of the inputs. Stops take the peaks of a noisy pressure for motion. Noise of the same size, added
  once more, shows how far that moves a fit.

Sources: MacKinnon, Nielsen and Webb, "Cluster-robust inference: A guide to empirical practice", Journal
of Econometrics 232, 2023 (the jackknife CV3); Ibragimov and Müller, "t-statistic based correlation and
heterogeneity robust inference", Journal of Business & Economic Statistics 28, 2010 (few long blocks);
Nychka, "Bayesian confidence intervals for smoothing splines", Journal of the American Statistical
Association 83, 1988 (mean square with bias); Cook and Stefanski, "Simulation-extrapolation estimation in
parametric measurement error models", Journal of the American Statistical Association 89, 1994 (noise
added once more).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mckibben.arrays import Array, Mask
from mckibben.blocks.base import Block
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.coupled.balance_terms import STIFFNESS, TABLE
from mckibben.blocks.derivatives import relative_sizes
from mckibben.blocks.free_runs import FreeRuns
from mckibben.estimators.core.uncertainty import unknown
from mckibben.numerics.blocks import blocks_of
from mckibben.numerics.statistics import NORMAL_95, autoregression, student

BLOCKS = 8
"""Number of blocks of all recordings together, if each has one (Ibragimov and Müller)."""

ROUNDING = 1e-12
"""Smallest eigenvalue of what data and scales determine, relative to the largest, that is used."""

LOST = 1e-6
"""Share of a parameter, squared, in combinations that nothing determines, above which it is unknown."""

MEDIAN = 0.6745
"""Median of the absolute values of a standard normal distribution."""


def covariance_of_balance(runs: FreeRuns, fixed: Sequence[int]) -> tuple[float, Array]:
    """Return the condition of the free parameters of a balance, and the mean squares of all.

    Shape (parameters, parameters); NaN for those that are ``fixed``. They are such that 1.96 standard
    errors either way are an interval of 95 %.
    """
    block, covariance = runs.block, unknown(runs.block)
    free = np.setdiff1d(np.arange(block.n_parameters), fixed)
    if not free.size or not np.isfinite(runs.residual).all():
        return np.inf, covariance
    m, values = len(runs.names), block.pack()
    sizes = relative_sizes(values)[free]
    errors = runs.residual.reshape(-1, m)
    weight = 1.0 / np.maximum(np.sqrt(np.mean(errors**2, axis=0)), np.finfo(float).tiny)
    errors = errors * weight
    slopes = runs.slopes(free.tolist()).reshape(-1, m, free.size) * weight[:, np.newaxis]
    usable = np.isfinite(slopes).all(axis=(0, 1))
    free, sizes, slopes = free[usable], sizes[usable], slopes[..., usable]
    ends = np.cumsum([int(rows.sum()) for rows in runs.rows])[:-1]
    pieces = np.split(np.arange(len(errors)), ends)

    samples_per_independent_error = _samples_per_independent_error(errors, pieces)
    prior_precision = samples_per_independent_error * (sizes / natural_scales(block)[free]) ** 2
    flat = slopes.reshape(-1, free.size)
    products = flat.T @ flat + np.diag(prior_precision)
    lowest, highest = np.linalg.eigvalsh(products)[[0, -1]]
    inverse, lost = _inverted(products)

    spread = _block_jackknife(products, errors, slopes, pieces)
    shift = np.einsum("tj,tjk->k", _output_shift_by_input_noise(runs) * weight, slopes)
    input_noise_bias = np.outer(shift, shift)
    # P w w' P with the prior precision P, on average over parameters w of natural size
    prior_bias = samples_per_independent_error * np.diag(prior_precision)
    mean_squares = spread + inverse @ (input_noise_bias + prior_bias) @ inverse

    mean_squares[lost] = mean_squares[:, lost] = np.nan
    covariance[np.ix_(free, free)] = mean_squares * np.outer(sizes, sizes)
    is_known = usable.all() and lowest > 0.0
    return float(np.sqrt(highest / lowest)) if is_known else np.inf, covariance


def _samples_per_independent_error(errors: Array, pieces: Sequence[Array]) -> float:
    """Return how many errors, shape (n, m), count as one that is independent, as in the fit.

    ``pieces`` are the rows of every recording.
    """
    models = [
        autoregression([errors[piece, j] for piece in pieces]) for j in range(errors.shape[1])
    ]
    n = len(errors)
    return float(np.mean([n / model.effective_sample_size(n) for model in models]))


def _block_jackknife(
    products: Array, errors: Array, slopes: Array, pieces: Sequence[Array]
) -> Array:
    """Return the covariance (k, k) of a fit, by leaving out long blocks of its samples in turn.

    ``products`` (k, k) are those of the ``slopes`` (n, m, k) with the prior; ``errors`` are (n, m).
    """
    blocks = [block for piece in blocks_of(pieces, BLOCKS) for block in piece if block.size]
    shifts_without_block = []
    for block in blocks:
        part = slopes[block].reshape(-1, slopes.shape[-1])
        shifts_without_block.append(
            _inverted(products - part.T @ part)[0] @ (errors[block].ravel() @ part)
        )
    degrees_of_freedom = max(len(blocks) - 1, 1)
    wider = (student(degrees_of_freedom) / NORMAL_95) ** 2
    small_sample_factor = wider * degrees_of_freedom / len(blocks)
    return np.asarray(
        small_sample_factor * np.transpose(shifts_without_block) @ np.array(shifts_without_block)
    )


def _inverted(products: Array) -> tuple[Array, Mask]:
    """Return the inverse of products of slopes (k, k), and what nothing determines."""
    size = np.sqrt(np.diag(products))
    size[size == 0.0] = 1.0
    values, vectors = np.linalg.eigh(products / np.outer(size, size))
    is_kept = values > ROUNDING * values[-1]
    inverse = (vectors[:, is_kept] / values[is_kept]) @ vectors[:, is_kept].T / np.outer(size, size)
    return inverse, (vectors[:, ~is_kept] ** 2).sum(axis=1) > LOST


def _output_shift_by_input_noise(runs: FreeRuns) -> Array:
    """Return by how much outputs move on average, shape (n, m), if noise is added to the inputs."""
    rng, shifts = np.random.default_rng(0), []
    noises = [noise_of(run.inputs) * rng.standard_normal(run.inputs.shape) for run in runs.runs]
    for sign in (1.0, -1.0):  # what is linear in the noise cancels
        noisy = [
            replace(
                run,
                driven=run.driven + sign * noise[:, : run.driven.shape[1]],
                scheduled=run.scheduled + sign * noise[:, run.driven.shape[1] :],
            )
            for run, noise in zip(runs.runs, noises, strict=True)
        ]
        shifts.append(replace(runs, runs=noisy).residual - runs.residual)
    return np.nan_to_num(np.mean(shifts, axis=0)).reshape(-1, len(runs.names))


def noise_of(series: Array) -> Array:
    """Return the standard deviation of white noise of columns (n, k), by their second differences.

    Source: Gasser, Sroka and Jennen-Steinmetz, "Residual variance and residual pattern in nonlinear
    regression", Biometrika 73, 1986; of the median, so that jumps do not count.
    """
    if len(series) < 3:
        return np.zeros(series.shape[1])
    second = series[1:-1] - 0.5 * (series[:-2] + series[2:])
    return np.asarray(np.sqrt(2.0 / 3.0) * np.median(np.abs(second), axis=0) / MEDIAN)


def natural_scales(block: Block) -> Array:
    """Return the natural scale of every parameter of a model; infinite where any value is as likely."""
    return np.array([_scale(*number) for number in block.numbers()])


def _scale(part: object, field: str, index: tuple[int, ...]) -> float:
    """Return the natural scale of a parameter of a part of a model."""
    if not isinstance(part, Balance) or field not in TABLE or not TABLE[field].doubtful:
        return np.inf
    kind, which = TABLE[field], index[-1] if index else 0
    area = abs(part.areas[0][0])
    force = part.highest_pressure * area
    stiffness = force / part.scale
    largest = [max(map(abs, ends)) or 1.0 for ends in part.known]
    if field == "springs":
        power, to = divmod(which, 1 + len(part.driven))
        if not power:
            return np.inf
        scheduled, degree = divmod(power - 1, part.degree)
        by = largest[scheduled] ** (1 + degree) if largest else 1.0
        return (stiffness if to else force) / by
    if field == "obstacles":
        number = which % part.sizes.obstacle
        return np.inf if number < STIFFNESS else stiffness
    if field == "areas" and not which:
        return np.inf
    if field == "friction":
        return force / part.limits[which]
    if kind.log:
        value = getattr(part, field)
        return abs(value[which] if index else value) * kind.scale
    sizes = {"N": force, "N/bar": area, "mm/bar": part.scale / part.highest_pressure, "": 1.0}
    return kind.scale * sizes.get(kind.unit, stiffness)
