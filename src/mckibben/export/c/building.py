"""Compiling exported C on this machine, to check it and to call it."""

from __future__ import annotations

import ctypes
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mckibben.arrays import Array
from mckibben.errors import ModelError
from mckibben.export.programs import own_compiler, run

FLAGS = (
    "-std=c99",
    "-O2",
    "-Wall",
    "-Wextra",
    "-Wconversion",
    "-Wdouble-promotion",
    "-Werror",
    "-pedantic",
    "-ffp-contract=off",
)
"""What exported C compiles with, cleanly."""


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
            "there is no C compiler on this machine. Remedy: install gcc or clang, or leave --check "
            "out and compile the folder elsewhere."
        )
    command = [compiler, *FLAGS, *options, "-o", str(out), *map(str, sources), "-lm"]
    run(command, "the exported C does not compile")


def self_test(folder: Path, name: str) -> str:
    """Compile an exported folder elsewhere, run its self-test, and return what it says.

    Raises
    ------
    ModelError
        If it does not compile, or its results are not those of Python.
    """
    with tempfile.TemporaryDirectory() as place:
        program = Path(place) / "selftest"
        sources = sorted((folder / "src").glob("*.c"))
        test = folder / "test" / f"{name}_selftest.c"
        compile_c([*sources, test], program, options=[f"-I{folder / 'src'}"])
        return run([str(program)], "the exported C does not give Python's numbers").strip()


LOOP = """
#include "{name}.h"

void {name}_loop({name}_model *self, const mck_real *in, mck_real *out, int *statuses, long n);

void {name}_loop({name}_model *self, const mck_real *in, mck_real *out, int *statuses, long n)
{{
    for (long k = 0; k < n; k++) {{
        statuses[k] = {name}_step(self, in + k * {n_in}, out + k * {n_out});
    }}
}}
"""


class CompiledModel:
    """Exported C, compiled and called from Python.

    Parameters
    ----------
    folder : Path
        Written by `export_c`.
    name : str
        Given there.
    n_inputs, n_outputs : int
        Of the model.
    options : sequence of str
        More for the compiler.
    """

    SIZE = 1 << 20
    """Bytes set aside for a model's struct."""

    def __init__(
        self,
        folder: Path,
        name: str,
        n_inputs: int,
        n_outputs: int,
        *,
        options: Sequence[str] = (),
    ) -> None:
        sources = sorted((folder / "src").glob("*.c"))
        single = "MCK_FLOAT32" in (folder / "src" / "mck_config.h").read_text()
        self._type = np.float32 if single else np.float64
        self._n_inputs, self._n_outputs = n_inputs, n_outputs
        with tempfile.TemporaryDirectory() as place:
            library, loop = Path(place) / f"{name}.so", Path(place) / "loop.c"
            loop.write_text(LOOP.format(name=name, n_in=n_inputs, n_out=n_outputs))
            found = [f"-I{folder / 'src'}", "-shared", "-fPIC", *options]
            compile_c([*sources, loop], library, options=found)
            self._library = ctypes.CDLL(str(library))
        self._model = ctypes.create_string_buffer(self.SIZE)
        self._init = getattr(self._library, f"{name}_init")
        self._reset = getattr(self._library, f"{name}_reset")
        self._loop = getattr(self._library, f"{name}_loop")
        self._loop.argtypes = [*[ctypes.c_void_p] * 4, ctypes.c_long]
        self._init(self._model)

    def reset(self) -> None:
        """Forget everything."""
        self._reset(self._model)

    def run(self, inputs: ArrayLike) -> tuple[Array, NDArray[np.int64]]:
        """Step over inputs, shape (n, n_inputs), from where it is.

        Returns
        -------
        outputs : array, shape (n, n_outputs)
        statuses : array of int, shape (n,)
        """
        given = np.ascontiguousarray(inputs, dtype=self._type)
        outputs = np.zeros((len(given), self._n_outputs), dtype=self._type)
        statuses = np.zeros(len(given), dtype=np.intc)
        addresses = (array.ctypes.data for array in (given, outputs, statuses))
        self._loop(ctypes.addressof(self._model), *addresses, len(given))
        return outputs.astype(np.float64), statuses.astype(np.int64)
