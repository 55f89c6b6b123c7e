"""An inverse tried on its model stands beside what no compensation does there."""

from __future__ import annotations

import numpy as np
import pytest

from mckibben import PI, Recording
from mckibben.blocks.compose import Parallel
from mckibben.blocks.force.feedforward import ForceFeedforward
from mckibben.blocks.force.tondu_lopez import TonduLopez
from mckibben.comparison.row import Row
from mckibben.registry import load
from mckibben.studying.inverting import check_inverse


def test_no_compensation_leaves_the_loop_of_the_model() -> None:
    """Read off the rising branch of one stop, falling references are off by its height: 2 r w."""
    weight, threshold = 4.0, 0.4
    model = PI((0.0, threshold), (2.0, weight), 0.0, (0.0, 5.0))
    t = np.arange(500) * 0.05
    recording = Recording({"pressure": 2.5 - 2.5 * np.cos(t)}, 0.05)
    found = check_inverse("pi", model, recording.with_channels(**_modelled(model, recording)))
    assert found.reachable is not None
    assert found.uncompensated is not None
    assert found.uncompensated_error is not None
    height = 2 * threshold * weight / (found.reachable[1] - found.reachable[0])
    assert found.error < 1e-9
    assert found.uncompensated_error == pytest.approx(height, rel=0.02)
    told = found.to_dict()
    assert told["uncompensated_error"] == found.uncompensated_error


def _modelled(model: PI, recording: Recording) -> dict[str, np.ndarray]:
    return {"displacement": model.simulate(recording)["displacement"]}


def test_several_muscles_stand_beside_no_compensation_too() -> None:
    model = load("blocks", "per-channel").example()
    t = np.arange(400) * 0.05
    driven = {f"pressure_{k}": 2.5 - 2.4 * np.cos((0.5 + 0.2 * k) * t) for k in (1, 2)}
    recording = Recording(driven, 0.05)
    modelled = model.simulate(recording)
    found = check_inverse("both", model, modelled)
    assert found.uncompensated is not None
    assert found.uncompensated.shape == (400, 2)
    assert found.uncompensated_error is not None
    assert found.uncompensated_error > 10 * found.error


def test_a_force_is_compensated_alike_in_the_leaderboard_and_in_the_check() -> None:
    ahead = ForceFeedforward.example()
    model, t = ahead.undone, np.arange(400) * 0.05
    assert isinstance(model, Parallel)
    driven = {"length": 2.0 + np.sin(t), "pressure": 2.5 - 2.0 * np.cos(0.3 * t)}
    found = check_inverse(
        "force", model, model.simulate(Recording(driven, 0.05)).with_channels(**driven)
    )
    row = Row("force", block=model)
    assert found.inverse == row.inverse == ahead
    assert (found.given, row.to_dict()["inverse"]) == ("pressure", "exact")
    assert found.error < 1e-9
    assert found.uncompensated_error is None
    assert Row("force", block=TonduLopez.example()).to_dict()["inverse"] == "none"
