"""Force followed by feedforward where the length is imposed."""

from __future__ import annotations

import numpy as np

from mckibben import Recording
from mckibben.blocks.compose import Parallel
from mckibben.blocks.force.feedforward import ForceFeedforward
from mckibben.blocks.force.multistate_friction import EACH_WAY, MultistateFriction
from mckibben.blocks.hysteresis.pi import PI
from mckibben.control import Twin, control_law, track, tune_pid
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


def test_pid_follows_a_force_where_nothing_moves() -> None:
    stand = Twin(MODEL, limits={"pressure": (-9.0, 9.0)}, sample_time=0.02, held={"length": 194.0})
    ahead, law_alone = ForceFeedforward.of(MODEL), ForceFeedforward(LAW)
    assert ahead is not None
    pid = tune_pid(stand, sample_time=0.02, hold=2.0, references=ahead.inputs[:1])
    assert pid.driven[0].name == "force"
    alone, corrected = (
        track(law, STAND, reference(), approach=2.0, pressure_loop=False).rmse["force"]
        for law in (law_alone, control_law("feedforward-pid", law_alone, lambda: pid))
    )
    assert corrected < 0.2 * alone
