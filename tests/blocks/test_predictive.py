"""Compensators that look ahead: the exact inverse where limits let it, and the best plan where not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import LinearConstraint, minimize

from mckibben import Block
from mckibben.arrays import Array
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.hysteresis.gpi import GPI
from mckibben.blocks.hysteresis.pi import PI
from mckibben.blocks.planning import MOST_SWEEPS, clip_path, find_minimum, plan_path, plan_scratch
from mckibben.blocks.predictive import Predictive
from tests.blocks.balances import CROWDED, in_series

STEP = 0.01
ARM = replace(Balance.example(), pressure_range=(0.0, 6.0))
INVERSES: dict[str, tuple[Block, list[float]]] = {
    "pi": (PI.example().inverse(), []),
    "gpi": (GPI.example().inverse(), []),
    "balance": (ARM, [1.0, 5.0]),
    "crowded": (replace(CROWDED, pressure_range=(0.0, 6.0)), [10.0]),
    "in series": (in_series(CROWDED, 2 * STEP).inverse(), [10.0]),
}


def wander(seed: int, n: int, width: int = 12) -> Array:
    """Return a smooth random path between 0.5 and 4.5."""
    rng = np.random.default_rng(seed)
    taps = np.hanning(4 * width)
    noise = np.convolve(rng.standard_normal(n + taps.size), taps, "valid")[:n]
    return np.asarray(2.5 + 2.0 * np.tanh(noise / noise.std()))


def motion(name: str, n: int, seed: int) -> tuple[Block, Array]:
    """Return an inverse, and references that its model reached, with what schedules it."""
    inverse, scheduled = INVERSES[name]
    driven = [wander(seed + 10 * k, n) for k in range(len(inverse.outputs))]
    table = np.stack([*driven, *(np.full(n, value) for value in scheduled)], axis=1)
    table[:20] = table[:1]
    reached = np.asarray(inverse.inverse().simulate(table, sample_time=STEP))
    references = np.hstack([reached.reshape(n, -1), table[:, len(driven) :]])
    references[:20] = references[20]
    return inverse, references


def ahead(references: Array, block: Predictive) -> Array:
    """Return references as a compensator that looks ahead is given them."""
    n = block.compensator.n_driven
    given = references.copy()
    places = np.minimum(np.arange(len(given)) + block.samples_ahead, len(given) - 1)
    given[:, :n] = references[places, :n]
    return given


def error(block: Predictive, references: Array) -> float:
    """Return the error that the model makes with a compensator's pressures."""
    n, m = len(block.outputs), block.compensator.n_driven
    pressures = np.asarray(block.simulate(ahead(references, block), sample_time=STEP))
    driven = np.hstack([pressures.reshape(-1, n), references[:, m:]])
    given = block.forward_model.simulate(driven, sample_time=STEP)
    return float(np.sqrt(np.mean((np.asarray(given) - references[:, :m]) ** 2)))


@pytest.mark.kernel
@pytest.mark.parametrize("name", INVERSES)
def test_without_active_limits_it_is_the_exact_inverse(name: str) -> None:
    inverse, references = motion(name, 300, seed=1)
    block = Predictive(inverse, horizon=6, rate_limit=1e6, pressure_range=(-1e3, 1e3))
    expected = inverse.simulate(references, sample_time=STEP)
    given = block.simulate(ahead(references, block), sample_time=STEP)
    assert np.abs(given - expected).max() <= 1e-12 * np.ptp(expected)


@pytest.mark.parametrize(
    "name",
    [
        "balance",
        "crowded",
        *(pytest.param(name, marks=pytest.mark.kernel) for name in ("pi", "gpi")),
    ],
)
def test_limits_hold_always_and_looking_ahead_costs_less(name: str) -> None:
    inverse, references = motion(name, 160, seed=3)
    errors = {}
    for horizon in (1, 20):
        block = Predictive(inverse, horizon, 14.0)
        pressures = np.asarray(block.simulate(ahead(references, block), sample_time=STEP))
        low, high = block.pressures
        assert (np.abs(np.diff(pressures, axis=0)) <= 14.0 * STEP + 1e-9).all()
        assert ((low <= pressures) & (pressures <= high)).all()
        errors[horizon] = error(block, references)
    assert errors[20] < 0.7 * errors[1]


def problem(n: int, m: int, seed: int) -> tuple[Array, Array, Array, Array, Array]:
    """Return limits and a plan's problem, of n pressures for m references."""
    rng = np.random.default_rng(seed)
    limits = np.concatenate([[0.08], np.zeros(n), np.full(n, 2.4)])
    slopes = rng.uniform(2.0, 6.0, (6, 1, 1)) * np.eye(n)
    slopes = slopes + 0.8 * (n > 1) * rng.standard_normal((6, n, n))
    nominal = 2.2 + np.cumsum(0.25 * rng.standard_normal((6, n)), axis=0)
    errors = rng.standard_normal((6, n))[:, :m]
    return limits, np.clip(nominal[0] + 0.1, 0.0, 2.3), slopes[:, :m], nominal, errors


@pytest.mark.kernel
@pytest.mark.parametrize(("n", "m"), [(1, 1), (2, 2), (3, 3), (2, 1)])
def test_plans_are_the_best_there_are(n: int, m: int) -> None:
    for seed in range(2):
        limits, before, slopes, nominal, errors = problem(n, m, seed)

        def lost(p: Array) -> float:
            off = np.einsum("tij,tj->ti", slopes, p.reshape(6, n) - nominal) - errors  # noqa: B023
            return float(0.5 * np.sum(off**2))

        changes = np.eye(6 * n) - np.eye(6 * n, k=-n)
        first = np.concatenate([before, np.zeros(5 * n)])
        best = minimize(
            lost,
            np.tile(before, 6),
            method="SLSQP",
            bounds=[(0.0, 2.4)] * (6 * n),
            constraints=[LinearConstraint(changes, first - 0.08, first + 0.08)],
            options={"maxiter": 500, "ftol": 1e-12},
        )
        path = np.concatenate([before, nominal.ravel()])
        given = (limits, slopes.ravel(), nominal.ravel(), errors.ravel())
        assert plan_path(*given, path, np.zeros(plan_scratch(6))) < MOST_SWEEPS
        assert clip_path(limits, path)
        assert lost(path[n:]) <= lost(best.x) + 1e-7
        if n == m:
            assert np.abs(path[n:] - best.x).max() < 1e-4


@pytest.mark.kernel
def test_plans_end_where_there_is_none() -> None:
    limits, before, slopes, nominal, errors = problem(2, 2, 0)
    for slope, start in ((np.nan, before), (1.0, before + 50.0)):
        path = np.concatenate([start, nominal.ravel()])
        flat = (slope * slopes.ravel(), nominal.ravel(), errors.ravel())
        plan_path(limits, *flat, path, np.zeros(plan_scratch(6)))
        assert np.isfinite(path).all()


@pytest.mark.kernel
@pytest.mark.parametrize(
    ("high", "least", "beyond", "there"), [(5.0, 1.0, 1, 1.0), (0.5, 0.5, 0, 1.0)]
)
def test_a_derivative_above_zero_throughout_is_least_at_its_lowest(
    high: float, least: float, beyond: int, there: float
) -> None:
    best, knots = np.zeros(1), np.array([1.0, 2.0, 3.0])
    assert find_minimum(3, knots, knots, 0.0, high, best, 0) == (beyond, there)
    assert best[0] == least


@pytest.mark.parametrize("error", [1e-14, 1e-13, -1e-13])
def test_an_inverse_that_is_resumed_does_not_take_rounding_for_a_reversal(error: float) -> None:
    compensator = GPI.example().inverse()
    middle = np.mean(compensator.reachable())
    stream = compensator.stream(STEP)
    stream.step(np.array([0.9 * middle]))
    before = stream.step(np.array([middle])).item()
    stream.state[compensator.n_states - 2] += error * middle  # the reference that it remembers
    stream.state[:-3] *= 1.0 + error
    assert stream.step(np.array([middle])).item() == pytest.approx(before, abs=1e-9)
