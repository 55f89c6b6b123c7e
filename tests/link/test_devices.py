"""Served exports as processes, over pseudo-terminals, and on the emulated microcontroller."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mckibben.blocks.laws import examples
from mckibben.errors import DataError, ModelError
from mckibben.export import Serving, export_c, state_of
from mckibben.export.c import emulation
from mckibben.export.programs import compile_c
from mckibben.files import read
from mckibben.link import Descriptor, Link, open_port
from mckibben.link.trying import emulated, hosted
from tests.export.building import build
from tests.export.models import path_for
from tests.golden.commands import call
from tests.tools import needs

SAMPLE_TIME = 0.02
EMULATED = [needs(tool) for tool in (emulation.COMPILER, emulation.SIZE, emulation.EMULATOR)]
SERVING = Serving(limits={"pressure": (0, 6), "displacement": (-50, 50)}, watchdog=60.0)


@contextmanager
def terminals() -> Iterator[tuple[int, str]]:
    """Give one end of a pseudo-terminal, and the name of the other."""
    import tty

    ours, theirs = os.openpty()
    tty.setraw(theirs)
    try:
        yield ours, os.ttyname(theirs)
    finally:
        os.close(theirs)


@pytest.mark.long
@needs("cc")
@pytest.mark.parametrize("start", [hosted, pytest.param(emulated, marks=EMULATED)])
def test_a_device_gives_the_numbers_of_the_export(start: Any, tmp_path: Path) -> None:
    block = examples()["pi"]
    inputs = path_for(block, 1, 200).astype(np.float32).astype(np.float64)
    precision = {"single": True} if start is hosted else {}
    expected = build({"pi": block}, "float32", tmp_path)["pi"](inputs)
    with (
        start(block, sample_time=SAMPLE_TIME, serving=SERVING, **precision) as line,
        Link(line, lock_step=True, timeout=1.0, patience=30.0) as link,
    ):
        np.testing.assert_array_equal([link.step(row).outputs for row in inputs], expected)
        stream = block.stream()
        for row in inputs:
            stream.step(row)
        state = state_of(block, link.memory(), SAMPLE_TIME)
        np.testing.assert_allclose(state, stream.state, rtol=1e-6)
    with pytest.raises(DataError):  # as it has been switched off
        link.step([1.0])


def test_a_port_is_opened_by_name_and_closed() -> None:
    for wrong in (__file__, "/dev/null", "/absent"):
        with pytest.raises(DataError, match=wrong):
            open_port(wrong)
    with terminals() as (ours, name):
        port, other = open_port(name), Descriptor(ours)
        port.write(b"\0\x01\n\r\xff")
        assert other.read(1.0) == b"\0\x01\n\r\xff"
        other.write(b"\x03\x04\x11")
        assert port.read(1.0) == b"\x03\x04\x11"
        assert port.read(0.0) == b""
        other.close()
        with pytest.raises(DataError):
            port.read(1.0)
        port.close()
        port.close()
        with pytest.raises(DataError):
            port.write(b"x")


@pytest.mark.long
@needs("cc")
def test_the_command_line_looks_leads_and_records(tmp_path: Path) -> None:
    folder, program = tmp_path / "c", tmp_path / "device"
    export_c(examples()["pi"], folder, sample_time=0.01, serving=SERVING)
    sources = [*(folder / "src").glob("*.c"), folder / "examples" / "link_posix.c"]
    options = ["-D_POSIX_C_SOURCE=200809L", f"-I{folder / 'src'}"]
    compile_c(sorted(sources), program, options=options)
    with terminals() as (ours, name):
        process = subprocess.Popen([str(program)], stdin=ours, stdout=ours)
        try:
            looked = call("link", name)
            assert looked.code == 0, looked.err
            out = tmp_path / "out.csv"
            led = call("link", name, "--set", "pressure=2", "--seconds", "0.5", "-o", str(out))
            assert led.code == 0, led.err
            (recording,) = read(out)
            assert recording.sample_time == pytest.approx(0.01)
            assert set(recording["pressure"]) == {2.0}
            (expected,) = examples()["pi"].simulate([2.0])
            assert recording["displacement"][-1] == pytest.approx(expected, rel=1e-12)
            for wrong in ("pressure=7", "force=1", "pressure"):
                assert call("link", name, "--set", wrong).code == 2
        finally:
            process.kill()
            process.wait()


REFUSED = {
    "pressure, displacement": Serving(),
    "displacement is 90": Serving(SERVING.limits, {"displacement": 90.0}),
    "'speed'": Serving({"speed": (0.0, 1.0)}),
    "watchdog: it is 0.001": Serving(SERVING.limits, watchdog=0.001),
    "pressure are 3 and 1": Serving({**SERVING.limits, "pressure": (3.0, 1.0)}),
}


@pytest.mark.parametrize("named", REFUSED)
def test_what_cannot_be_served_is_refused(named: str, tmp_path: Path) -> None:
    serving, block = REFUSED[named], examples()["play"]
    with pytest.raises(ModelError, match=named):
        export_c(block, tmp_path / "c", sample_time=SAMPLE_TIME, serving=serving)
