"""Run tests of kernels uncompiled, and tell which lines of kernels they do not reach.

Tools that watch Python do not see compiled code. Run: python -m tests.uncompiled
"""

from __future__ import annotations

import inspect
import os
import sys
from collections.abc import Iterator
from pathlib import Path

TESTS = (
    "contracts/test_twins.py",
    "blocks/test_kernels.py",
    "blocks/test_play.py::test_operators_side_by_side_are_single_operators",
    "blocks/test_gpi.py::test_operators_side_by_side_are_the_model",
    "blocks/test_adaptive.py::test_a_sensor_that_fails_teaches_nothing",
    "blocks/test_adaptive.py::test_forward_and_inverse_match_at_every_step_whatever_is_measured",
    "blocks/test_adaptive.py::test_nothing_blows_up_where_nothing_moves",
    "blocks/test_adaptive.py::test_outliers_cost_little",
    "blocks/test_adaptive_balance.py::test_a_sensor_that_drops_out_or_stands_still_teaches_nothing",
    "blocks/test_adaptive_balance.py::test_retuned_coefficients_are_those_of_the_block_retaught",
    "blocks/test_adaptive_balance.py::test_slopes_are_those_of_equilibria",
    "blocks/test_adaptive_balance.py::test_what_garbage_teaches_is_a_balance_still",
    "blocks/test_predictive.py::test_a_derivative_above_zero_throughout_is_least_at_its_lowest",
    "blocks/test_predictive.py::test_plans_end_where_there_is_none",
    "blocks/test_predictive.py::test_a_supply_limits_one_muscle_too",
    "blocks/test_predictive.py::test_limits_hold_always_and_looking_ahead_costs_less",
    "blocks/test_predictive.py::test_plans_are_the_best_there_are",
    "blocks/test_predictive.py::test_the_supply_takes_from_all_in_one_share",
    "blocks/test_predictive.py::test_without_active_limits_it_is_the_exact_inverse",
    "blocks/test_eupi.py::test_operators_side_by_side_are_the_model",
    "blocks/test_maxwell_slip.py",
    "blocks/test_oscillator.py::test_streams_are_batches",
    "estimators/test_oscillator.py::test_runs_with_derivatives_are_those_of_the_block_and_exact",
    "estimators/test_narx.py::test_feeding_back_agrees_with_its_twin",
    "estimators/test_state_network.py::test_runs_with_derivatives_are_those_of_the_block_and_exact",
    "estimators/test_state_network.py::test_a_run_that_leaves_all_bounds_ends",
    "signals/test_reversals.py",
)
"""Quick without a compiler, and between them in every line of every kernel."""

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
        # those that take long where compiled do not take long here, and are asked for too
        failed = pytest.main(
            ["-n0", "-m", "", *(str(HERE / test) for test in TESTS), *sys.argv[1:]]
        )
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
