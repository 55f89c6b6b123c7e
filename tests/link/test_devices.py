"""Served exports as processes, over pseudo-terminals, and on the emulated microcontroller."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mckibben.blocks.laws import examples
from mckibben.errors import DataError, ModelError
from mckibben.exporting import Serving, export_c, state_of
from mckibben.exporting.c import emulation
from mckibben.exporting.c.emulation import serial_device
from mckibben.link import Link, LinkError
from tests.export.building import build
from tests.export.models import path_for
from tests.golden.commands import call
from tests.refusals import refused
from tests.tools import needs

SAMPLE_TIME = 0.02
EMULATED = [needs(tool) for tool in (emulation.COMPILER, emulation.SIZE, emulation.EMULATOR)]
SERVING = Serving(limits={"pressure": (0, 6), "displacement": (-50, 50)}, watchdog=60.0)


@pytest.mark.long
@needs("cc")
@pytest.mark.parametrize("emulated", [False, pytest.param(True, marks=EMULATED)])
def test_a_device_gives_the_numbers_of_the_export(emulated: bool, tmp_path: Path) -> None:
    block = examples()["pi"]
    inputs = path_for(block, 1, 200).astype(np.float32).astype(np.float64)
    expected = build({"pi": block}, "float32", tmp_path)["pi"](inputs)
    device = serial_device(block, sample_time=SAMPLE_TIME, serving=SERVING, emulated=emulated)
    with device as port, Link(port, lock_step=True, timeout=1.0, patience=30.0) as link:
        np.testing.assert_array_equal([link.step(row).outputs for row in inputs], expected)
        stream = block.stream()
        for row in inputs:
            stream.step(row)
        state = state_of(block, link.memory(), SAMPLE_TIME)
        np.testing.assert_allclose(state, stream.state, rtol=1e-6)


def test_a_port_that_cannot_be_opened_or_is_gone_is_an_error() -> None:
    for wrong in (__file__, "/dev/null", "/absent"):
        with refused(DataError, file=wrong):
            Link(wrong)
    ours, theirs = os.openpty()
    name = os.ttyname(theirs)
    with refused(LinkError, parameter="patience"):
        Link(name, patience=0.1)
    os.close(ours)
    with pytest.raises(DataError):
        Link(name, patience=0.1)
    os.close(theirs)


@needs("cc")
def test_the_command_line_shows_a_device(tmp_path: Path) -> None:
    block = examples()["pi"]
    device = serial_device(block, sample_time=0.01, serving=SERVING, single=False)
    with device as port:
        looked = call("link", port)
        assert looked.code == 0, looked.err
        assert "displacement" in looked.out


REFUSED: list[tuple[dict[str, Any], Serving]] = [
    ({"parameter": "limits", "names": ("pressure", "displacement")}, Serving()),
    ({"channel": "displacement", "names": 90}, Serving(SERVING.limits, {"displacement": 90.0})),
    ({"channel": "speed"}, Serving({"speed": (0.0, 1.0)})),
    ({"parameter": "watchdog", "names": 0.001}, Serving(SERVING.limits, watchdog=0.001)),
    (
        {"channel": "pressure", "names": (3, 1)},
        Serving({**SERVING.limits, "pressure": (3.0, 1.0)}),
    ),
]


@pytest.mark.parametrize(("fields", "serving"), REFUSED)
def test_what_cannot_be_served_is_refused(
    fields: dict[str, Any], serving: Serving, tmp_path: Path
) -> None:
    block = examples()["play"]
    with refused(ModelError, **fields):
        export_c(block, tmp_path / "c", sample_time=SAMPLE_TIME, serving=serving)
