"""Exported C on an emulated microcontroller: an Arm Cortex-M4F, in single precision, under QEMU.

What is counted are instructions, exactly and repeatably, not cycles: QEMU knows no pipeline.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.errors import ModelError
from mckibben.exporting.c.project import c_files, described, render, source_files, vectors
from mckibben.exporting.c.serving import Serving
from mckibben.exporting.folders import write_texts
from mckibben.exporting.programs import FLAGS, compile_c, run

BOARD = Path(__file__).parent / "cortex_m4f"
COMPILER, SIZE, EMULATOR = "arm-none-eabi-gcc", "arm-none-eabi-size", "qemu-system-arm"

MACHINE = ("-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard")
EMULATED = (
    *("-M", "mps2-an386", "-cpu", "cortex-m4", "-display", "none", "-monitor", "none"),
    *("-semihosting-config", "enable=on,target=native"),
)
"""Emulated board."""

TICKS_PER_INSTRUCTION = 1.6
"""Of the 25 MHz timer, an instruction taking 64 ns of the emulator's time (icount shift 6)."""


@dataclass(frozen=True)
class Emulation:
    """Result of a model on the emulated microcontroller.

    Parameters
    ----------
    difference : float
        Largest from Python on the test inputs, relative to the range of each output.
    instructions : array, shape (n_samples,)
        Of every step; the first one starts the memory too.
    ram : int
        Bytes of one model.
    stack : int
        Bytes used below the caller, at most.
    flash : int
        Bytes of code and constants, without the C library's.
    """

    difference: float
    instructions: Array
    ram: int
    stack: int
    flash: int

    def __str__(self) -> str:
        """Return one sentence."""
        steps = self.instructions[1:]
        return (
            f"on an emulated Cortex-M4F: largest difference {self.difference:.2g} of the range, "
            f"{np.median(steps):.0f} instructions a step, at most {steps.max():.0f}, the first "
            f"{self.instructions[0]:.0f}; {self.ram} bytes of RAM, {self.stack} of stack, "
            f"{self.flash} of flash"
        )


def missing_tools() -> list[str]:
    """Return the programs for emulation that are not installed."""
    return [tool for tool in (COMPILER, SIZE, EMULATOR) if shutil.which(tool) is None]


def emulate(block: Block, *, sample_time: float | None = None) -> Emulation:
    """Cross-compile a model in single precision and run it on the emulated microcontroller.

    Raises
    ------
    ModelError
        If tools are missing, it does not compile, or the emulated program fails.
    """
    content = described(block, name="model", sample_time=sample_time, single=True)
    content |= vectors(block, content["sample_time"], single=True)
    texts = source_files(content) | {"main.c": render("emulated.c.j2", content)}
    with tempfile.TemporaryDirectory() as folder:
        write_texts(Path(folder), texts)
        program, flash = built(Path(folder))
        output = _run(
            *(EMULATOR, *EMULATED, "-icount", "shift=6"),
            *("-serial", "none", "-kernel", str(program)),
        )
    (empty, stack, ram), *lines = (line.split() for line in output.splitlines())
    ticks = np.array([int(line[0]) for line in lines])
    bits = np.array([[int(word, 16) for word in line[1:]] for line in lines], dtype=np.uint32)
    off = np.abs(bits.view(np.float32).astype(np.float64) - content["expected"])
    instructions = np.round((ticks - int(empty)) / TICKS_PER_INSTRUCTION)
    difference = float((off / content["spans"]).max())
    return Emulation(difference, instructions, int(ram), int(stack), flash)


def built(folder: Path) -> tuple[Path, int]:
    """Compile and link, and return the program, and the bytes of code and constants.

    Raises
    ------
    ModelError
        If tools are missing, or it does not compile.
    """
    if missing := missing_tools():
        raise ModelError(
            f"not on this machine: {', '.join(missing)}",
            remedy="install gcc-arm-none-eabi, libnewlib-arm-none-eabi and qemu-system-arm",
        )
    objects, program = [], folder / "model.elf"
    for source in sorted((folder / "src").glob("*.c")):
        objects.append(source.with_suffix(".o"))
        sections = ("-ffunction-sections", "-fdata-sections")
        _run(COMPILER, *MACHINE, *FLAGS, *sections, "-c", str(source), "-o", str(objects[-1]))
    sources = [str(folder / "main.c"), str(BOARD / "startup.c")]
    link = ["--specs=rdimon.specs", "-Wl,--gc-sections", "-T", str(BOARD / "memory.ld")]
    _run(
        *(COMPILER, *MACHINE, "-O2", "-ffp-contract=off", f"-I{folder / 'src'}"),
        *(*sources, *map(str, objects), *link, "-lm", "-o", str(program)),
    )
    table = _run(SIZE, *map(str, objects)).splitlines()[1:]
    return program, sum(int(line.split()[0]) for line in table)


@contextmanager
def serial_device(
    block: Block,
    *,
    sample_time: float,
    serving: Serving | None = None,
    single: bool = True,
    emulated: bool = False,
) -> Iterator[str]:
    """Run a served model without a board, and yield the name of its serial port.

    Parameters
    ----------
    block : Block
        What is served.
    sample_time : float
        Time between its ticks [s].
    serving : Serving, optional
        What it accepts.
    single : bool
        Whether it computes in single precision, as the emulated microcontroller does.
    emulated : bool
        Whether it runs on the emulated microcontroller, else as a process of this machine.

    Raises
    ------
    ModelError
        If it cannot be exported or compiled.
    """
    import tty

    serving, single = serving or Serving(), single or emulated
    device_end, host_end = os.openpty()  # the process is at our end, the host at the other
    tty.setraw(host_end)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        files = c_files(block, sample_time=sample_time, single=single, serving=serving)
        write_texts(folder, files)
        if emulated:
            (folder / "main.c").write_bytes((folder / "examples" / "link_mps2.c").read_bytes())
            command = [EMULATOR, *EMULATED, "-serial", "pty", "-kernel", str(built(folder)[0])]
        else:
            command = [str(folder / "device")]
            sources = [*sorted((folder / "src").glob("*.c")), folder / "examples" / "link_posix.c"]
            options = ["-D_POSIX_C_SOURCE=200809L", f"-I{folder / 'src'}"]
            compile_c(sources, Path(command[0]), options=options)
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL if emulated else device_end,
            stdout=subprocess.PIPE if emulated else device_end,
            stderr=subprocess.STDOUT if emulated else subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C is the host's
        )
        try:
            match = re.search(rb"/dev/\S+", process.stdout.readline()) if process.stdout else None
            yield match[0].decode() if match else os.ttyname(host_end)
        finally:
            process.kill()
            process.communicate()
            os.close(device_end)
            os.close(host_end)


def _run(*command: str) -> str:
    return run(command, f"{command[0]} failed")
