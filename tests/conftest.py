"""Property tests draw the same examples in every run, so that a red test stays red until mended."""

from __future__ import annotations

import os
import sys

import pytest
from hypothesis import settings

from mckibben.system.workers import ONE_THREAD
from tests.tools import skip_without_tools

settings.register_profile("deterministic", derandomize=True, deadline=None)
settings.load_profile("deterministic")

# each of pytest's workers has a core of its own, which is all that linear algebra is to take
os.environ.update(ONE_THREAD)
# hundreds of processes are started here: what one has compiled, the next need not compile again
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip what this machine has no tools for."""
    skip_without_tools(item)
