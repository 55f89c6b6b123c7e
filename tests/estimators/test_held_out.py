"""What is held out of a fit: no estimator may learn from outputs that do not count."""

from __future__ import annotations

import numpy as np
import pytest

from mckibben.blocks.core.saving import to_dict
from tests.estimators.examples import CASES, KINDS, quick, recorded

HELD_OUT = slice(60, 80)


@pytest.mark.parametrize(("name", "kind"), CASES)
def test_outputs_that_do_not_count_change_nothing(name: str, kind: str) -> None:
    runs = recorded(kind)
    rows = [np.ones(len(run), dtype=bool) for run in runs]
    rows[0][HELD_OUT] = False
    spoilt = {output: runs[0][output].copy() for output in KINDS[kind].outputs}
    for values in spoilt.values():
        values[HELD_OUT] = 2.0 * values[HELD_OUT] + 0.5 * np.ptp(values)
    others = (runs[0].with_channels(**spoilt), *runs[1:])
    one, other = (quick(name, kind).fit(given, rows=rows).model_ for given in (runs, others))
    assert to_dict(one) == to_dict(other)
