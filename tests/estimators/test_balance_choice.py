"""What a balance is chosen to have, on plants drawn at random from textbook physics."""

from functools import cache

import numpy as np
import pytest

from mckibben.blocks.coupled.balance import balance_in
from mckibben.blocks.coupled.balance_terms import PHENOMENA
from mckibben.blocks.memoryless import PiecewiseLinear
from mckibben.estimators.coupled.balance import BalanceEstimator
from mckibben.recording import Recording
from tests.plants import sampled

clean = cache(sampled.clean)


@cache
def fitted(seed: int) -> BalanceEstimator:
    """Return an estimator fitted to a clean plant."""
    return BalanceEstimator().fit(clean(seed).train)


def phenomena(estimator: BalanceEstimator) -> set[str]:
    """Return what was found of what data have to demand."""
    return {*estimator.terms_} & {*PHENOMENA}


def scaled(recording: Recording, seed: int, by: float) -> Recording:
    """Return a recording whose displacement is moved by rounding."""
    noise = 1.0 + by * np.random.default_rng(seed).standard_normal(len(recording))
    return recording.with_channels({}, displacement=noise * recording["displacement"])


@pytest.mark.parametrize("seed", [8, 14], ids=["spring", "load"])
def test_nothing_is_found_that_is_not_there_and_rounding_changes_nothing(seed: int) -> None:
    plant, estimator = clean(seed), fitted(seed)
    assert not phenomena(estimator)
    other = BalanceEstimator().fit([scaled(run, 1, 1e-12) for run in plant.train])
    assert other.terms_ == estimator.terms_
    (test, *_) = plant.tests["other"]
    first, second = (one.fitted.simulate(test)["displacement"] for one in (estimator, other))
    apart = np.sqrt(np.mean((first - second) ** 2))
    assert apart < 0.05 * np.sqrt(np.mean((first - test["displacement"]) ** 2))


@pytest.mark.parametrize(
    ("cause", "seed", "kind"),
    [("dead zone", 3, "dead"), ("wall", 0, "obstacle"), ("mass", 3, "mass")],
    ids=["dead zone", "wall", "mass"],
)
def test_what_is_there_is_found(cause: str, seed: int, kind: str) -> None:
    plant = sampled.with_one(cause, seed)
    estimator = BalanceEstimator().fit(plant.train)
    assert kind in phenomena(estimator)
    if kind == "dead":
        placed = balance_in(estimator.fitted)
        assert placed is not None
        zone = placed.before[-1]
        assert isinstance(zone, PiecewiseLinear)
        assert zone.knots[1] == pytest.approx(plant.truth["threshold_bar"], rel=0.05)


def test_beyond_its_data_a_muscle_stays_stiff_and_comes_back() -> None:
    plant, model = clean(14), fitted(14).fitted
    (recorded, *_) = plant.train
    span = np.ptp(np.concatenate([run["displacement"] for run in plant.train]))
    more = {name: 1.3 * recorded[name] for name in ("pressure", "force")}
    assert np.ptp(model.simulate(recorded.with_channels({}, **more))["displacement"]) < 2.0 * span
    placed = balance_in(model)
    assert placed is not None
    b = placed.balance
    low, high = b.hull[0]
    u = (
        np.clip(np.linspace(1.5 * low - 0.5 * high, 1.5 * high - 0.5 * low, 60), low, high)
        / b.scale
    )
    narrowing = np.polynomial.Polynomial(b.areas[0]).deriv()(u) / b.scale
    elastic = np.polynomial.Polynomial([0.0, 0.0, *b.elasticity[0]]).deriv()(u) / b.scale
    own = b.springs[0][1] + (b.bladders[0] if b.bladders else 0.0)
    for p in (0.0, b.highest_pressure):
        assert (own + elastic - p * narrowing > 0.0).all()
