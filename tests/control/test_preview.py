"""Loops whose compensators know the reference ahead: dead time vanishes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mckibben import PI, Recording, Series
from mckibben.blocks.dynamics.air import Air
from mckibben.blocks.feedback import FeedforwardFeedback, PIDFeedback
from mckibben.blocks.fields import Channel
from mckibben.blocks.memoryless import Affine
from mckibben.control import DisturbanceObserver, EstimatedLoad, Twin, track
from mckibben.control.controller import BlockController, Controller
from tests.cli.conftest import cli as cli  # a fixture

STEP, LATE = 0.02, 5
AIR = replace(Air.example(), dead_time=LATE * STEP, supply=5.0)
PLANT = Series((AIR, PI.example()))
KNOWN = Series((replace(AIR, dead_time=(LATE + 1) * STEP), PI.example()))
"""As it is recorded: what is applied at a sample is held until the next, and seen there."""


def late(load: float = 0.0) -> Twin:
    moved = PLANT.outputs[0]
    loaded = Series((AIR, PI.example(), Affine(1.0, load, moved, moved)))
    return Twin(loaded, limits={"voltage": (0.0, 10.0)}, sample_time=STEP)


def wanted() -> Recording:
    low, high = (float(end[0]) for end in PLANT.reachable())
    t = np.arange(800) * STEP
    return Recording(
        {"displacement": 0.5 * (low + high) - 0.3 * (high - low) * np.cos(2 * np.pi * t / 4)}, STEP
    )


def error(controller: Any, preview: float | None = None, load: float = 0.0) -> float:
    found = track(controller, late(load), wanted(), settle=4.0, preview=preview)
    return found.rmse["displacement"]


SPAN = float(np.ptp(wanted()["displacement"]))


def test_a_compensator_is_on_time_by_default_and_late_without_preview() -> None:
    compensator = KNOWN.inverse()
    # held for the last samples, the reference is nowhere to be known
    assert error(compensator) < 1e-9 * SPAN
    assert error(compensator, 0.0) > 0.05 * SPAN
    assert error(compensator, (LATE + 2) * STEP) > 0.01 * SPAN


def feedback() -> PIDFeedback:
    channels = (Channel("displacement", "mm"),), (Channel("voltage", "V"),)
    return PIDFeedback.of(*channels, (0.05,), (0.4,), (0.0,), limits=(0.0, 10.0))


def test_feedback_goes_by_the_present_reference() -> None:
    both = FeedforwardFeedback.of(KNOWN.inverse(), feedback())
    # the next step's reference is what feedback has always compared with: a sample ahead
    assert error(both) < 0.05 * SPAN
    assert error(both) < 0.2 * error(both, 0.0)
    assert error(both, load=-1.0) < 0.5 * error(KNOWN.inverse(), load=-1.0)


def test_an_observer_and_an_estimated_load_pass_the_preview_on() -> None:
    observer = DisturbanceObserver(KNOWN.inverse())
    assert observer.preview == pytest.approx((LATE + 1) * STEP)
    assert error(observer) < 0.02 * SPAN
    assert error(observer) < 0.3 * error(observer, 0.0)
    assert BlockController(feedback()).preview == 0.0
    assert error(feedback(), 0.2) == error(feedback())
    estimated = with_estimate(BlockController(KNOWN.inverse()))
    assert estimated.preview == observer.preview
    assert error(estimated) < 1e-9 * SPAN


def with_estimate(controller: Controller) -> EstimatedLoad:
    """Return a controller that is given the estimate of a load, of which it makes no use."""
    estimate = Affine(0.0, 0.0, Channel("displacement", "mm"), Channel("force", "N"))
    return EstimatedLoad(controller, estimate)


@pytest.mark.parametrize(
    "controller",
    [
        BlockController(KNOWN.inverse()),
        BlockController(FeedforwardFeedback.of(KNOWN.inverse(), feedback())),
        DisturbanceObserver(KNOWN.inverse()),
    ],
    ids=["compensator", "with feedback", "observer"],
)
def test_a_controller_works_with_an_estimate_as_without(controller: Controller) -> None:
    alone = error(controller, load=-1.0)
    assert error(with_estimate(controller), load=-1.0) == pytest.approx(alone, rel=1e-9)
