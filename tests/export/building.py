"""Exports of many blocks, compiled together: one library for each precision.

models = build({"pi": PI.example(), "its inverse": PI.example().inverse()}, "double", tmp_path)
outputs = models["pi"](inputs)
"""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mckibben import Block
from mckibben.blocks.base import Stream
from mckibben.exporting import export_c

Array = NDArray[np.float64]
Precision = Literal["double", "float32"]

SAMPLE_TIME = 0.01

FLAGS = (
    *("-std=c99", "-O2", "-Wall", "-Wextra", "-Wconversion", "-Wdouble-promotion"),
    *("-Wshadow", "-pedantic", "-Werror", "-ffp-contract=off"),
)

LOOP = """
unsigned long {name}_size(void);
void {name}_loop({name}_model *self, const mck_real *in, mck_real *out, int *statuses, long n);

unsigned long {name}_size(void)
{{
    return (unsigned long)sizeof({name}_model);
}}

void {name}_loop({name}_model *self, const mck_real *in, mck_real *out, int *statuses, long n)
{{
    for (long k = 0; k < n; k++) {{
        statuses[k] = {name}_step(self, in + k * {n_in}, out + k * {n_out});
    }}
}}
"""


class Compiled:
    """An exported model in a compiled library."""

    def __init__(self, library: ctypes.CDLL, name: str, block: Block, precision: Precision) -> None:
        self._init, self._reset, self._loop, size = (
            getattr(library, f"{name}_{function}") for function in ("init", "reset", "loop", "size")
        )
        size.restype = ctypes.c_ulong
        self._loop.argtypes = [*[ctypes.c_void_p] * 4, ctypes.c_long]
        self._type = np.float64 if precision == "double" else np.float32
        self._n_outputs = len(block.outputs)
        self._model = ctypes.create_string_buffer(size())
        self._init(self._model)

    def __call__(self, inputs: ArrayLike) -> Array:
        """Return outputs from the model's own start, shape (n, n_outputs); no step may fail.

        What is asked for may be out of reach.
        """
        self._init(self._model)
        outputs, statuses = self.run(inputs)
        statuses &= ~Stream.CLIPPED
        assert not statuses.any(), f"step {statuses.argmax()} has status {statuses.max()}"
        return outputs

    def reset(self) -> None:
        """Forget everything."""
        self._reset(self._model)

    def run(self, inputs: ArrayLike) -> tuple[Array, NDArray[np.int64]]:
        """Step over inputs, shape (n, n_inputs), from where it is; return outputs and statuses."""
        given = np.ascontiguousarray(inputs, dtype=self._type)
        outputs = np.zeros((len(given), self._n_outputs), dtype=self._type)
        statuses = np.zeros(len(given), dtype=np.intc)
        addresses = (array.ctypes.data for array in (given, outputs, statuses))
        self._loop(ctypes.addressof(self._model), *addresses, len(given))
        return outputs.astype(np.float64), statuses.astype(np.int64)


def build(blocks: Mapping[str, Block], precision: Precision, folder: Path) -> dict[str, Compiled]:
    """Export blocks into a folder, compile all of them in one call, and return them by name.

    Each takes inputs of shape (n, n_inputs) and returns outputs of shape (n, n_outputs), both in
    double precision, every time from the model's own start. The sample time is `SAMPLE_TIME`.
    """
    single, project = precision == "float32", folder / "project"
    project.mkdir(parents=True)
    # without names of their own for each model's shared functions
    (project / "mck_config.h").write_text("#define MCK_FLOAT32\n" if single else "")
    loops = []
    for place, block in enumerate(blocks.values()):
        name = f"model_{place}"
        exported = export_c(block, folder / name, name=name, sample_time=SAMPLE_TIME, single=single)
        for source in sorted((exported / "src").iterdir()):
            if source.name != "mck_config.h":
                (project / source.name).write_bytes(source.read_bytes())
        sizes = {"n_in": len(block.inputs), "n_out": len(block.outputs)}
        loops.append(f'#include "{name}.h"\n' + LOOP.format(name=name, **sizes))
    (project / "loops.c").write_text("".join(loops))
    sources = sorted(map(str, project.glob("*.c")))
    library = folder / "models.so"
    command = ["cc", *FLAGS, "-shared", "-fPIC", *sources, "-lm", "-o", str(library)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    loaded = ctypes.CDLL(str(library))
    return {
        name: Compiled(loaded, f"model_{place}", block, precision)
        for place, (name, block) in enumerate(blocks.items())
    }
