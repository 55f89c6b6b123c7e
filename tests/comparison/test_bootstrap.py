import numpy as np
import pytest

from mckibben.comparison.bootstrap import BlockBootstrap, interval


def naive_rmse(errors: np.ndarray, n: int, seed: int, resamples: int) -> np.ndarray:
    """Draw the same blocks one after another and take the RMSE of each resample."""
    block = int(np.ceil(np.sqrt(n)))
    count = int(np.ceil(n / block))
    starts = np.random.default_rng(seed).integers(0, n - block + 1, (1000, count))
    return np.array(
        [
            np.sqrt(np.mean(np.concatenate([errors[s : s + block] for s in row]) ** 2))
            for row in starts[:resamples]
        ]
    )


def test_resamples_equal_the_naive_ones() -> None:
    errors = np.random.default_rng(1).standard_normal(200)
    ours = BlockBootstrap([200], seed=7).rmse(errors)
    np.testing.assert_allclose(ours[:50], naive_rmse(errors, 200, 7, 50), rtol=1e-12)


def test_interval_covers_the_error_of_dependent_samples() -> None:
    rng = np.random.default_rng(0)
    covered = []
    for seed in range(150):
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


def test_blocks_stay_inside_their_recording() -> None:
    bootstrap = BlockBootstrap([40, 60], seed=0)
    only_second = np.concatenate([np.zeros(40), np.ones(60)])
    # 6 blocks of 7 samples of zeros, 8 of 8 of ones: any block across the border would break this.
    np.testing.assert_allclose(bootstrap.rmse(only_second), np.sqrt(64 / 106))


@pytest.mark.parametrize("n", [1, 2, 3])
def test_short_recordings_work(n: int) -> None:
    assert np.isfinite(BlockBootstrap([n], 0).rmse(np.ones(n))).all()
