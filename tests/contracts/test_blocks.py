"""Every registered block obeys the contract, every published model does, and unusual blocks do."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mckibben import (
    EUPI,
    GPI,
    PI,
    Affine,
    Block,
    Play,
    Polynomial,
    RateDependentPI,
    Series,
    check_block,
)
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.dynamics.air import Air
from mckibben.blocks.dynamics.state_network import StateNetwork
from mckibben.blocks.fields import LONGEST_DELAY, vector
from mckibben.blocks.hysteresis.envelopes import Exponential, Tanh
from mckibben.blocks.hysteresis.oscillators import BoucWenOscillator
from mckibben.blocks.laws import examples
from tests.golden.models import network

EXAMPLES = examples()

AIR = Air.example()


TIMELESS = replace(
    Balance.example(), relaxation=((), ()), lags=(), damping=(0.0, 0.0), lines=(), tare=True
)
"""A balance that does not depend on rate."""


def gpi(rising: Any, falling: Any) -> GPI:
    return GPI((0.0, 0.2), (3.0, 1.0), rising, falling, (0.0, 5.0))


UNUSUAL: list[Block] = [
    PI((0.0, 0.5, 1.0), (3.0, -1.0, -1.0), -2.0, (1.0, 4.0)),
    PI((0.2, 0.5), (1.0, 1.0)),
    PI((0.0, 0.5), (1.0, 1.0)),
    PI((0.0, 0.5), (1.0, 1.0), initial=(0.3, 0.2)),
    PI((0.0, 0.3), (1.0, 1.0), 1e6, (0.0, 5.0)),
    PI(vector(np.linspace(0.0, 2.4, 200)), (1.0,) * 200, 0.0, (0.0, 5.0)),
    gpi(Tanh(10.0, -25.0), Tanh(10.0, -22.0)),
    gpi(Tanh(1e-6, 0.0), Tanh(1e-6, 0.0, 1e-7)),
    gpi(Exponential(5.0, 0.0), Exponential(5.0, 0.0, 0.1)),
    EUPI((0.0, 0.3), (1.0, 1.0), 0.9, 1.5, (0.0, 0.0, 0.0), 0.0, (0.0, 5.0)),
    Series((PI.example(), Affine(-2.0, 3.0))),
    Polynomial((0.0, 1.0, -3.0)),
    Play(0.0),
    RateDependentPI((0.0,), (0.01,), (1.0,), 0.0, 0.5, (-2.0, 2.0)),
    replace(AIR, dead_time=0.0),
    replace(AIR, hysteresis=0.0, filling_time=0.04, venting_time=0.04),
    replace(AIR, filling_time=0.0, venting_time=0.0),
    replace(AIR, ambient=None, supply=None),
    replace(AIR, dead_time=0.01 * LONGEST_DELAY),
    replace(AIR, dead_time=0.01 * LONGEST_DELAY).inverse(),
    replace(BoucWenOscillator.example(), hold="zero"),
    replace(StateNetwork.example(), hold="zero"),
    network(),
    replace(network(), hold="zero", initial="virgin"),
    TIMELESS,
    TIMELESS.inverse(),
]


@pytest.mark.parametrize("title", EXAMPLES)
def test_obeys_the_contract(title: str) -> None:
    for seed in range(1 if title == "predictive" else 3):
        check_block(EXAMPLES[title], sample_time=0.01, seed=seed)


@pytest.mark.parametrize("block", UNUSUAL, ids=lambda block: block.title)
def test_unusual_blocks_obey_it(block: Block) -> None:
    assert not (block is TIMELESS and block.rate_dependent)
    for seed in range(3):
        check_block(block, seed=seed)
