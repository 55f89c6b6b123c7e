"""Dynamic models against SciPy."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from scipy.signal import lsim

from mckibben.blocks.dynamics.process_model import ProcessModel
from mckibben.papers.paper import printed

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


def test_printed_numbers() -> None:
    poles = np.sort(np.roots(printed("field-models-p2uz").denominator()))
    np.testing.assert_allclose(poles, [-3.185, -0.00966], rtol=2e-3)
    assert printed("sdchm-coupling").radius == pytest.approx(0.456, abs=5e-4)
    per_bar, rest = printed("multistate-static-force").terms(np.array([190.0]))
    assert float(rest[0] + 4.0 * per_bar[0]) == pytest.approx(
        7596 - 136.6 * 4 - 93.14 * 190 + 1.176 * 190 * 4 + 0.2758 * 190**2
    )
