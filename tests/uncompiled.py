"""Run the tests marked ``kernel`` uncompiled, and list the lines of kernels that they do not reach.

Tools that watch Python do not see compiled code. Run: python -m tests.uncompiled
"""

from __future__ import annotations

import inspect
import os
import sys
from collections.abc import Iterator
from pathlib import Path

LEFT_OUT = ("mckibben.rigs.",)
"""Physics of rigs runs on records, which Python gives no attributes uncompiled."""

HERE = Path(__file__).parent


def watched(name: str) -> bool:
    """Tell whether kernels of a module count."""
    return name.startswith("mckibben.") and not name.startswith(LEFT_OUT)


def kernels() -> Iterator[tuple[Path, range]]:
    """Give where every compiled function that was imported stands: its file, and its lines."""
    from mckibben.system.compiling import Deferred

    for name, module in sorted(sys.modules.items()):
        for value in vars(module).values() if watched(name) else ():
            if isinstance(value, Deferred) and value.__module__ == name:
                lines, first = inspect.getsourcelines(value.py_func)
                yield Path(inspect.getfile(value.py_func)), range(first, first + len(lines))


def main() -> int:
    """Run the tests, report the lines of kernels, and return 0 if none is left out."""
    os.environ["NUMBA_DISABLE_JIT"] = "1"
    import coverage
    import pytest

    observed = coverage.Coverage(data_file=None, config_file=False, source_pkgs=["mckibben"])
    with observed.collect():
        failed = pytest.main(["-n0", "-m", "kernel", str(HERE), *sys.argv[1:]])
        from mckibben import registry

        for group, names in registry.PLUGINS.items():
            for name in names:
                registry.load(group, name)
    total = missed = 0
    for path, lines in kernels():
        _, statements, _, missing, _ = observed.analysis2(str(path))
        left = sorted(set(missing) & set(lines))
        total, missed = total + len(set(statements) & set(lines)), missed + len(left)
        if left:
            print(f"{path}: no test runs {', '.join(map(str, left))}")
    print(f"lines of kernels run: {total - missed} of {total}")
    return int(bool(failed or missed))


if __name__ == "__main__":
    sys.exit(main())
