"""Orders chosen by cross-validation, of models of several channels too."""

from __future__ import annotations

import numpy as np
import pytest

from mckibben import Recording, identify
from mckibben.blocks.coupled.balance import Balance
from mckibben.signals.broadband import random_wave
from tests.blocks.balances import ALONE

STEP, N = 0.05, 900


def recording(muscle: Balance, seed: int) -> Recording:
    """Return a muscle under a load, both moving at random from rest, with noise."""
    time = np.arange(N) * STEP
    rises = np.minimum(time / 2.0, 1.0)
    p = rises * random_wave(time, 0.2, 3.0, seed=seed)
    force = rises * random_wave(time, 0.1, 40.0, seed=100 + seed)
    y = muscle.inverse().simulate(np.column_stack([p, force]), sample_time=STEP)[:, 0]
    y = y + 0.01 * np.random.default_rng(seed).standard_normal(N)
    return Recording({"pressure": p, "displacement": y, "force": force}, STEP)


@pytest.mark.long
def test_lags_of_a_balance_are_chosen_where_its_muscle_relaxes() -> None:
    runs = [recording(ALONE, seed) for seed in (1, 2)]
    choice = identify(runs, "balance", {"n_lags": (0, 1)}, n_folds=2, steps=4, contact=False)
    assert choice.orders == {"n_lags": 1}
    errors = {orders["n_lags"]: error for orders, error, _ in choice.tried}
    assert errors[1] < 0.8 * errors[0]
    assert [channel.name for channel in choice.estimator.fitted.inputs] == ["pressure", "force"]
