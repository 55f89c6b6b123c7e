"""Models described: what is said, and what is said to make no sense."""

from __future__ import annotations

import json
import warnings

import numpy as np
import pytest

from mckibben import PI, Recording
from mckibben.arrays import Array
from mckibben.blocks.compose import Series
from mckibben.blocks.core.block import Block
from mckibben.blocks.dynamic.transfer_function import TransferFunction
from mckibben.blocks.laws.examples import examples
from mckibben.blocks.memoryless.negative import Negative
from mckibben.errors import DataError
from mckibben.report import printed
from mckibben.report.description_subjects import figures, frequency_response
from mckibben.report.templating import template
from mckibben.validation.describing import describe

STEP = 0.05
EXAMPLES = examples()
SPANS = {"bar": (0.2, 4.8), "mm": (1.0, 20.0), "N": (1.0, 30.0), "V": (0.0, 9.0)}

SAME_CHANNELS = [
    title
    for title, block in EXAMPLES.items()
    if {c.name for c in block.inputs} & {c.name for c in block.outputs}
]


def recorded(block: Block, n: int = 300, seed: int = 0) -> Recording:
    """Return a recording of a block's own answer to waves, with noise."""
    step = block.sample_time or STEP
    t, columns, units = np.arange(n) / n, {}, {}
    for place, channel in enumerate(block.inputs):
        low, high = SPANS.get(channel.unit, (0.05, 0.2))
        wave = 0.5 - 0.5 * np.cos(2 * np.pi * (6 + 2.3 * place) * t)
        columns[channel.name] = low + (high - low) * wave
        units[channel.name] = channel.unit
    inputs = np.column_stack(list(columns.values()))
    outputs = np.asarray(block.simulate(inputs, sample_time=step)).reshape(n, -1)
    rng = np.random.default_rng(seed)
    for channel, y in zip(block.outputs, outputs.T, strict=True):
        columns[channel.name] = y + 0.01 * np.ptp(y) * rng.normal(size=n)
        units[channel.name] = channel.unit
    return Recording(columns, step, units=units)


@pytest.mark.parametrize("title", sorted(EXAMPLES.keys() - SAME_CHANNELS))
def test_every_block_is_described(title: str) -> None:
    block = EXAMPLES[title]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        recording = recorded(block)
    found = describe(block, [recording])
    assert len(found.parameters) == block.n_parameters
    for one in found.parameters:
        assert (one.standard_error is None) == (one.interval is None) == bool(one.said)
        if one.standard_error is not None:
            assert one.standard_error > 0
    assert found.frequency_responses or found.describing_functions
    told = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert told["parameters"][0]["name"] == found.parameters[0].name
    for (drawing,) in figures(found).values():
        assert drawing[0]["data"]


def noisy(u: Array, memory: float) -> tuple[Block, Recording]:
    from scipy.signal import lfilter

    block = TransferFunction((0.4, 0.2), (-0.7,), STEP, noise_denominator=(-memory,))
    shocks = np.random.default_rng(3).normal(0, 0.1, u.size)
    y = np.asarray(block.simulate(u, sample_time=STEP)) + lfilter([1.0], [1.0, -memory], shocks)
    return block, Recording({"pressure": u, "displacement": y}, STEP)


def steps(n: int = 3000) -> Array:
    return np.repeat(np.random.default_rng(5).uniform(0.2, 4.8, n // 10), 10)


def test_criteria_are_those_of_the_residuals_one_step_ahead() -> None:
    block, recording = noisy(steps(), 0.9)
    found = describe(block, [recording]).criteria
    assert found.of == "one step ahead"
    assert found.fpe is not None
    assert found.aic is not None
    assert found.bic is not None
    assert abs(found.fpe / 0.01 - 1) < 0.1  # the variance of the shocks
    n, p = 3000, 4  # b_0, b_1, f_1 and d_1
    assert (found.n_samples, found.n_parameters) == (n, p)
    assert abs((found.bic - found.aic) - p * (np.log(n) - 2)) < 1e-9
    assert abs(found.aic / n - np.log(found.fpe)) < 1e-5


def test_without_its_noise_model_there_are_no_criteria() -> None:
    block, recording = noisy(steps(), 0.9)
    assert isinstance(block, TransferFunction)
    bare = TransferFunction(block.numerator, block.denominator, STEP)
    found = describe(bare, [recording]).criteria
    assert (found.aic, found.bic, found.fpe) == (None, None, None)
    assert "not white" in found.said


def test_a_linear_model_turned_over_predicts_too() -> None:
    block, recording = noisy(steps(), 0.9)
    turned = Series((block, Negative(block.outputs[0], block.outputs[0])))
    fallen = recording.with_channels(
        {"displacement": "mm"}, displacement=-recording["displacement"]
    )
    ours, theirs = describe(block, [recording]).criteria, describe(turned, [fallen]).criteria
    assert ours.aic is not None
    assert theirs.aic is not None
    assert abs(ours.aic - theirs.aic) < 1e-6


def test_correlated_free_runs_are_worth_fewer_samples_and_get_no_criteria() -> None:
    u = np.asarray(recorded(PI.example(), 3000)["pressure"])
    from scipy.signal import lfilter

    y = PI.example().simulate(u)
    y = y + np.asarray(lfilter([1.0], [1.0, -0.9], np.random.default_rng(0).normal(0, 0.1, u.size)))
    found = describe(PI.example(), [Recording({"pressure": u, "displacement": y}, STEP)])
    assert found.criteria.aic is None
    assert 80 < found.n_effective < 320  # 3000 / 19
    assert f"worth about {round(found.n_effective)}" in found.criteria.said


def test_of_a_compensator_no_errors_are_given() -> None:
    block = PI.example().inverse()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        recording = recorded(block)
    found = describe(block, [recording])
    assert all(one.standard_error is None for one in found.parameters)
    assert "inverse" in found.unsure
    page = template("_model.html.j2").render(description=found, figures=figures(found))
    assert page.count(found.unsure) == 1


def test_the_output_named_is_the_only_one_shown() -> None:
    block = EXAMPLES["per-channel"]
    found = describe(block, [recorded(block)], "displacement_2")
    assert [one.output.name for one in found.describing_functions] == ["displacement_2"]
    with pytest.raises(DataError, match="name one of those"):
        describe(block, [recorded(block)], "force")
    with pytest.raises(DataError, match="give one or more"):
        describe(block, [])


def test_a_recording_without_the_output_is_refused() -> None:
    with pytest.raises(DataError, match="displacement"):
        describe(PI.example(), [Recording({"pressure": np.linspace(0, 5, 50)}, STEP)])


def test_figures_are_printed_too() -> None:
    block, recording = noisy(steps(), 0.0)
    found = describe(block, [recording])
    figure = printed.drawn(frequency_response(found.frequency_responses[0]))
    assert [axis.get_xscale() for axis in figure.axes] == ["log", "log"]
