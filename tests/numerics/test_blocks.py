"""Blocks left out against refits, and drawn again against the same written out."""

import numpy as np
from scipy.stats import t as student

from mckibben.numerics.blocks import (
    BlockBootstrap,
    blocks_of,
    difference_intervals,
    interval,
    squared_errors,
    sums_of_others,
)
from mckibben.numerics.least_squares import solve_products


def test_blocks_are_of_about_the_same_length_in_long_and_short_pieces() -> None:
    pieces = [np.linspace(0.0, 1.0, n) for n in (300, 100, 3)]
    blocks = blocks_of(pieces, 20)
    assert [len(each) for each in blocks] == [15, 5, 1]
    for piece, each in zip(pieces, blocks, strict=True):
        np.testing.assert_array_equal(np.concatenate(each), piece)


def test_errors_of_blocks_left_out_are_those_of_refits() -> None:
    rng = np.random.default_rng(3)
    x, y = rng.standard_normal((90, 4)), rng.standard_normal((90, 2))
    table = np.hstack([x, y])
    blocks = np.split(np.arange(90), 9)
    folds = np.arange(9) % 4
    products = np.array([table[rows].T @ table[rows] for rows in blocks])
    weights = solve_products(sums_of_others(products, folds), 4, 1e-14)
    found = squared_errors(products, weights[folds])
    for fold, rows, errors in zip(folds, blocks, found, strict=True):
        others = np.concatenate([b for b, f in zip(blocks, folds, strict=True) if f != fold])
        refit = np.linalg.lstsq(x[others], y[others], rcond=None)[0]
        expected = ((x[rows] @ refit - y[rows]) ** 2).sum(axis=0)
        np.testing.assert_allclose(errors, expected, rtol=1e-9)


def naive_rmse(errors: np.ndarray, n: int, seed: int) -> np.ndarray:
    """Draw the same blocks one after another and take the RMSE of each resample, spread as by t."""
    block = int(np.ceil(np.sqrt(n)))
    count = int(np.ceil(n / block))
    starts = np.random.default_rng(seed).integers(0, n, (1000, count))
    drawn = [[errors[(s + k) % n] for s in row for k in range(block)] for row in starts]
    found = np.array([np.sqrt(np.mean(np.square(one))) for one in drawn])
    blocks = n / block
    wider = student.ppf(0.975, blocks - 1) / 1.96 * np.sqrt(blocks / (blocks - 1))
    return found.mean() + wider * (found - found.mean())


def test_resamples_equal_the_naive_ones() -> None:
    errors = np.random.default_rng(1).standard_normal(200)
    ours = BlockBootstrap([200], seed=7).rmse(errors)
    np.testing.assert_allclose(ours, naive_rmse(errors, 200, 7), rtol=1e-12)


def test_interval_covers_the_error_of_dependent_samples() -> None:
    rng = np.random.default_rng(0)
    covered = []
    for seed in range(100):
        noise = rng.standard_normal(1050)
        errors = np.convolve(noise, np.ones(10) / np.sqrt(10), mode="valid")[:1000]
        low, high = interval(BlockBootstrap([1000], seed).rmse(errors))
        covered.append(low <= 1.0 <= high)
    assert 0.85 < np.mean(covered) <= 1.0


def test_models_are_paired_on_the_same_blocks() -> None:
    bootstrap = BlockBootstrap([300, 50], seed=0)
    errors = np.random.default_rng(2).standard_normal(350)
    np.testing.assert_array_equal(bootstrap.rmse(errors), bootstrap.rmse(errors))
    difference = bootstrap.rmse(2 * errors) - bootstrap.rmse(errors)
    np.testing.assert_allclose(difference, bootstrap.rmse(errors))


def test_intervals_of_all_differences_hold_at_once() -> None:
    """Of ten models equally good, none is told apart in 95 % of the tests; one at a time, more are."""
    at_once, one_by_one = [], []
    for seed in range(100):
        rng = np.random.default_rng(seed)
        errors = rng.standard_normal((10, 900))
        bootstrap = BlockBootstrap([900], seed)
        samples = np.array([bootstrap.rmse(one) for one in errors])
        values = np.sqrt((errors**2).mean(axis=1))
        ends = np.array(difference_intervals(samples, values, 0))[1:]
        at_once.append(((ends[:, 0] <= 0) & (ends[:, 1] >= 0)).all())
        pairs = np.array([interval(one - samples[0]) for one in samples[1:]])
        one_by_one.append(((pairs[:, 0] <= 0) & (pairs[:, 1] >= 0)).all())
    assert 0.88 <= np.mean(at_once) <= 1.0
    assert np.mean(one_by_one) < np.mean(at_once) - 0.1
