"""Force followed by feedforward where the length is imposed."""

from __future__ import annotations

import numpy as np

from mckibben import Recording
from mckibben.blocks.compose import Parallel
from mckibben.blocks.force.feedforward import ForceFeedforward
from mckibben.blocks.force.multistate_friction import EACH_WAY, MultistateFriction
from mckibben.blocks.hysteresis.pi import PI
from mckibben.control import Twin, track
from mckibben.papers.paper import printed
from tests.cli.conftest import cli as cli  # a fixture

LAW = printed("multistate-static-force")
FRICTION = MultistateFriction(
    EACH_WAY,
    (*(7.0, 5e-3, 52.0, 5e-3, 60.0), *(5.0, 5e-3, 30.0), *(12.0, 5e-3, 50.0)),
    initial="virgin",
)
MODEL = Parallel((LAW, FRICTION))


STAND = Twin(MODEL, limits={"pressure": (-9.0, 9.0)}, sample_time=0.02)


def reference() -> Recording:
    time = np.arange(600) * 0.02
    length = 194.0 + 6.0 * np.cos(2 * np.pi * time / 10)
    return Recording({"force": 150.0 + 30.0 * np.sin(time), "length": length}, 0.02)


def test_feedforward_gives_the_force_exactly_where_the_model_is_the_plant() -> None:
    ahead = ForceFeedforward.of(MODEL)
    assert ahead is not None
    found = track(ahead, STAND, reference(), approach=2.0, pressure_loop=False)
    assert found.rmse["force"] < 1e-9
    assert found.recording.units["reference_force"] == "N"
    assert ForceFeedforward.of(LAW) == ForceFeedforward(LAW)
    blind = track(ForceFeedforward(LAW), STAND, reference(), approach=2.0, pressure_loop=False)
    assert blind.rmse["force"] > 30.0
    assert ForceFeedforward.of(PI.example()) is None
