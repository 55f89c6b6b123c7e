"""Free runs begin where measured memory is: at its peak, at what came before, at a period."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mckibben import GPI, PI, RateDependentPI, Recording, Series
from mckibben.blocks.base import Block
from mckibben.blocks.dynamics.creep import Creep
from mckibben.blocks.free_run import PERIODIC, measured_start, run_free

T = np.linspace(0, 1, 800)
U = 2.5 + 2.0 * np.sin(17 * T) * (1 - 0.5 * T) - 0.4 * np.sin(50 * T)
BLOCKS: list[Block] = [PI.example(), GPI.example(), Series.example(), RateDependentPI.example()]


def recorded(block: Block, u: np.ndarray) -> Recording:
    y = block.simulate(u, sample_time=0.01, initial="first_sample")
    return Recording({"pressure": u, "displacement": y}, 0.01)


@pytest.mark.parametrize("block", BLOCKS, ids=lambda block: block.kind)
def test_a_run_that_has_only_risen_starts_from_first_sample(block: Block) -> None:
    recording = recorded(block, U)
    start = measured_start(block, recording, "displacement")
    np.testing.assert_array_equal(start, block.initial_state(U[:1], "first_sample"))
    np.testing.assert_array_equal(
        run_free(block, recording, "displacement"), recording["displacement"]
    )


@pytest.mark.parametrize("block", BLOCKS, ids=lambda block: block.kind)
def test_a_run_that_came_down_from_a_peak_starts_right(block: Block) -> None:
    history = np.concatenate([np.linspace(0.5, 4.3, 50), np.linspace(4.3, U[0], 400), U])
    whole = recorded(block, history)
    cut = whole.slice(450, len(whole))
    error = run_free(block, cut, "displacement") - cut["displacement"]
    blind = block.simulate(cut)["displacement"] - cut["displacement"]
    assert np.abs(error).max() < 0.02 * np.abs(blind).max()


@pytest.mark.parametrize("block", BLOCKS, ids=lambda block: block.kind)
def test_a_run_that_continues_another_starts_from_its_memory(block: Block) -> None:
    whole = recorded(block, np.concatenate([U, U[::-1]]))
    first, second = whole.slice(0, 700), whole.slice(700, len(whole))
    assert second.continues(first)
    np.testing.assert_allclose(
        run_free(block, second, "displacement", [first]),
        second["displacement"],
        rtol=0,
        atol=1e-12,
    )


def test_only_the_first_measured_output_is_looked_at() -> None:
    block = GPI.example()
    recording = recorded(block, U)
    spoilt = recording["displacement"].copy()
    spoilt[1:] = 99.0
    np.testing.assert_array_equal(
        run_free(block, recording.with_channels(displacement=spoilt), "displacement"),
        run_free(block, recording, "displacement"),
    )


def test_of_a_period_that_comes_again_no_start_counts() -> None:
    block = RateDependentPI.example()
    wave = 2.5 + 2.0 * np.sin(2 * np.pi * np.arange(200) / 200)
    recording = recorded(block, np.tile(wave, 3)).slice(200, 400)
    found = run_free(block, recording.with_meta(**{PERIODIC: True}), "displacement")
    expected = block.simulate(np.tile(wave, 2), sample_time=0.01)[200:]
    np.testing.assert_array_equal(found, expected)
    assert not np.array_equal(found, block.simulate(wave, sample_time=0.01))


def test_the_blocks_own_rule_starts_what_has_come_just_now() -> None:
    """After long rest at the first input creep would be over, which the first output denies."""
    creeping = Series((PI.example(), replace(Creep.example(), initial="virgin")))
    recording = Recording(
        {"pressure": U, "displacement": creeping.simulate(U, sample_time=0.01)}, 0.01
    )
    found = run_free(creeping, recording, "displacement")
    np.testing.assert_allclose(found, recording["displacement"], rtol=0, atol=1e-12)
