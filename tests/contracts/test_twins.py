"""Every compiled block but inverses agrees with its naive twin, and every envelope with its formula."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import pytest

from mckibben.blocks.laws import Trial, examples
from mckibben.registry import load, names
from tests.twins import ENVELOPES, STEP_ERROR, STEPPED, TWINS

pytestmark = pytest.mark.kernel

SAMPLE_TIME = 0.01
UNCOMPILED = bool(os.environ.get("NUMBA_DISABLE_JIT"))
TURNS, SEEDS = (4, 1) if UNCOMPILED else (24, 2)
"""Turning points of the inputs, and how many; fewer where kernels take their time."""


EXAMPLES = examples()
WITHOUT_TWIN = {
    "feedforward-feedback",
    "pi-adaptive",
    "force-compensator",
    "force-feedforward",
    "predictive",
}
"""A learner and what looks ahead, whose laws are their own, and what is made of kernels with twins;
golden cases pin their numbers."""

COMPILED = [
    title
    for title, block in EXAMPLES.items()
    if any(hasattr(part, "kernel") for part in (block, getattr(block, "forward", block)))
    and title not in WITHOUT_TWIN
    and (title == "balance-inverse" or not title.endswith("-inverse"))
]


def test_whatever_is_compiled_has_a_twin() -> None:
    assert set(TWINS) == set(COMPILED)
    assert set(ENVELOPES) == set(names("envelopes"))


@pytest.mark.parametrize("seed", range(SEEDS))
@pytest.mark.parametrize("kind", COMPILED)
def test_kernel_agrees_with_its_twin(kind: str, seed: int) -> None:
    block = EXAMPLES[kind]
    trial = Trial.of(block, SAMPLE_TIME, seed, TURNS)
    inputs = trial.inputs[: STEPPED.get(kind, 1000)]
    expected = np.array(TWINS[kind](block, inputs.tolist(), SAMPLE_TIME))
    error = np.abs(trial.outputs[: len(inputs)] - expected)
    tolerance = STEP_ERROR if kind in STEPPED else 1e-12
    assert error.max() <= tolerance * np.ptp(expected)


@pytest.mark.parametrize("kind", names("envelopes"))
def test_envelope_agrees_with_its_formula_and_its_own_inverse(kind: str) -> None:
    u = np.linspace(-1.0, 6.0, 1001)
    for envelope in load("envelopes", kind).examples():
        expected: list[Any] = [ENVELOPES[kind](envelope, x) for x in u.tolist()]
        np.testing.assert_allclose(envelope(u), expected, rtol=1e-13, atol=1e-14)
        np.testing.assert_allclose(envelope.solve(envelope(u)), u, rtol=1e-11, atol=1e-11)
        assert np.all(np.diff(envelope(u)) > 0)
