"""Free runs begin from the first measured output for what that determines, at rest for the rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mckibben import GPI, PI, RateDependentPI, Recording, Series
from mckibben.blocks.base import Block
from mckibben.blocks.dynamics.creep import Creep
from mckibben.blocks.dynamics.narx import NarxPolynomial
from mckibben.blocks.dynamics.process_model import ProcessModel
from mckibben.blocks.dynamics.transfer_function import TransferFunction
from mckibben.recording import PERIODIC

T = np.linspace(0, 1, 800)
U = 2.5 + 2.0 * np.sin(17 * T) * (1 - 0.5 * T) - 0.4 * np.sin(50 * T)
MEMORY: list[Block] = [PI.example(), GPI.example(), Series.example(), RateDependentPI.example()]
LINEAR: list[Block] = [
    ProcessModel(3.0, (0.5,)),
    ProcessModel(3.0, (0.5, 0.2), zero_time=0.1),
    TransferFunction((0.3, 0.1), (-1.2, 0.4), 0.01),
]


def recorded(block: Block, u: np.ndarray) -> Recording:
    y = block.simulate(u, sample_time=0.01, initial="first_sample")
    return Recording({"pressure": u, "displacement": y}, 0.01)


@pytest.mark.parametrize("block", [*MEMORY, *LINEAR], ids=lambda block: block.kind)
def test_a_run_from_rest_begins_at_rest(block: Block) -> None:
    recording = recorded(block, U)
    assert len(block.past(block.as_run(recording))) == 0
    np.testing.assert_array_equal(
        block.start_on(recording), block.initial_state(U[:1], sample_time=0.01)
    )
    np.testing.assert_array_equal(
        block.simulate(recording)["displacement"], recording["displacement"]
    )


@pytest.mark.parametrize("block", MEMORY, ids=lambda block: block.kind)
def test_a_run_that_came_down_from_a_peak_begins_after_it(block: Block) -> None:
    before = np.concatenate([np.linspace(0.5, 4.3, 50), np.linspace(4.3, U[0], 400), U])
    whole = recorded(block, before)
    cut = whole.slice(450, len(whole))
    error = block.simulate(cut)["displacement"] - cut["displacement"]
    at_rest = block.simulate(cut, initial="first_sample")["displacement"] - cut["displacement"]
    assert np.abs(error).max() < 0.02 * np.abs(at_rest).max()


@pytest.mark.parametrize("block", LINEAR, ids=lambda block: block.kind)
@pytest.mark.parametrize("elsewhere", [-4.0, 0.7, 9.0])
def test_a_linear_model_was_at_rest_where_the_first_output_is(
    block: Block, elsewhere: float
) -> None:
    whole = recorded(block, np.concatenate([np.full(3, elsewhere), U]))
    cut = whole.slice(3, len(whole))
    np.testing.assert_allclose(block.simulate(cut)["displacement"], cut["displacement"], atol=1e-9)


def test_a_model_of_past_outputs_has_had_the_first_one() -> None:
    block = NarxPolynomial.example()
    recording = recorded(block, U).with_channels(displacement=np.full(U.size, 3.0))
    centre, half = block.output_scale
    state = block.start_on(recording)
    np.testing.assert_allclose(state[: block.output_lags], (3.0 - centre) / half)


def test_only_the_first_measured_output_is_looked_at() -> None:
    block = GPI.example()
    recording = recorded(block, U)
    spoilt = recording["displacement"].copy()
    spoilt[1:] = 99.0
    np.testing.assert_array_equal(
        block.simulate(recording.with_channels(displacement=spoilt))["displacement"],
        block.simulate(recording)["displacement"],
    )


def test_what_is_stated_is_not_overruled() -> None:
    block = PI.example()
    high = recorded(block, U).with_channels(displacement=np.full(U.size, 99.0))
    for stated in ("first_sample", "virgin"):
        found = block.simulate(high, initial=stated)["displacement"]
        np.testing.assert_array_equal(found, block.simulate(U, initial=stated))
    creeping = Series((PI.example(), replace(Creep.example(), initial="virgin")))
    np.testing.assert_array_equal(
        creeping.simulate(high)["displacement"], creeping.simulate(U, sample_time=0.01)
    )


def test_a_compensator_begins_at_rest_whatever_was_commanded() -> None:
    inverse = PI.example().inverse()
    wanted = recorded(PI.example(), U)
    spoilt = wanted.with_channels(pressure=np.full(U.size, 5.0))
    np.testing.assert_array_equal(
        inverse.simulate(spoilt)["pressure"], inverse.simulate(wanted["displacement"])
    )


def test_of_a_period_that_is_repeated_no_start_counts() -> None:
    block = RateDependentPI.example()
    wave = 2.5 + 2.0 * np.sin(2 * np.pi * np.arange(200) / 200)
    recording = recorded(block, np.tile(wave, 3)).slice(200, 400)
    found = block.simulate(recording.with_meta(**{PERIODIC: True}))["displacement"]
    expected = block.simulate(np.tile(wave, 2), sample_time=0.01)[200:]
    np.testing.assert_array_equal(found, expected)
    assert not np.array_equal(found, block.simulate(wave, sample_time=0.01))
