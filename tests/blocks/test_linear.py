"""Linear blocks handed over: SciPy and python-control simulate what blocks do."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest
from scipy.signal import dlsim

from mckibben.blocks.compose import Parallel, Series
from mckibben.blocks.core.block import Block
from mckibben.blocks.core.fields import DISPLACEMENT
from mckibben.blocks.dynamic.creep import Creep
from mckibben.blocks.dynamic.process_model import ProcessModel
from mckibben.blocks.dynamic.transfer_function import TransferFunction
from mckibben.blocks.memoryless.affine import Affine
from mckibben.blocks.memoryless.negative import Negative
from mckibben.errors import DataError

STEP = 0.01

LINEAR = {
    "transfer function": TransferFunction.example(),
    "delays": TransferFunction((0.0, 0.0, 1.5), (-0.9,), STEP, 1.0, 2.0),
    "more zeros than poles": TransferFunction((1.0, 0.5, 0.2), (), STEP),
    "P1": ProcessModel(2.0, (0.3,), None, None, 0.0, 1.0, 3.0),
    "P1Z": ProcessModel(2.0, (0.3,), None, 0.1),
    "P2D": ProcessModel(2.0, (0.3, 0.05), None, None, 0.037),
    "P1DZ": ProcessModel(2.0, (0.3,), None, 0.2, 0.0234),
    "P2DUZ, held": ProcessModel(2.0, (0.1,), 0.2, 0.3, 0.0251, 1.0, 2.0, "zero"),
    "P3": ProcessModel(-1.0, (0.5, 0.2, 0.03)),
    "affine": Affine(2.0, 1.0),
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
def test_scipy_and_python_control_simulate_the_same(name: str) -> None:
    block: Block = LINEAR[name]
    system, u = block.linear_system(STEP), np.random.default_rng(3).uniform(0.0, 5.0, 300)
    u0, y0 = float(system.input_offset[0]), float(system.output_offset[0])
    # from the operating point, at rest there
    expected = np.asarray(block.simulate([u0, *u], sample_time=STEP))[1:] - y0
    discrete: Any = block.to_scipy(STEP)
    found = [dlsim(discrete, u - u0)[1][:, 0]]
    if find_spec("control"):
        control = import_module("control")
        response = control.forced_response(block.to_control(STEP), U=u - u0)
        found.append(np.squeeze(response.outputs))
    for one in found:
        assert np.abs(one - expected).max() < 1e-10 * np.abs(expected).max()


def test_a_continuous_model_comes_as_it_is_written() -> None:
    model = ProcessModel(2.0, (0.1,), 0.4, 0.3)
    system = model.to_scipy()
    w, found = system.freqresp(np.array([0.5, 3.0, 20.0]))
    s = 1j * w
    expected = 2.0 * (0.3 * s + 1) / (0.01 * s**2 + 2 * 0.4 * 0.1 * s + 1)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


@pytest.mark.parametrize("name", LINEAR)
def test_a_sine_comes_out_as_the_frequency_response_says(name: str) -> None:
    block, frequency = LINEAR[name], 2.0
    t = STEP * np.arange(4000)
    system = block.linear_system(STEP)
    u = system.input_offset[0] + np.sin(2 * np.pi * frequency * t)
    y = np.asarray(block.simulate(u, sample_time=STEP))[-1000:]  # whole periods, at rest
    turned = np.exp(-2j * np.pi * frequency * t[-1000:])
    found = (y @ turned) / ((u - u.mean())[-1000:] @ turned)
    expected = system.response(np.array([frequency]))[0, 0, 0]
    assert abs(found - expected) < 2e-4 * abs(expected) + 1e-3 * (name == "creep")


def test_without_python_control_its_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "control", None)
    with pytest.raises(DataError, match=r"mckibben\[control\]"):
        TransferFunction.example().to_control()
