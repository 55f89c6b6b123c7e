"""Standard errors of a balance: of what data determine, of what they do not, and of noise."""

from __future__ import annotations

import numpy as np
import pytest

from mckibben.estimators.coupled.balance import BalanceEstimator
from mckibben.estimators.coupled.balance_errors import natural_scales, noise_of
from tests.plants import sampled


@pytest.fixture(scope="module")
def found() -> BalanceEstimator:
    """A balance of a muscle whose springs and areas may be any function of displacement."""
    return BalanceEstimator().fit(sampled.known_parameters(8).train)


def test_errors_are_known_of_all_but_what_sets_the_unit(found: BalanceEstimator) -> None:
    errors = np.array(found.diagnostics_.standard_errors)
    fixed = found.fixed(found.fitted)
    assert np.isnan(errors[list(fixed)]).all()
    without_effect = np.flatnonzero(found.fitted.pack() == 0.0)
    assert {*np.flatnonzero(np.isnan(errors))} <= {*fixed, *without_effect}


def test_what_data_do_not_determine_is_as_unsure_as_its_scale(found: BalanceEstimator) -> None:
    elastic = [name.startswith("elasticity") for name in found.fitted.parameter_names]
    errors, scales = np.array(found.diagnostics_.standard_errors), natural_scales(found.fitted)
    assert (errors[elastic] > 0.5 * scales[elastic]).all()


@pytest.mark.parametrize("size", [0.01, 2.0])
def test_noise_of_inputs_is_found_beside_their_motion(size: float) -> None:
    t = np.linspace(0.0, 1.0, 3000)
    motion = np.column_stack([np.sin(9.0 * t), np.floor(5.0 * t)])
    noise = size * np.random.default_rng(1).standard_normal(motion.shape)
    assert noise_of(motion + noise) == pytest.approx([size, size], rel=0.05)
    assert noise_of(motion).max() < 1e-4
