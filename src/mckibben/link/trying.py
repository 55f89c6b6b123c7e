"""Devices without a board: a served model as a process of this machine, or on an emulated Cortex-M4F."""

from __future__ import annotations

import socket
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from mckibben.blocks.base import Block
from mckibben.export.c.building import compile_c
from mckibben.export.c.emulation import EMULATOR, built, refuse_without_tools
from mckibben.export.c.project import c_files
from mckibben.export.c.serving import Serving
from mckibben.link.ports import Descriptor


@contextmanager
def hosted(
    block: Block,
    *,
    sample_time: float,
    single: bool = False,
    serving: Serving | None = None,
    options: Sequence[str] = (),
) -> Iterator[Descriptor]:
    """Run a served model as a process of this machine, and give the line to it.

    Parameters
    ----------
    block : Block
        What is served.
    sample_time : float
        Time between its ticks [s].
    single : bool
        In single precision.
    serving : Serving, optional
        What it accepts.
    options : sequence of str
        More for the compiler.

    Raises
    ------
    ModelError
        If it cannot be exported or compiled.
    """
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        _write(folder, block, sample_time, single, serving)
        sources = [*sorted((folder / "src").glob("*.c")), folder / "examples" / "link_posix.c"]
        found = ["-D_POSIX_C_SOURCE=200809L", f"-I{folder / 'src'}", *options]
        compile_c(sources, folder / "device", options=found)
        with _running([str(folder / "device")]) as line:
            yield line


@contextmanager
def emulated(
    block: Block, *, sample_time: float, serving: Serving | None = None
) -> Iterator[Descriptor]:
    """Run a served model in single precision on an emulated Cortex-M4F, and give its serial line.

    Its time is the machine's own, as far as that keeps up. See `hosted`.
    """
    refuse_without_tools()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        _write(folder, block, sample_time, True, serving)
        (folder / "main.c").write_bytes((folder / "examples" / "link_mps2.c").read_bytes())
        built(folder)
        command = [
            *(EMULATOR, "-M", "mps2-an386", "-cpu", "cortex-m4"),
            *("-semihosting-config", "enable=on,target=native"),
            *("-display", "none", "-monitor", "none"),
            *("-chardev", "stdio,id=wire,mux=on", "-serial", "chardev:wire", "-echr", "256"),
            *("-kernel", str(folder / "model.elf")),
        ]
        with _running(command) as line:
            yield line


def _write(
    folder: Path, block: Block, sample_time: float, single: bool, serving: Serving | None
) -> None:
    files = c_files(block, sample_time=sample_time, single=single, serving=serving or Serving())
    for path, text in files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text, encoding="utf-8")


@contextmanager
def _running(command: Sequence[str]) -> Iterator[Descriptor]:
    """Run a program whose standard input and output are the other end of the line that is given."""
    ours, theirs = socket.socketpair()
    with ours, theirs:
        process = subprocess.Popen(
            command,
            stdin=theirs.fileno(),
            stdout=theirs.fileno(),
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C is the host's
        )
        theirs.close()
        line = Descriptor(ours.detach(), "the device's line")
        try:
            yield line
        finally:
            process.kill()
            process.wait()
            line.close()
