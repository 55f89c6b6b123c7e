import numpy as np
from scipy.stats import t as student

from mckibben.statistics import BlockBootstrap, differences, interval


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
        ends = np.array(differences(samples, values, 0))[1:]
        at_once.append(((ends[:, 0] <= 0) & (ends[:, 1] >= 0)).all())
        pairs = np.array([interval(one - samples[0]) for one in samples[1:]])
        one_by_one.append(((pairs[:, 0] <= 0) & (pairs[:, 1] >= 0)).all())
    assert 0.88 <= np.mean(at_once) <= 1.0
    assert np.mean(one_by_one) < np.mean(at_once) - 0.1
