"""Compensators that look ahead: the exact inverse where limits let it, and the best plan where not."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import LinearConstraint, minimize

from mckibben import Block
from mckibben.arrays import Array
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.hysteresis.gpi import GPI
from mckibben.blocks.hysteresis.pi import PI
from mckibben.blocks.planning import (
    MOST_STEPS,
    allowed,
    limit_rows,
    plan_one,
    plan_scratch,
    plan_several,
    turned,
)
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
        block = Predictive(inverse, horizon, 14.0, total_limit=8.0, flow_limit=20.0)
        rows = block.rows(STEP)
        pressures = np.asarray(block.simulate(ahead(references, block), sample_time=STEP))
        for before, now in pairwise(pressures):
            moved = np.where(rows[:, :1] > 0, now - before, now)
            assert (np.sum(rows[:, 2:] * moved, axis=1) <= rows[:, 1] + 1e-9).all()
        errors[horizon] = error(block, references)
    assert errors[20] < 0.7 * errors[1]


def problem(n: int, m: int, seed: int) -> tuple[Array, Array, Array, Array, Array]:
    """Return limits and a plan's problem, of n pressures for m references."""
    rng = np.random.default_rng(seed)
    draw = np.inf if n == 1 else 0.06 * n
    rows = limit_rows(np.zeros(n), np.full(n, 5.0), 0.08, 2.4 * n, draw, rng.uniform(0.5, 2.0, n))
    slopes = rng.uniform(2.0, 6.0, (6, 1, 1)) * np.eye(n)
    slopes = slopes + 0.8 * (n > 1) * rng.standard_normal((6, n, n))
    nominal = 2.2 + np.cumsum(0.25 * rng.standard_normal((6, n)), axis=0)
    errors = rng.standard_normal((6, n))[:, :m]
    return rows, np.clip(nominal[0] + 0.1, 0.0, 2.3), slopes[:, :m], nominal, errors


@pytest.mark.kernel
@pytest.mark.parametrize(("n", "m"), [(1, 1), (2, 2), (2, 1)])
def test_plans_are_the_best_there_are(n: int, m: int) -> None:
    for seed in range(2):
        rows, before, slopes, nominal, errors = problem(n, m, seed)

        def lost(p: Array) -> float:
            off = np.einsum("tij,tj->ti", slopes, p.reshape(6, n) - nominal) - errors  # noqa: B023
            return float(0.5 * np.sum(off**2))

        path = np.eye(6 * n) - np.eye(6 * n, k=-n)
        tables, bounds = [], []
        for row in rows:
            every = np.kron(np.eye(6), row[2:])
            changes = row[0] > 0
            tables.append(every @ path if changes else every)
            bound = np.full(6, row[1])
            bound[0] += changes * (row[2:] @ before)
            bounds.append(bound)
        limits = LinearConstraint(np.vstack(tables), -np.inf, np.concatenate(bounds))
        start = np.tile(before, 6)
        best = minimize(
            lost,
            start,
            method="SLSQP",
            constraints=[limits],
            options={"maxiter": 500, "ftol": 1e-12},
        )
        path = np.concatenate([before, nominal.ravel()])
        given = (n, rows.ravel(), slopes.ravel(), nominal.ravel(), errors.ravel())
        plan_several(*given, path, np.zeros(1000))
        found = path[n:]
        assert lost(found) <= lost(best.x) + 1e-7
        if n == m:
            assert np.abs(found - best.x).max() < 1e-4
        if n == 1:
            exact = np.concatenate([before, nominal.ravel()])
            plan_one(*given, exact, np.zeros(plan_scratch(6, 1, len(rows))))
            assert np.abs(exact[1:] - found).max() < 1e-4
            assert lost(exact[1:]) <= lost(best.x) + 1e-7


@pytest.mark.kernel
def test_plans_end_where_there_is_none() -> None:
    rows, before, slopes, nominal, errors = problem(2, 2, 0)
    for slope, start, steps in ((np.nan, before, 0), (1.0, before + 50.0, MOST_STEPS)):
        path = np.concatenate([start, nominal.ravel()])
        flat = (slope * slopes.ravel(), nominal.ravel(), errors.ravel())
        scratch = np.zeros(plan_scratch(6, 2, len(rows)))
        assert plan_several(2, rows.ravel(), *flat, path, scratch) == steps
        assert np.isfinite(path).all()


@pytest.mark.kernel
@pytest.mark.parametrize(
    ("high", "least", "beyond", "there"), [(5.0, 1.0, 1, 1.0), (0.5, 0.5, 0, 1.0)]
)
def test_a_derivative_above_zero_throughout_is_least_at_its_lowest(
    high: float, least: float, beyond: int, there: float
) -> None:
    best, knots = np.zeros(1), np.array([1.0, 2.0, 3.0])
    assert turned(3, knots, knots, 0.0, high, best, 0) == (beyond, there)
    assert best[0] == least


@pytest.mark.kernel
def test_the_supply_takes_from_all_in_one_share() -> None:
    rows = limit_rows(np.zeros(2), np.full(2, 5.0), np.inf, 6.0, 1.0, np.ones(2)).ravel()
    path = np.array([1.0, 1.0, 3.0, 2.0])
    assert not allowed(2, rows, path, 0, False)
    assert path[2:] == pytest.approx([1.5, 1.5])
    falling = np.array([4.0, 1.0, 0.0, 2.0])
    assert allowed(2, rows, falling, 0, False)  # what vents gives nothing back
    assert not allowed(2, rows, np.array([4.0, 0.5, 0.0, 2.0]), 0, False)


@pytest.mark.kernel
def test_a_supply_limits_one_muscle_too() -> None:
    inverse, references = motion("pi", 300, 5)
    for limits in ({"total_limit": 1.0}, {"pressure_range": (0.0, 1.0)}):
        block = Predictive(inverse, horizon=8, rate_limit=5.0, **limits)
        found = np.asarray(block.simulate(ahead(references, block), sample_time=STEP))
        assert 0.99 < found.max() <= 1.0 + 1e-9
        if "total_limit" in limits:
            first = found
    np.testing.assert_allclose(found, first, rtol=0.0, atol=1e-9)


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
