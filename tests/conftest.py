"""Property tests draw the same examples in every run, so that a red test stays red until mended."""

from __future__ import annotations

import os
import sys

import pytest
from hypothesis import settings

from tests.tools import skip_without_tools

settings.register_profile("deterministic", derandomize=True, deadline=None)
settings.load_profile("deterministic")

# hundreds of processes are started here: what one has compiled, the next need not compile again
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False


LONG = tuple(
    f"tests/{place}"
    for place in (
        "app/test_apart.py",
        "app/test_compensate.py",
        "app/test_data.py",
        "app/test_following.py",
        "app/test_held_out.py",
        "app/test_jobs.py",
        "app/test_journey.py",
        "app/test_look.py",
        "app/test_looks.py",
        "app/test_loops.py",
        "app/test_news.py",
        "app/test_next_steps.py",
        "app/test_pages.py",
        "app/test_scripts.py",
        "app/test_twenty.py",
        "attacks/test_hostile_folder.py",
        "attacks/test_options.py",
        "attacks/test_reports.py",
        "attacks/test_workers.py",
        "bands/test_calibrate.py",
        "blocks/test_adaptive_balance.py",
        "blocks/test_predictive.py",
        "cli/test_measured.py",
        "cli/test_muscles.py",
        "cli/test_plan.py",
        "cli/test_stopping.py",
        "comparison/test_cluster.py",
        "contracts/test_release.py",
        "docs/test_site.py",
        "docs/test_tutorials.py",
        "estimators/test_balance_prior.py",
        "estimators/test_coupled.py",
        "estimators/test_linear.py",
        "estimators/test_loads.py",
        "papers",
        "studying/test_log.py",
        "validation/test_check.py",
        "validation/test_regression.py",
    )
)
"""What goes a whole way, in a browser, a protocol, a compiler, other processes: ``-m long``.

These take three quarters of the time of all tests, and are left out where nothing is said.
"""


@pytest.hookimpl(tryfirst=True)  # before marks select
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what takes long."""
    for item in items:
        if item.nodeid.startswith(LONG):
            item.add_marker(pytest.mark.long)


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip what this machine has no tools for."""
    skip_without_tools(item)
