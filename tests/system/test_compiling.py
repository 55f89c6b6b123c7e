"""Importing loads little; a kernel is compiled when it is first run, once, and found again."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path

import cloudpickle
import numpy as np
import pytest

from mckibben.errors import CacheWarning
from mckibben.system.compiling import cache_folder, deferred

HEAVY = {"sklearn", "numba", "scipy.optimize", "pandas", "joblib", "pint", "plotly"}
"""Half a second to several, each."""


def printed(code: str, folder: Path, **environment: str) -> list[str]:
    """Return the lines that a fresh process prints."""
    run = subprocess.run(
        [sys.executable, "-c", code],
        cwd=folder,
        env=os.environ | environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return run.stdout.split("\n")[:-1]


def double(x: float) -> float:
    return 2.0 * x


def test_importing_loads_nothing_heavy(tmp_path: Path) -> None:
    code = f"""
import sys
def told(): print(*sorted({HEAVY} & set(sys.modules)))
from mckibben import PI, GPIEstimator, registry
for group, names in registry.PLUGINS.items():
    for name in names: registry.load(group, name)
assert repr(GPIEstimator()) and PI((0.0,), (1.0,), 0.0, (0.0, 5.0)).inverse()
told()
import scipy.optimize
told()
"""
    before, after = printed(code, tmp_path)
    assert before == ""
    assert "scipy.optimize" in after


@pytest.mark.parametrize(
    ("start", "absent"),
    [
        ("import mckibben", {"numpy", "pydantic"}),
        (
            "from mckibben.cli.entry import run; sys.argv[1:] = ['--help']; run()",
            {"numpy", "pydantic"},
        ),
        ("from mckibben import PIEstimator; PIEstimator()", HEAVY | {"scipy"}),
    ],
)
def test_a_start_loads_little(start: str, absent: set[str], tmp_path: Path) -> None:
    code = f"""
import sys
try:
    {start}
finally:
    print(*sorted({absent} & set(sys.modules)), flush=True)
"""
    assert printed(code, tmp_path)[-1] == ""


CALLED = """
from mckibben.system.compiling import deferred

SIZE = 2.0

@deferred
def grown(x):
    return 3.0 * x
"""

CALLING = """
from called import SIZE, grown
from mckibben.system.compiling import deferred

@deferred
def result(x):
    return SIZE * grown(x)

given = result(1.0)
print(given, sum(result.dispatcher.stats.cache_hits.values()))
"""


@pytest.mark.long
def test_a_kernel_kept_notices_what_changes_in_the_files_that_it_calls(tmp_path: Path) -> None:
    own = {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONDONTWRITEBYTECODE": "1"}
    (tmp_path / "calling.py").write_text(CALLING)
    for content, expected in (
        (CALLED, ["6.0 0"]),
        (CALLED, ["6.0 1"]),
        (CALLED.replace("3.0 * x", "4.0 * x"), ["8.0 0"]),
        (CALLED.replace("SIZE = 2.0", "SIZE = 5.0"), ["15.0 0"]),
    ):
        (tmp_path / "called.py").write_text(content)
        assert printed("import calling", tmp_path, **own) == expected


DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "truncated": lambda content: content[: len(content) // 2],
    "garbled": lambda content: content[:-9] + bytes(9),
    "empty": lambda content: b"",
    "of another version": lambda content: sha256(b"K\x01.").digest() + b"K\x01.",
    "no pickle": lambda content: sha256(b"text").digest() + b"text",
}


def test_damaged_files_of_the_cache_are_compiled_again(tmp_path: Path) -> None:
    own = {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONDONTWRITEBYTECODE": "1"}
    (tmp_path / "calling.py").write_text(CALLING)
    (tmp_path / "called.py").write_text(CALLED)
    code = """
import warnings
with warnings.catch_warnings(record=True) as noted:
    warnings.simplefilter("always")
    from calling import grown
    grown(1.0)
print(len(noted))
"""
    assert printed(code, tmp_path, **own) == ["6.0 0", "0"]
    files = list((tmp_path / "cache").rglob("*.nbc"))
    assert len(files) == 2
    for damage in DAMAGES.values():
        for path in files:
            path.write_bytes(damage(path.read_bytes()))
        assert printed(code, tmp_path, **own) == ["6.0 0", "1"]
    assert printed(code, tmp_path, **own) == ["6.0 1", "0"]


def test_a_folder_that_cannot_be_written_to_is_no_cache(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))
    with pytest.warns(CacheWarning):
        assert cache_folder.__wrapped__() is None


LOOPING = """
from mckibben.system.compiling import deferred

def looped(function):
    def loop(x):
        return function(x)
    return deferred(loop)
"""

MOVED = """
from mckibben.system.compiling import deferred
from {module} import grown

@deferred
def result(x):
    return grown(x)
"""

LOOPED = """
from looping import looped
from moved import result

loop = looped(result)
print(loop(1.0), sum(loop.dispatcher.stats.cache_hits.values()))
"""


@pytest.mark.long
def test_a_kernel_kept_does_without_the_module_that_what_it_calls_stood_in(tmp_path: Path) -> None:
    own = {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONDONTWRITEBYTECODE": "1"}
    (tmp_path / "looping.py").write_text(LOOPING)
    for module, hits in (("called", 0), ("called", 1), ("elsewhere", 0)):
        (tmp_path / "called.py").unlink(missing_ok=True)
        (tmp_path / f"{module}.py").write_text(CALLED)
        (tmp_path / "moved.py").write_text(MOVED.format(module=module))
        assert printed(LOOPED, tmp_path, **own) == [f"3.0 {hits}"]


ALIKE = """
from looping import looped
from called import grown
from mckibben.system.compiling import deferred

@deferred
def shrunk(x):
    return 0.5 * x

loops = [looped(looped(function)) for function in {functions}]
print(*[loop(1.0) for loop in loops])
print(*[sum(loop.dispatcher.stats.cache_hits.values()) for loop in loops])
compiled = [next(iter(loop.dispatcher.overloads.values())) for loop in loops]
print(*[one.fndesc.mangled_name for one in compiled])
"""


@pytest.mark.long
def test_kernels_that_one_function_made_are_kept_each_for_itself(tmp_path: Path) -> None:
    own = {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONDONTWRITEBYTECODE": "1"}
    (tmp_path / "looping.py").write_text(LOOPING)
    (tmp_path / "called.py").write_text(CALLED)
    symbols = set()
    for functions, results, hits in (
        ("[grown]", "3.0", "0"),
        ("[shrunk]", "0.5", "0"),
        ("[grown, shrunk]", "3.0 0.5", "1 1"),
    ):
        *found, names = printed(ALIKE.format(functions=functions), tmp_path, **own)
        assert found == [results, hits]
        symbols |= set(names.split())
    assert len(symbols) == 2  # by which other compiled code calls them


def test_kernels_travel_to_other_processes() -> None:
    kernel = deferred(double)
    for _ in range(2):  # before it is compiled, and after
        assert cloudpickle.loads(cloudpickle.dumps(kernel))(3.0) == 6.0
        np.testing.assert_equal(kernel(3.0), 6.0)
