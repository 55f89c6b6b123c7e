"""Every block runs on an emulated microcontroller and gives Python's numbers."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from mckibben import Block, ModelError
from mckibben.export.c import emulation
from mckibben.export.c.emulation import emulate
from tests.export.building import SAMPLE_TIME
from tests.export.models import MODELS
from tests.export.test_c import SINGLE
from tests.tools import needs

pytestmark = pytest.mark.long

SHOWN = ("balance", "band", "feedforward-feedback", "MPI-NARMAX", "pi-adaptive", "virgin preisach")


def emulated(test: Callable[..., None]) -> Callable[..., None]:
    for tool in (emulation.COMPILER, emulation.SIZE, emulation.EMULATOR):
        test = needs(tool)(test)
    return test


@emulated
@pytest.mark.parametrize("name", SHOWN)
def test_a_cortex_m4f_gives_pythons_numbers(name: str) -> None:
    found = emulate(MODELS[name], sample_time=SAMPLE_TIME)
    assert found.difference <= SINGLE
    assert found.instructions.min() > 0
    assert 0 < found.ram < 32 * 1024
    assert 0 < found.stack < 32 * 1024
    assert found.flash > 0


@emulated
def test_a_parameter_changed_is_seen_and_instructions_are_repeatable() -> None:
    block = MODELS["pi"]
    parameters = block.pack()
    parameters[0] *= 1.001
    other, own, again = map(emulate, (block.unpack(parameters), block, block))
    difference = np.abs(other.outputs - own.expected.outputs) / own.expected.ranges
    assert difference.max() > SINGLE
    np.testing.assert_array_equal(again.instructions, own.instructions)


def papers_compositions() -> dict[str, Block]:
    path = Path(__file__).parents[2] / "benchmarks" / "microcontroller.py"
    spec = importlib.util.spec_from_file_location("microcontroller", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return dict(module.compositions())


@emulated
@pytest.mark.parametrize(
    ("name", "budget"),
    [("SDIHC, learned inverse of the network", 40_000), ("GPI inverse, 10 operators", 1_500)],
)
def test_inverses_keep_within_their_budget(name: str, budget: int) -> None:
    found = emulate(papers_compositions()[name], sample_time=SAMPLE_TIME)
    assert found.difference <= SINGLE
    assert found.instructions.max() <= budget
    assert found.ram + found.stack < 32 * 1024


def test_missing_tools_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(emulation, "EMULATOR", "qemu-system-absent")
    with pytest.raises(ModelError, match="qemu-system-absent"):
        emulate(MODELS["pi"])
