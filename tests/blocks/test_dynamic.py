"""Dynamic models against SciPy."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from scipy.signal import lsim

from mckibben.blocks.base import Block
from mckibben.blocks.compose import Parallel, Series
from mckibben.blocks.dynamics.creep import Creep
from mckibben.blocks.dynamics.process_model import ProcessModel
from mckibben.blocks.dynamics.transfer_function import TransferFunction
from mckibben.blocks.fields import DISPLACEMENT
from mckibben.blocks.memoryless import Affine, Negative
from mckibben.diagnosis.responses import linear_response
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


LINEAR = {
    "transfer function": TransferFunction.example(),
    "delays": TransferFunction((0.0, 0.0, 1.5), (-0.9,), STEP, 1.0, 2.0),
    "P1DZ": ProcessModel(2.0, (0.3,), None, 0.2, 0.0234),
    "P2DUZ, held": ProcessModel(2.0, (0.1,), 0.2, 0.3, 0.0251, 1.0, 2.0, "zero"),
    "creep": Creep((0.1, 0.05), (0.3, 4.0)),
    "series": Series(
        (
            ProcessModel(2.0, (0.3,), None, None, 0.02, 1.0, 3.0),
            Creep((0.1,), (0.4,)),
            Affine(2.0, 1.0, DISPLACEMENT, DISPLACEMENT),
            Negative(DISPLACEMENT, DISPLACEMENT),
        )
    ),
    "parallel": Parallel((ProcessModel(2.0, (0.3,)), TransferFunction((1.0, 0.5), (-0.7,), STEP))),
}


@pytest.mark.parametrize("name", LINEAR)
def test_frequency_responses_are_those_of_an_impulse(name: str) -> None:
    block: Block = LINEAR[name]
    rest = getattr(block, "input_offset", 0.0)
    impulse = np.full(6000, rest)
    impulse[1] += 1.0
    answer = np.asarray(block.simulate(impulse, sample_time=STEP))
    frequency = np.array([0.2, 3.0, 20.0])
    powers = np.exp(-2j * np.pi * STEP * np.outer(frequency, np.arange(5999)))
    expected = powers @ (answer - answer[0])[1:]
    found = linear_response(block, STEP, frequency)[:, 0, 0]
    np.testing.assert_allclose(found, expected, rtol=1e-4)


def test_printed_numbers() -> None:
    poles = np.sort(np.roots(printed("field-models-p2uz").denominator()))
    np.testing.assert_allclose(poles, [-3.185, -0.00966], rtol=2e-3)
    assert printed("sdchm-coupling").radius == pytest.approx(0.456, abs=5e-4)
    per_bar, rest = printed("multistate-static-force").terms(np.array([190.0]))
    assert float(rest[0] + 4.0 * per_bar[0]) == pytest.approx(
        7596 - 136.6 * 4 - 93.14 * 190 + 1.176 * 190 * 4 + 0.2758 * 190**2
    )
