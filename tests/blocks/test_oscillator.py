"""Oscillators with hysteresis in their loop: equations solved by others, limits, laws of scale."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.signal import cont2discrete, lfilter

from mckibben import ModelError, Recording
from mckibben.blocks.differential.bouc_wen_oscillator import BoucWenOscillator
from mckibben.blocks.differential.duhem_oscillator import DuhemOscillator
from mckibben.blocks.dynamic.process_model import ProcessModel

Array = NDArray[np.float64]

STEP = 1 / 750
HARD = BoucWenOscillator(2.0, 0.01, 50.0, 50.0, 0.8, -1.1)
"""Whose loops harden, of 35 Hz."""


def sweep(n: int, step: float = STEP, highest: float = 40.0) -> Array:
    """Return a sine whose frequency rises from 15 Hz, beginning from rest."""
    t = step * np.arange(n)
    return 40.0 * np.sin(2 * np.pi * (15.0 + (highest - 15.0) * t / (2 * t[-1])) * t)


def solved(model: BoucWenOscillator, u: Array, step: float) -> Array:
    """Return the displacement from rest under straight lines, at a tight tolerance."""

    def rates(t: float, x: Array, start: float, rise: float) -> list[float]:
        y, v, z = x
        pull = start + rise * t - model.damping * v - model.stiffness * y - z
        loops = model.gamma * abs(v) * z + model.delta * v * abs(z)
        return [v, 1e3 * pull / model.mass, model.slope * v - loops]

    x: Array = np.zeros(3)
    found = [0.0]
    for start, end in pairwise(u.tolist()):
        given = (start, (end - start) / step)
        x = solve_ivp(rates, (0.0, step), x, "DOP853", args=given, rtol=1e-11, atol=1e-12).y[:, -1]
        found.append(x[0])
    return np.array(found)


def test_a_sweep_from_rest_agrees_with_a_solver_of_tight_tolerance() -> None:
    u = sweep(750)
    expected = solved(HARD, u, STEP)
    errors = [
        np.abs(replace(HARD, substeps=n).simulate(u, sample_time=STEP) - expected).max()
        for n in (10, 40)
    ]
    assert errors[0] < 1e-4 * np.ptp(expected)
    assert errors[1] < errors[0] / 10  # of second order, for the element has corners
    wrong = replace(HARD, gamma=1.01 * HARD.gamma).simulate(u, sample_time=STEP)
    assert np.abs(wrong - expected).max() > 1e-3 * np.ptp(expected)


def test_without_hysteresis_it_is_a_linear_oscillator() -> None:
    model = BoucWenOscillator(2.0, 0.05, 30.0, 20.0, 0.0, 0.0, 0.5, 40)
    time_constant = np.sqrt(1e-3 * model.mass / 50.0)
    linear = ProcessModel(
        0.02, (time_constant,), 0.05 / (2 * time_constant * 50.0), output_offset=0.5
    )
    u = sweep(400)
    expected = linear.simulate(u, sample_time=STEP)
    np.testing.assert_allclose(model.simulate(u, sample_time=STEP), expected, atol=1e-6)


@pytest.mark.kernel
def test_the_input_can_be_held_between_samples() -> None:
    model = BoucWenOscillator(2.0, 0.05, 30.0, 20.0, 0.0, 0.0, substeps=40, hold="zero")
    numerator, denominator, _ = cont2discrete((np.ones(1), np.array([2e-3, 0.05, 50.0])), STEP)
    u = np.append(0.0, np.random.default_rng(0).normal(size=200))
    expected = lfilter(numerator.ravel(), denominator, u)
    np.testing.assert_allclose(model.simulate(u, sample_time=STEP), expected, atol=1e-7)


def test_two_straight_curves_are_the_element_of_bouc_and_wen() -> None:
    both, far = np.array([HARD.gamma, HARD.delta]), 1e3
    rising = [
        HARD.slope + far * (HARD.gamma - HARD.delta),
        HARD.slope,
        HARD.slope - far * both.sum(),
    ]
    duhem = DuhemOscillator(2.0, 0.01, 50.0, tuple(rising), tuple(rising[::-1]), (-far, 0.0, far))
    u = sweep(750) + 10.0
    np.testing.assert_allclose(
        duhem.simulate(u, sample_time=STEP), HARD.simulate(u, sample_time=STEP), atol=1e-10
    )


@pytest.mark.parametrize("model", [HARD, DuhemOscillator.example()])
@pytest.mark.parametrize("force", [-3.0, 2.0])
def test_it_rests_where_a_slow_force_leads(model: Any, force: float) -> None:
    held = model.simulate(np.full(200, force), sample_time=STEP)
    np.testing.assert_allclose(held, held[0], rtol=1e-12)
    ramp = np.interp(np.arange(40_000), [0, 30_000], [0.0, force])
    slow = replace(model, damping=2.0).simulate(ramp, sample_time=0.002, initial="virgin")
    assert slow[-1] == pytest.approx(held[0], rel=2e-3)


@pytest.mark.parametrize("ratio", [1, 5])
def test_steady_state_is_what_a_force_that_repeats_leads_to(ratio: int) -> None:
    """A band-limited period, at its own rate or sampled more finely, gives the same response."""
    rng, n = np.random.default_rng(0), 300
    lines = np.zeros(n // 2 + 1, dtype=complex)
    lines[4:30] = np.exp(2j * np.pi * rng.random(26))
    u = np.fft.irfft(lines, n) * 600.0
    steady = HARD.steady_state(Recording({"force": u}, STEP))["displacement"]
    fine = np.fft.irfft(np.append(lines, np.zeros((20 * ratio - 1) * n // 2)), 20 * ratio * n)
    fine *= 600.0 * 20 * ratio
    finely = replace(HARD, substeps=1)
    long = finely.simulate(np.tile(fine, 8), sample_time=STEP / (20 * ratio))
    late = long[-fine.size :: 20 * ratio]
    np.testing.assert_allclose(steady, late, atol=(1e-8, 2e-4)[ratio > 1] * np.ptp(late))
    from_rest = HARD.simulate(u, sample_time=STEP)
    assert np.abs(from_rest - late).max() > 0.05 * np.ptp(late)


def test_a_response_that_never_repeats_is_told() -> None:
    undamped = BoucWenOscillator(2.0, 0.0, 50.0, 50.0, 0.0, 0.0)
    shaken = Recording({"force": np.sin(np.arange(40.0))}, STEP)
    with pytest.raises(ModelError):
        undamped.steady_state(shaken)
