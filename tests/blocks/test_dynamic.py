"""Dynamic models against SciPy's filters and integrators."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import lfilter, lsim

from mckibben import Recording
from mckibben.blocks.dynamic.creep import Creep
from mckibben.blocks.dynamic.process_model import ProcessModel
from mckibben.blocks.dynamic.state_network import StateNetwork
from mckibben.blocks.dynamic.transfer_function import TransferFunction
from mckibben.papers.field_models.published import process_model

STEP = 0.01
INPUT = np.cumsum(np.random.default_rng(0).standard_normal(1500)) * 0.05

STRUCTURES = {
    "P1": ProcessModel(2.0, (0.3,)),
    "P1Z": ProcessModel(2.0, (0.3,), None, 0.5),
    "P2": ProcessModel(2.0, (2.0, 0.3)),
    "P2Z": ProcessModel(2.0, (2.0, 0.3), None, -0.2),
    "P2U": ProcessModel(2.0, (0.3,), 0.2),
    "P2UZ": ProcessModel(2.0, (0.3,), 0.4, 1.0),
    "P3": ProcessModel(2.0, (2.0, 0.3, 0.05)),
}


def continuous(model: ProcessModel) -> tuple[list[float], np.ndarray]:
    top = [model.gain] if model.zero_time is None else [model.gain * model.zero_time, model.gain]
    return top, model.denominator()


@pytest.mark.parametrize("name", STRUCTURES)
@pytest.mark.parametrize("hold", ["first", "zero"])
def test_process_models_are_discretised_exactly(name: str, hold: Literal["first", "zero"]) -> None:
    model = replace(STRUCTURES[name], hold=hold)
    assert model.name == name
    y = model.simulate(INPUT, initial="virgin", sample_time=STEP)
    if hold == "first":
        time = np.arange(INPUT.size + 1) * STEP
        expected = lsim(continuous(model), np.append(0.0, INPUT), time)[1][1:]
    else:
        expected = lsim(continuous(model), INPUT, np.arange(INPUT.size) * STEP, interp=False)[1]
    np.testing.assert_allclose(y, expected, atol=1e-10 * np.ptp(expected))


@pytest.mark.parametrize("delay", [0.01, 0.0234, 0.5])
def test_delays_between_samples_are_exact(delay: float) -> None:
    model = replace(STRUCTURES["P2UZ"], delay=delay)
    fine = 50
    time = np.arange(INPUT.size * fine) * STEP / fine
    known = np.append(-STEP, np.arange(INPUT.size) * STEP)
    late = np.interp(time - delay, known, np.append(0.0, INPUT), left=0.0)
    expected = lsim(continuous(model), late, time)[1][::fine]
    y = model.simulate(INPUT, initial="virgin", sample_time=STEP)
    np.testing.assert_allclose(y, expected, atol=1e-9 * np.ptp(expected))


def test_the_printed_p2uz_has_the_poles_that_its_numbers_give() -> None:
    poles = np.sort(np.roots(process_model().denominator()))
    np.testing.assert_allclose(poles, [-3.185, -0.00966], rtol=2e-3)


def test_a_rest_is_a_rest() -> None:
    for model in (*STRUCTURES.values(), TransferFunction.example(), Creep.example()):
        y = model.simulate(np.full(300, 3.0), sample_time=STEP)
        np.testing.assert_allclose(y, y[0], rtol=1e-9)


def test_transfer_function_is_scipys_filter() -> None:
    model = TransferFunction.example()
    y = model.simulate(INPUT, initial="virgin", sample_time=STEP)
    filtered = lfilter(model.numerator, [1.0, *model.denominator], INPUT - model.input_offset)
    np.testing.assert_allclose(y, filtered + model.output_offset, atol=1e-12)


# -- state-space networks --------------------------------------------------------------------------


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
