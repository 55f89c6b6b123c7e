"""The kernel language and its translation to C, on small programs and against numba."""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Callable
from inspect import getsourcelines
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from mckibben.errors import KernelError
from mckibben.exporting.c.project import SHARED
from mckibben.exporting.c.translator import Translation
from tests.export import programs
from tests.export.building import FLAGS
from tests.tools import needs

Run = Callable[[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]], None]

SIZES = {"coefficients": 7, "state": 6, "inputs": 1, "outputs": 2}


def built(source: str, folder: Path) -> Path:
    """Return a library of a C program."""
    (folder / "program.c").write_text(source)
    library = folder / f"program{len(list(folder.iterdir()))}.so"
    command = ["cc", *FLAGS, "-shared", "-fPIC", f"-I{SHARED.parent}", f"-I{folder}"]
    command += [str(folder / "program.c"), "-lm", "-o", str(library)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr + source
    return library


def compiled(kernel: Any, folder: Path, *, single: bool = False, change: str = "") -> Run:
    """Return a step, translated and compiled, that runs over many samples."""
    translation = Translation(single=single)
    function = translation.add(kernel)
    text = translation.text()
    if change:
        old, new = change.split(" -> ")
        assert old in text
        text = text.replace(old, new)
    call = function.call(*SIZES.items())
    source = f"""#include "mck.h"
{text}
void run(const mck_real *coefficients, mck_real *state, const mck_real *in, mck_real *out, int n);
void run(const mck_real *coefficients, mck_real *state, const mck_real *in, mck_real *out, int n)
{{
    for (int t = 0; t < n; t++) {{
        const mck_real *inputs = in + t;
        mck_real *outputs = out + 2 * t;
        (void)state, (void)coefficients, (void)inputs;
        {call};
    }}
}}
"""
    (folder / "mck_config.h").write_text("#define MCK_FLOAT32\n" if single else "")
    library = built(source, folder)
    loaded = ctypes.CDLL(str(library))
    loaded.run.argtypes = [*[ctypes.c_void_p] * 4, ctypes.c_int]

    def run(*arrays: NDArray[Any]) -> None:
        loaded.run(*(array.ctypes.data for array in arrays), len(arrays[-1]))

    return run


def trial(kind: type = np.float64) -> tuple[NDArray[Any], ...]:
    """Return coefficients, state, inputs and room for outputs."""
    rng = np.random.default_rng(0)
    inputs = np.concatenate(
        [rng.normal(size=200), [0.0, -0.0, 1.0, 5.0], 1e3 * rng.normal(size=50)]
    )
    coefficients = np.array([5.0, *rng.normal(size=SIZES["coefficients"] - 1)])
    arrays = (coefficients, rng.normal(size=SIZES["state"]), inputs[:, np.newaxis])
    return (*(array.astype(kind) for array in arrays), np.zeros((inputs.size, 2), dtype=kind))


@needs("cc")
@pytest.mark.parametrize("program", programs.PROGRAMS, ids=lambda each: each.__name__)
def test_c_is_python_to_the_bit(program: Any, tmp_path: Path) -> None:
    c, python = trial(), trial()
    compiled(program, tmp_path)(*c)
    program.batch(*python)
    tolerance = 1e-13 if program is programs.sums else 0.0  # whose terms numba may reorder
    np.testing.assert_allclose(c[3], python[3], rtol=tolerance, atol=0.0)
    np.testing.assert_array_equal(c[1], python[1])


@needs("cc")
def test_the_comparison_fails_for_another_number(tmp_path: Path) -> None:
    c, python = trial(), trial()
    compiled(programs.arithmetic, tmp_path, change="/ 3.0 -> / 3.0000000001")(*c)
    programs.arithmetic.batch(*python)
    assert np.sum(c[3][:, 0] != python[3][:, 0]) > 20


@needs("cc")
@pytest.mark.parametrize("program", programs.PROGRAMS, ids=lambda each: each.__name__)
def test_single_precision_differs_by_rounding(program: Any, tmp_path: Path) -> None:
    c, python = trial(np.float32), trial()
    compiled(program, tmp_path, single=True)(*c)
    program.batch(*python)
    near = np.isclose(c[3], python[3], rtol=1e-4, atol=1e-4 * np.abs(python[3]).max(axis=0))
    assert near.mean() > 0.99, "all but those that rounding decides"


def test_names_docstrings_and_comments_are_those_of_python() -> None:
    translation = Translation()
    translation.add(programs.loops)
    translation.add(programs.results)
    text = translation.text()
    assert "/* the largest power of two below the input, by hand */" in text
    assert "/* at most sixty times */" in text
    assert "/* Return the larger, and whether it is the first. */" in text
    assert "static mck_real both(mck_real x, mck_real y, int *" in text


def test_constants_are_named_and_fit_the_precision() -> None:
    for single, value in ((False, "1e-12"), (True, "1e-06f")):
        translation = Translation(single=single)
        translation.add(programs.solved)
        assert f"#define CLOSED {value}" in translation.text()


def refused(kernel: Any, line: int) -> bool:
    """Return whether a kernel is refused at a line behind its ``def``, with what to write instead."""
    with pytest.raises(KernelError) as error:
        Translation().add(kernel)
    lines, first = getsourcelines(kernel.py_func)
    start = next(k for k, text in enumerate(lines) if text.startswith("def "))
    found = error.value
    assert (str(found.file), found.row) == (programs.__file__, first + start + line)
    return bool(found.construct and found.instead) and "docs/" not in found.instead


@pytest.mark.parametrize("kernel", programs.REFUSED, ids=lambda each: each.__name__)
def test_what_is_outside_the_language_is_refused_where_it_stands(kernel: Any) -> None:
    assert refused(kernel, programs.REFUSED[kernel])


@needs("cc")
@pytest.mark.parametrize("kernel", programs.EDGES, ids=lambda each: each.__name__)
@pytest.mark.parametrize("values", [(0.4, 2.0, 3000.0), (1.7, 1.0, -1.0)], ids=["small", "large"])
def test_c_has_pythons_numbers_or_the_kernel_is_refused(
    kernel: Any, values: tuple[float, ...], tmp_path: Path
) -> None:
    line = programs.EDGES[kernel]
    if line is not None:
        assert refused(kernel, line)
        return
    translation = Translation()
    call = translation.add(kernel).call(("a", len(values)))
    run = "double run(double *a);\ndouble run(double *a)\n{\n"
    (tmp_path / "mck_config.h").write_text("")
    source = f'#include "mck.h"\n{translation.text()}\n{run}    return {call};\n}}\n'
    library = ctypes.CDLL(str(built(source, tmp_path)))
    library.run.restype, library.run.argtypes = ctypes.c_double, [ctypes.c_void_p]
    c, python = np.array(values), np.array(values)
    assert library.run(c.ctypes.data) == kernel.py_func(python)
    np.testing.assert_array_equal(c, python)
