"""State-space networks: solved by others, linear where nothing is read of units, and at rest."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mckibben import Recording
from mckibben.blocks.dynamic.process_model import ProcessModel
from mckibben.blocks.dynamic.state_network import StateNetwork

STEP = 0.01
MODEL = StateNetwork.example()
FORCE = 3.0 * np.sin(0.002 * np.arange(300) ** 1.5)


def test_it_agrees_with_a_solver_of_tight_tolerance() -> None:
    linear, hidden, readout = (
        np.array(rows) for rows in (MODEL.linear, MODEL.hidden, MODEL.readout)
    )
    t = STEP * np.arange(-1, FORCE.size)
    scaled = (np.append(0.0, FORCE) - MODEL.input_offset) / MODEL.input_scale

    def rates(now: float, x: Any) -> Any:
        known = np.array([*x, np.interp(now, t, scaled), 1.0])
        return MODEL.rate * (linear @ known + readout @ np.tanh(hidden @ known))

    found = solve_ivp(
        rates, (t[0], t[-1]), np.zeros(2), t_eval=t[1:], rtol=1e-10, atol=1e-10, max_step=STEP
    ).y[0]
    expected = MODEL.output_offset + MODEL.output_scale * found
    given = replace(MODEL, substeps=20).simulate(FORCE, sample_time=STEP, initial="virgin")
    np.testing.assert_allclose(given, expected, atol=1e-6 * np.ptp(expected))


def test_without_units_it_is_linear() -> None:
    """An oscillator of 15 rad/s, of which the network knows time in its own units."""
    silent = replace(
        MODEL,
        linear=((0.0, 1.0, 0.0, 0.0), (-1.0, -0.4, 1.0, 0.0)),
        readout=((0.0, 0.0), (0.0, 0.0)),
        substeps=20,
    )
    gain = MODEL.output_scale / MODEL.input_scale
    linear = ProcessModel(gain, (1 / 15.0,), 0.2, input_offset=1.0, output_offset=0.5)
    expected = linear.simulate(FORCE + 2.0, sample_time=STEP)
    given = silent.simulate(FORCE + 2.0, sample_time=STEP)
    np.testing.assert_allclose(given, expected, atol=1e-4 * np.ptp(expected))


def test_a_held_input_goes_in_steps() -> None:
    held = replace(MODEL, hold="zero")
    steps = np.repeat([0.0, 1.0, -2.0], 20)
    late = np.append(steps[:1], steps[:-1])  # what is held from a sample on is felt at the next
    finer = replace(MODEL, substeps=2 * 50)
    ramps = finer.simulate(np.interp(np.arange(60), np.arange(60), late), sample_time=STEP)
    given = held.simulate(steps, sample_time=STEP)
    assert np.abs(given - ramps).max() < 0.2 * np.ptp(given)
    assert given[20] == pytest.approx(given[19])
    assert abs(given[21] - given[20]) > 1e-4 * np.ptp(given)


def test_steady_states_repeat() -> None:
    wave = Recording({"force": np.sin(2 * np.pi * np.arange(100) / 50)}, STEP)
    found = MODEL.steady_state(wave)["displacement"]
    np.testing.assert_allclose(found[:50], found[50:], atol=1e-9)
