"""Importing loads little; a kernel is compiled when it is first run, once, and found again."""

from __future__ import annotations

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier

import cloudpickle
import numba
import numpy as np
import pytest

from mckibben.system.compiling import deferred, resolved

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


CALLED = """
import numpy as np
from mckibben.system.compiling import deferred

SIZE, UNREAD = 2.0, 1.0
TABLE = np.array([1.0])

@deferred
def grown(x):
    return 3.0 * x * TABLE[0]
"""

BETWEEN = """
import called
from mckibben.system.compiling import deferred

@deferred
def passed_on(x):
    return called.grown(x)
"""

CALLING = """
from between import passed_on
from called import SIZE
from mckibben.system.compiling import deferred

@deferred
def result(x):
    return SIZE * passed_on(x)
"""

ASK = """
from calling import result
given = result(1.0)
print(given, sum(result.dispatcher.stats.cache_hits.values()))
"""


CHANGES = {
    "code": ("3.0 * x", "4.0 * x", "8.0 0"),
    "number": ("SIZE, UNREAD = 2.0", "SIZE, UNREAD = 5.0", "20.0 0"),
    "table": ("[1.0]", "[2.0]", "40.0 0"),
    "options": (
        "@deferred",
        "@__import__('functools').partial(deferred, fastmath=True)",
        "40.0 0",
    ),
    "what nothing reads": ("= 5.0, 1.0", "= 5.0, 3.0", "40.0 1"),
}


@pytest.mark.long
def test_a_kernel_kept_notices_what_changes_in_the_files_that_it_calls(tmp_path: Path) -> None:
    text = CALLED
    for name, content in {"called": CALLED, "between": BETWEEN, "calling": CALLING}.items():
        (tmp_path / f"{name}.py").write_text(content)
    own = {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONDONTWRITEBYTECODE": "1"}
    assert printed(ASK, tmp_path, **own) == ["6.0 0"]
    assert printed(ASK, tmp_path, **own) == ["6.0 1"]
    for what, (was, becomes, expected) in CHANGES.items():
        assert was in text
        text = text.replace(was, becomes)
        (tmp_path / "called.py").write_text(text)
        assert printed(ASK, tmp_path, **own) == [expected], what


@pytest.mark.long
def test_kernels_run_uncompiled(tmp_path: Path) -> None:
    code = (
        "from mckibben.registry import load\n"
        "for kind in ('gpi', 'duhem'):\n"
        "    block = load('blocks', kind).example()\n"
        "    print(block.inverse().simulate(block.simulate([1.0, 3.0, 2.0])).round(9).tolist())"
    )
    assert printed(code, tmp_path, NUMBA_DISABLE_JIT="1") == 2 * ["[1.0, 3.0, 2.0]"]


def test_threads_that_ask_at_once_share_one_function() -> None:
    kernel, together = deferred(double), Barrier(8)

    def ask() -> object:
        together.wait()
        return resolved(kernel)

    with ThreadPoolExecutor(8) as pool:
        found = [pool.submit(ask) for _ in range(8)]
    assert len({id(one.result()) for one in found}) == 1


def test_kernels_travel_to_other_processes() -> None:
    kernel = deferred(double)
    for _ in range(2):  # before it is compiled, and after
        assert cloudpickle.loads(cloudpickle.dumps(kernel))(3.0) == 6.0
        np.testing.assert_equal(kernel(3.0), 6.0)


def test_without_a_place_for_caches_kernels_are_compiled_all_the_same(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from numba.core import caching

    def plain(x: float) -> float:
        return 2.0 * x

    monkeypatch.setattr(caching.CompileResultCacheImpl, "_locator_classes", [])
    with pytest.raises(RuntimeError, match="no locator"):
        numba.njit(cache=True)(plain)
    assert deferred(plain)(3.0) == 6.0
