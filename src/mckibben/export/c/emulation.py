"""Exported C on an emulated microcontroller: an Arm Cortex-M4F, in single precision, under QEMU.

What is counted are instructions, exactly and repeatably, not cycles: QEMU knows no pipeline.
"""

from __future__ import annotations

import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.errors import ModelError
from mckibben.export.c.project import described, render, source_files, test_content
from mckibben.export.c.vectors import Vectors, vectors
from mckibben.export.programs import run
from mckibben.system.atomic import written

BOARD = Path(__file__).parent / "cortex_m4f"
COMPILER, SIZE, EMULATOR = "arm-none-eabi-gcc", "arm-none-eabi-size", "qemu-system-arm"

MACHINE = ("-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard")
FLAGS = (
    *("-std=c99", "-O2", "-Wall", "-Wextra", "-Wconversion", "-Wdouble-promotion", "-Werror"),
    *("-pedantic", "-ffp-contract=off", "-ffunction-sections", "-fdata-sections"),
)

TICKS_PER_INSTRUCTION = 1.6
"""Of the 25 MHz timer, an instruction taking 64 ns of the emulator's time (icount shift 6)."""


@dataclass(frozen=True)
class Emulated:
    """What a model did on the emulated microcontroller.

    Parameters
    ----------
    outputs : array, shape (n, n_outputs)
        On the test inputs.
    expected : Vectors
        What Python made of them.
    instructions : array, shape (n,)
        Of every step; the first one starts the memory too.
    ram : int
        Bytes of one model.
    stack : int
        Bytes used below the caller, at most.
    flash : int
        Bytes of code and constants, without the C library's.
    """

    outputs: Array
    expected: Vectors
    instructions: Array
    ram: int
    stack: int
    flash: int

    @property
    def difference(self) -> float:
        """Largest difference from Python, relative to the range of each output."""
        return float((np.abs(self.outputs - self.expected.outputs) / self.expected.ranges).max())

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
    """Return the programs that emulation needs and this machine has not."""
    return [tool for tool in (COMPILER, SIZE, EMULATOR) if shutil.which(tool) is None]


def refuse_without_tools() -> None:
    """Refuse to emulate where a program is missing.

    Raises
    ------
    ModelError
        That says which.
    """
    missing = missing_tools()
    if missing:
        raise ModelError(
            f"not on this machine: {', '.join(missing)}. Remedy: install gcc-arm-none-eabi, "
            "libnewlib-arm-none-eabi and qemu-system-arm."
        )


def emulate(block: Block, *, sample_time: float | None = None, seed: int = 0) -> Emulated:
    """Cross-compile a model in single precision and run it on the emulated microcontroller.

    Raises
    ------
    ModelError
        If tools are missing, it does not compile, or the emulated program fails.
    """
    refuse_without_tools()
    content = described(block, name="model", sample_time=sample_time, single=True)
    tests = vectors(block, content["sample_time"], single=True, seed=seed)
    content |= test_content(tests, single=True)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        texts = source_files(content) | {"main.c": render("emulated.c.j2", content)}
        with written(folder):
            for path, text in texts.items():
                (folder / path).parent.mkdir(exist_ok=True)
                (folder / path).write_text(text, encoding="utf-8")
        flash = built(folder)
        told = _run(
            EMULATOR,
            *("-M", "mps2-an386", "-cpu", "cortex-m4", "-icount", "shift=6"),
            *("-semihosting-config", "enable=on,target=native"),
            *("-display", "none", "-monitor", "none", "-serial", "none"),
            *("-kernel", str(folder / "model.elf")),
        )
    first, *lines = told.splitlines()
    empty, stack, ram = map(int, first.split())
    words = [line.split() for line in lines]
    ticks = np.array([int(line[0]) for line in words])
    bits = np.array([[int(word, 16) for word in line[1:]] for line in words], dtype=np.uint32)
    return Emulated(
        bits.view(np.float32).astype(np.float64),
        tests,
        np.round((ticks - empty) / TICKS_PER_INSTRUCTION),
        ram,
        stack,
        flash,
    )


def built(folder: Path) -> int:
    """Compile and link, and return the bytes of code and constants."""
    objects = []
    for source in sorted((folder / "src").glob("*.c")):
        objects.append(source.with_suffix(".o"))
        _run(COMPILER, *MACHINE, *FLAGS, "-c", str(source), "-o", str(objects[-1]))
    rest = [str(folder / "main.c"), str(BOARD / "startup.c")]
    link = ["--specs=rdimon.specs", "-Wl,--gc-sections", "-T", str(BOARD / "memory.ld")]
    _run(
        *(COMPILER, *MACHINE, "-O2", "-ffp-contract=off", f"-I{folder / 'src'}"),
        *(*rest, *map(str, objects), *link, "-lm", "-o", str(folder / "model.elf")),
    )
    table = _run(SIZE, *map(str, objects)).splitlines()[1:]
    return sum(int(line.split()[0]) for line in table)


def _run(*command: str) -> str:
    return run(command, f"{command[0]} failed")
