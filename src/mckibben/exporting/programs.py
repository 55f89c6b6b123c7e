"""External programs: finding a C compiler, and running programs."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

from mckibben.errors import ModelError

TIMEOUT = 600.0
"""Of a compiler, a self-test or an emulator [s]."""


FLAGS = (
    *("-std=c99", "-O2", "-Wall", "-Wextra", "-Wconversion", "-Wdouble-promotion", "-Wshadow"),
    *("-Werror", "-pedantic", "-ffp-contract=off"),
)
"""What exported C compiles with, cleanly."""


def own_compiler() -> str | None:
    """Return the C compiler of this machine, $CC, cc, gcc or clang, or None."""
    names = [name for name in (os.environ.get("CC"), "cc", "gcc", "clang") if name]
    return next((path for path in map(shutil.which, names) if path), None)


def run(command: Sequence[str], failed: str, *, folder: Path | None = None) -> str:
    """Run a program in a folder, and return its output.

    Parameters
    ----------
    command : sequence of str
    failed : str
        What to say where it does not succeed, before its first complaint.
    folder : Path, optional
        Where to run it.

    Raises
    ------
    ModelError
        If it does not succeed.
    """
    result = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, timeout=TIMEOUT, check=False
    )
    if result.returncode != 0:
        complaint = result.stderr.strip() or result.stdout.strip()
        raise ModelError(f"{failed}: {complaint[:500]}", remedy="report it, with the model")
    return result.stdout


def compile_c(sources: Sequence[Path], out: Path, *, options: Sequence[str] = ()) -> None:
    """Compile C files into a program or a library.

    Raises
    ------
    ModelError
        If there is no compiler, or it refuses; the text gives its first complaint.
    """
    compiler = own_compiler()
    if compiler is None:
        raise ModelError(
            "there is no C compiler on this machine",
            remedy="install gcc or clang, or leave `check` out and compile the folder elsewhere",
        )
    command = [compiler, *FLAGS, *options, "-o", str(out), *map(str, sources), "-lm"]
    run(command, "the exported C does not compile")


def self_test(folder: Path, name: str) -> str:
    """Compile an exported folder elsewhere, run its self-test, and return the output.

    Raises
    ------
    ModelError
        If it does not compile, or its results are not those of Python.
    """
    with tempfile.TemporaryDirectory() as folder_:
        program = Path(folder_) / "selftest"
        sources = sorted((folder / "src").glob("*.c"))
        test = folder / "test" / f"{name}_selftest.c"
        compile_c([*sources, test], program, options=[f"-I{folder / 'src'}"])
        return run([str(program)], "the outputs of the exported C differ from Python's").strip()
