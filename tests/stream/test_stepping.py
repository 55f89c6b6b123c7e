"""A block in a loop gives what simulate gives, and survives bad inputs as exported C does."""

from __future__ import annotations

import numpy as np

from mckibben.blocks.memoryless.polynomial import Polynomial
from mckibben.registry import load
from mckibben.stream import Step, run


def test_bad_inputs_change_nothing() -> None:
    block = load("blocks", "gpi").example()
    inputs = np.random.default_rng(0).uniform(0.0, 5.0, 50)
    expected = block.simulate(inputs)
    step, outputs = Step(block), []
    step([3.0])
    step.reset()
    assert step([np.nan])[0] == 0.0
    for value in inputs:
        outputs.append(step([value])[0])
        assert step.status == Step.GOOD
        assert step([np.inf])[0] == outputs[-1]
        assert step.status == Step.BAD_INPUT
    np.testing.assert_array_equal(outputs, expected)


def test_outputs_are_always_finite() -> None:
    step = Step(Polynomial((0.0, 1e200, 1e200)))
    first = step([1.0])
    np.testing.assert_array_equal(step([1e200]), first)
    assert step.status == Step.BAD_OUTPUT


def test_run_reads_steps_and_writes_until_time_is_up() -> None:
    block, written = load("blocks", "pi").example(), []
    inputs = iter(np.linspace(0.0, 5.0, 1000))
    kept = run(
        block, lambda: [next(inputs)], lambda y: written.append(y[0]), period=0.001, duration=0.05
    )
    assert kept.work.size + kept.missed == 50
    expected = block.simulate(np.linspace(0.0, 5.0, 1000)[: len(written)])
    np.testing.assert_array_equal(written, expected)


def test_ctrl_c_ends_the_loop_and_keeps_its_statistics() -> None:
    def read() -> list[float]:
        raise KeyboardInterrupt

    kept = run(load("blocks", "pi").example(), read, lambda y: None, period=0.001)
    assert kept.work.size == 1
