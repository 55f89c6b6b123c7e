"""A rig that changes while it runs: its physics is the rig's, at every moment."""

from __future__ import annotations

import numpy as np
import pytest

from mckibben.errors import DataError, ModelError
from mckibben.rigs import load_rig
from mckibben.rigs.drifting import Drifting
from tests.refusals import refused

RIG = load_rig("mas20-hanging").changed(
    {"sensor.pressure.noise": 0.0, "sensor.displacement.noise": 0.0, "sample_time": 0.02}
)


def pressures(n: int) -> list[float]:
    return [2.5 + 1.5 * float(np.sin(0.05 * k) * np.sin(0.013 * k)) for k in range(n)]


def test_nothing_drifts_until_it_begins() -> None:
    plain, drifting = RIG.changed({}), Drifting(RIG, {"stiffness": 0.8}, start=1.0)
    assert np.array_equal(plain.reset(3), drifting.reset(3))
    for p in pressures(50):
        assert np.array_equal(plain.step([p]), drifting.step([p]))
    assert not np.array_equal(plain.step([3.0]), drifting.step([3.0]))


def test_a_step_keeps_where_the_muscle_is() -> None:
    """No time passes at a change: the next measurement is of the same muscle, moved a little."""
    drifting = Drifting(RIG, {"friction": 0.5}, start=2.0)
    drifting.reset()
    found = np.array([drifting.step([3.0])[1] for _ in range(200)])
    assert abs(found[100] - found[99]) < 1.0 < found[99]


def test_gain_is_the_calibration_of_pressure() -> None:
    """Commands and measurements are both in what the drifted sensor calls a bar."""
    exact = RIG.changed({"sensor.pressure.resolution": 0.0})
    plain, drifting = exact.changed({}), Drifting(exact, {"gain": 0.9})
    plain.reset()
    drifting.reset()
    for p in pressures(60):
        true, shown = plain.step([0.9 * p]), drifting.step({"pressure": p})
        np.testing.assert_allclose(shown, [true[0] / 0.9, true[1]], rtol=1e-12)


def test_reset_undoes_all_changes() -> None:
    drifting = Drifting(RIG, {"gain": 0.9, "stiffness": 0.8}, start=0.1)
    first = [drifting.reset(1), *(drifting.step([2.0]) for _ in range(20))]
    again = [drifting.reset(1), *(drifting.step([2.0]) for _ in range(20))]
    assert np.array_equal(first, again)


def test_refusals() -> None:
    for group, factor, start in (("colour", 0.9, 0.0), ("gain", 0.0, 0.0), ("gain", 0.9, -1.0)):
        with pytest.raises(ModelError):
            Drifting(RIG, {group: factor}, start)
    with refused(DataError, parameter="gain"):
        RIG.aged({"gain": 0.9})
