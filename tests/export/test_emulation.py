"""Every block runs on an emulated microcontroller and gives Python's numbers."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from mckibben.exporting.c import emulation
from mckibben.exporting.c.emulation import emulate
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
