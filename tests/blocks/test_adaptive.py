"""An inverse that learns: exact at every step, quick after a change, and taught by nothing wrong."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from mckibben import Block, ModelError, ModelWarning, Series, load
from mckibben.blocks.adaptive import Adaptive, adaptive
from mckibben.blocks.dynamics.creep import Creep
from mckibben.blocks.hysteresis.gpi import GPI
from mckibben.blocks.hysteresis.pi import PI
from mckibben.blocks.learning import READY, SENSES
from tests.refusals import refused

Array = NDArray[np.float64]

STEP = 0.01
MODELS: list[Any] = [PI.example(), GPI.example()]
CREEPING = Series((*Series.example().parts, Creep.example()))


def changed(model: Any, gain: float = 1.2, shift: float = 0.3) -> Block:
    """Return a model of another gain, and shifted."""
    theta = model.learnable.fitted.copy()
    theta[:-1] *= gain
    theta[-1] += shift
    found: Block = model.learnable.with_parameters(theta)
    return found


def references(model: Block, seconds: float, share: float = 0.7, seed: int = 0) -> Array:
    """Return random smooth motion within what is reachable."""
    rng = np.random.default_rng(seed)
    low, high = (float(end[0]) for end in model.reachable())
    turns = low + (high - low) * (0.1 + share * rng.random(int(seconds) + 2))
    turns[0] = low + 0.4 * (high - low)
    t = np.arange(round(seconds / STEP)) * STEP
    place, part = t.astype(int), t % 1.0
    ease = part**2 * (3 - 2 * part)
    return np.asarray(turns[place] + (turns[place + 1] - turns[place]) * ease)


def closed(block: Block, plants: list[Block], asked: Array, noise: float, seed: int = 0) -> Array:
    """Return what plants, each for its share of the time, give; the block learns from noisy readings."""
    rng = np.random.default_rng(seed)
    stream, runs = block.stream(STEP), [plant.stream(STEP) for plant in plants]
    given, reading = np.empty(asked.size), asked[0]
    for t, y in enumerate(asked):
        u = stream.step([y, reading])[0]
        outputs = [run.step(u)[0] for run in runs]
        given[t] = outputs[t * len(plants) // asked.size]
        reading = given[t] + noise * rng.standard_normal()
    return given


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


@pytest.mark.kernel
@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.kind)
@settings(max_examples=8, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), size=st.sampled_from([0.01, 1.0, 1e3, 1e200]))
def test_forward_and_inverse_match_at_every_step_whatever_is_measured(
    model: Any, seed: int, size: float
) -> None:
    rng = np.random.default_rng(seed)
    low, high = (float(end[0]) for end in model.reachable())
    block = Adaptive(model, 1.0, 0.01 * (high - low))
    stream = block.stream(STEP)
    middle = 0.5 * (low + high)
    for t in range(300):
        y = middle + 0.3 * (high - low) * np.sin(0.07 * t + 2 * np.sin(0.013 * t))
        measured = y + size * rng.standard_normal() if rng.random() > 0.1 else np.nan
        clipped = stream.state[model.n_inverse_states - 1]
        u = stream.step([y, measured])[0]
        state = stream.state
        assert np.isfinite(state).all()
        if t % 10 == 0 and state[model.n_inverse_states - 1] == clipped:
            memory = state[: model.n_states].tolist()
            given = block.present(state).simulate([u], initial=memory)[0]
            assert given == pytest.approx(y, abs=1e-9 * (high - low))


@pytest.mark.parametrize("model", [*MODELS, Series.example()], ids=lambda model: model.kind)
def test_after_a_step_the_error_is_that_of_a_fresh_model_within_two_cycles(model: Any) -> None:
    asked = references(model, 60.0)
    if isinstance(model, Series):
        aged: Block = Series((changed(model.parts[0], 1.2, 0.0), *model.parts[1:]))
    else:
        aged = changed(model)
    given = closed(adaptive(model, 20.0, 0.02), [model, aged], asked, 0.02)
    fixed = aged.simulate(model.inverse().simulate(asked))
    late = slice(5000, None)
    assert rms(given[late] - asked[late]) < 0.02
    assert rms(fixed[late] - asked[late]) > 0.5


@pytest.mark.kernel
@pytest.mark.parametrize(("absent", "most"), [(True, 1e-15), (False, 0.01)])
def test_a_sensor_that_drops_out_or_stands_still_teaches_nothing(absent: bool, most: float) -> None:
    model = PI.example()
    block: Any = Adaptive(model, 20.0, 0.02)
    stream, asked = block.stream(STEP), references(model, 30.0)
    for y in asked:
        assert np.isfinite(stream.step([y, np.nan if absent else asked[0]])).all()
    found, fitted = block.present(stream.state).learnable.fitted, model.learnable
    change = (found - fitted.fitted) / fitted.scales
    assert np.abs(change).max() < most


def test_nothing_blows_up_where_nothing_moves() -> None:
    model = GPI.example()
    block: Any = Adaptive(model, 5.0, 0.02)
    asked = np.full(20_000, references(model, 1.0)[0])
    given = closed(block, [changed(model)], asked, 0.02)
    assert abs(given[-1] - asked[0]) < 0.02


def experienced(block: Any, seconds: float = 10.0) -> tuple[Array, Array]:
    """Return a learner's state after readings 10 % above what was asked, and what was asked."""
    asked = references(PI.example(), seconds)
    stream = block.stream(STEP)
    for y in asked:
        stream.step([y, 1.1 * y])
    return np.array(stream.state), asked


@pytest.mark.parametrize("model", [*MODELS, CREEPING], ids=lambda model: model.kind)
def test_saved_and_resumed_it_goes_on_to_the_bit(model: Block, tmp_path: Path) -> None:
    block: Any = adaptive(model, 10.0, 0.05)
    state, asked = experienced(block)
    block.resumed(state).save(tmp_path / "learnt.json")
    again, going_on = load(tmp_path / "learnt.json").stream(STEP), block.stream(STEP, initial=state)
    for y in asked:
        np.testing.assert_array_equal(again.step([y, y]), going_on.step([y, y]))
    vented = block.resumed(state, memory=False)  # what is learnt, and not where it was
    begun = vented.initial_state(np.array([asked[0], asked[0]]), sample_time=STEP)
    assert str(vented.present(begun)) == str(block.present(state))


def test_a_memory_that_never_came_of_running_is_refused() -> None:
    block = Adaptive(PI.example(), 10.0, 0.05)
    memory = block.resumed(experienced(block, 2.0)[0]).memory
    assert memory is not None
    for place in (-block.n_adapted + 2 * block.learnable.fitted.size, -SENSES + READY):
        spoilt = np.array(memory)
        spoilt[place] = -1.0
        with refused(ModelError, parameter="memory", names="'adaptive'"):
            replace(block, memory=tuple(spoilt.tolist()))


def test_a_gain_that_drifts_is_found_and_nothing_else() -> None:
    model = PI.example()
    block: Any = adaptive(model, 20.0, 0.02)
    stream, plant = block.stream(STEP), changed(model, 1.2, 0.0).stream()
    reading, rng = 0.0, np.random.default_rng(5)
    for y in references(model, 60.0):
        reading = plant.step(stream.step([y, reading or y])[0])[0] + 0.02 * rng.standard_normal()
    found: Any = block.present(stream.state)
    assert np.sum(found.weights) == pytest.approx(1.2 * np.sum(model.weights), rel=0.005)
    assert found.offset == pytest.approx(model.offset, abs=0.1)


@pytest.mark.kernel
@pytest.mark.parametrize("model", [*MODELS, Series.example()], ids=lambda model: model.kind)
def test_clipped_samples_are_counted_as_by_the_inverse_that_does_not_learn(model: Block) -> None:
    low, high = (float(end[0]) for end in model.reachable())
    asked = low + (high - low) * (0.5 + 0.7 * np.sin(np.linspace(0.0, 9.0, 400)))
    fixed, block = model.inverse(), adaptive(model, 60.0)
    state = fixed.initial_state(asked[:1], sample_time=STEP)
    fixed.bind(STEP, state, asked[:, np.newaxis], np.empty((400, 1)))()
    count = fixed.n_clipped(state)
    assert count > 100
    silent = np.column_stack([asked, np.full(400, np.nan)])
    state = block.initial_state(silent[0], sample_time=STEP)
    block.bind(STEP, state, silent, np.empty((400, 1)))()
    assert block.n_clipped(state) == count
    with pytest.warns(ModelWarning, match=rf"^{count}\b"):
        block.report(state)
    resumed = block.resumed(state)
    assert resumed.n_clipped(resumed.initial_state(silent[0], sample_time=STEP)) == 0
