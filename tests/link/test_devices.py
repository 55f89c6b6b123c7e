"""Served exports as processes, over pseudo-terminals, and on the emulated microcontroller."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mckibben import Block
from mckibben.blocks.adaptive.adaptive import Adaptive
from mckibben.blocks.adaptive.adaptive_series import AdaptiveSeries
from mckibben.blocks.laws.examples import examples
from mckibben.blocks.play_type.gpi import GPI
from mckibben.errors import DataError, ModelError
from mckibben.export import Serving, export_c, state_of
from mckibben.export.c import emulation
from mckibben.export.c.building import compile_c
from mckibben.files import read
from mckibben.link import Descriptor, Link, LinkError, open_port
from mckibben.link.trying import emulated, hosted
from tests.export.building import build
from tests.export.models import path_for
from tests.golden.commands import call
from tests.tools import needs

SAMPLE_TIME = 0.02
EMULATED = [needs(tool) for tool in (emulation.COMPILER, emulation.SIZE, emulation.EMULATOR)]
SERVING = Serving(limits={"pressure": (0, 6), "displacement": (-50, 50)}, watchdog=60.0)


def wide(block: Block, adjustable: float = 0.0) -> Serving:
    """Return settings under which hardly anything is beyond limits."""
    channels = [channel.name for channel in (*block.inputs, *block.outputs)]
    limits = dict.fromkeys(channels, (-99.0, 99.0))
    return Serving(limits, watchdog=60.0, adjustable=adjustable)


@contextmanager
def linked(
    start: Callable[..., AbstractContextManager[Any]], block: Block, **settings: Any
) -> Iterator[Link]:
    serving = settings.pop("serving", wide(block))
    with (
        start(block, sample_time=SAMPLE_TIME, serving=serving, **settings) as line,
        Link(line, lock_step=True, timeout=1.0, patience=30.0) as link,
    ):
        yield link


def device(block: Block, folder: Path, **settings: Any) -> Path:
    """Export and compile a device that is a process of this machine."""
    export_c(block, folder / "c", sample_time=0.01, **settings)
    sources = [*(folder / "c" / "src").glob("*.c"), folder / "c" / "examples" / "link_posix.c"]
    options = ["-D_POSIX_C_SOURCE=200809L", f"-I{folder / 'c' / 'src'}"]
    compile_c(sorted(sources), folder / "device", options=options)
    return folder / "device"


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
    serving = Serving(SERVING.limits, watchdog=60.0, adjustable=0.3)
    precision = {"single": True} if start is hosted else {}
    expected = build({"pi": block}, "float32", tmp_path)["pi"](inputs)
    with linked(start, block, serving=serving, **precision) as link:
        np.testing.assert_array_equal([link.step(row).outputs for row in inputs], expected)
        memory = link.memory()
        again = [link.step(row).outputs for row in inputs[:50]]
        link.load_memory(memory)
        np.testing.assert_array_equal([link.step(row).outputs for row in inputs[:50]], again)
    with pytest.raises(DataError):  # as it has been switched off
        link.step([1.0])


@pytest.mark.long
@needs("cc")
@pytest.mark.parametrize("name", ["pi-adaptive", "adaptive-series"])
def test_what_was_learnt_is_read_and_gone_on_from(name: str) -> None:
    """A missing measurement takes no reference with it, and neither does one beyond limits."""
    block = examples()[name]
    assert isinstance(block, Adaptive | AdaptiveSeries)
    reference = 2.0 + np.sin(0.05 * np.arange(150))
    inputs = np.column_stack([reference, 1.1 * reference])
    inputs[10:20, 1] = np.nan
    stream = block.stream(SAMPLE_TIME)
    expected = [stream.step(row).tolist() for row in inputs[:100]]
    inputs[15:20, 1] = 1e6
    with linked(hosted, block) as link:
        assert link.device.n_missable == 1
        found = [link.step(row).outputs for row in inputs[:100]]
        np.testing.assert_allclose(found, expected, rtol=1e-12)
        with pytest.raises(DataError):
            link.step([np.nan, 1.0])
        memory = link.memory()
        with pytest.raises(LinkError):
            link.load_memory(memory)  # as it is not adjustable
        gone_on = [link.step(row).outputs for row in inputs[100:]]
    state = state_of(block, memory, SAMPLE_TIME)
    np.testing.assert_allclose(state, stream.state, rtol=1e-12, atol=1e-12)
    with linked(hosted, block.resumed(state)) as link:
        np.testing.assert_array_equal([link.step(row).outputs for row in inputs[100:]], gone_on)
    with pytest.raises(DataError):
        state_of(block, memory[:3], SAMPLE_TIME)


@pytest.mark.long
@needs("cc")
@pytest.mark.parametrize("name", ["balance", "gpi-inverse", "feedforward-feedback", "negative"])
def test_served_exports_of_all_kinds_compile(name: str, tmp_path: Path) -> None:
    """Numbers can be adjusted where there are any, and where there are none."""
    block = examples()[name]
    adjustable = 0.2 if name in ("gpi-inverse", "negative") else 0.0
    device(block, tmp_path, serving=wide(block, adjustable=adjustable), single=True)


def test_a_port_is_opened_by_name_and_closed() -> None:
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


def test_what_is_no_port_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    for wrong in (tmp_path / "file", "/dev/null", tmp_path / "absent"):
        with pytest.raises(DataError, match=str(wrong)):
            open_port(wrong)
    with pytest.raises(DataError, match="17"):
        open_port("/dev/null", baud=17)


@pytest.mark.long
@needs("cc")
def test_the_command_line_looks_leads_and_records(tmp_path: Path) -> None:
    program = device(examples()["pi"], tmp_path, serving=SERVING)
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


@pytest.mark.long
@needs(emulation.EMULATOR)
@needs(emulation.COMPILER)
@needs("cc")
def test_the_example_gives_the_same_numbers_at_any_pace_and_on_the_microcontroller(
    tmp_path: Path,
) -> None:
    example = Path(__file__).parents[2] / "examples" / "robot_firmware.py"
    model, learnt, picture = (tmp_path / name for name in ("a.json", "b.json", "c.png"))
    Adaptive(GPI.example(), 60.0, 0.05).save(model)
    files = [str(picture), "--model", str(model), "--save", str(learnt), "--duration", "2"]
    found = []
    for options in ([], ["--here", "--fast"]):
        command = [sys.executable, str(example), *files, *options]
        printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        found.append((printed.partition("\n")[2], learnt.read_text()))
    assert found[0] == found[1]
    assert picture.stat().st_size > 10_000


REFUSED = {
    "pressure, displacement": Serving(),
    "displacement is 90": Serving(SERVING.limits, {"displacement": 90.0}),
    "'speed'": Serving({"speed": (0.0, 1.0)}),
    "nan s": Serving(SERVING.limits, watchdog=float("nan")),
    "0.001 s": Serving(SERVING.limits, watchdog=0.001),
    "1.5": Serving(SERVING.limits, adjustable=1.5),
    "pressure are 3 and 1": Serving({**SERVING.limits, "pressure": (3.0, 1.0)}),
}


@pytest.mark.parametrize("named", REFUSED)
def test_what_cannot_be_served_is_refused(named: str, tmp_path: Path) -> None:
    serving, block = REFUSED[named], examples()["play"]
    with pytest.raises(ModelError, match=named):
        export_c(block, tmp_path / "c", sample_time=SAMPLE_TIME, serving=serving)


@pytest.mark.parametrize("period", [None, 1e-9, 9e-7, 1e4])
def test_periods_that_a_device_cannot_count_are_refused(
    period: float | None, tmp_path: Path
) -> None:
    serving = Serving(SERVING.limits, watchdog=1e6)
    with pytest.raises(ModelError):
        export_c(examples()["play"], tmp_path / "c", sample_time=period, serving=serving)
