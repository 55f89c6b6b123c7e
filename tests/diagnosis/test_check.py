"""A right model is found right, a wrong one is told what it misses: of data of known truth."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy import stats
from scipy.signal import lfilter

from mckibben import PI, DataError, Recording
from mckibben.blocks.dynamics.transfer_function import TransferFunction
from mckibben.blocks.runs import FreeRun, run_of
from mckibben.diagnosis.check import check, check_runs
from mckibben.metrics import USEFUL
from mckibben.signals import staircase
from tests.diagnosis.runs import LINE, STEP, TRUE, Array, cycles, noise, recording, run
from tests.refusals import refused

SEEDS = 12
LEVEL = 0.2

LINEAR = TransferFunction(
    numerator=(0.0, 0.2), denominator=(-0.9,), sample_time=STEP, initial="first_sample"
)


def usual(hits: int, seeds: int, level: float) -> bool:
    """Return whether a test of that level hits so often, neither side of 99 %."""
    low, high = stats.binom.interval(0.99, seeds, level)
    return bool(low <= hits <= high)


def missed(model: PI, measured: Recording) -> list[str]:
    """Return the kinds of what a model of one output misses."""
    return [one.kind for one in check(model, measured).outputs[0].missing]


@pytest.mark.parametrize("alike", [0.0, 0.9])
@pytest.mark.parametrize("model", [TRUE, LINEAR], ids=lambda model: model.kind)
def test_right_models_are_accused_as_seldom_as_is_said(
    model: PI | TransferFunction, alike: float
) -> None:
    accused, coloured = 0, 0
    for seed in range(SEEDS):
        found = check(model, run(model, 1500, seed, alike=alike))
        (one,) = found.outputs
        assert one.whiteness.p_value is not None
        coloured += one.whiteness.p_value <= LEVEL
        accused += not found.right
    assert usual(accused, SEEDS, 0.01)
    assert coloured == SEEDS if alike else usual(coloured, SEEDS, LEVEL)


@pytest.mark.parametrize(("width", "size", "alike"), [(0.05, 0.03, 0.0), (0.2, 0.02, 0.9)])
def test_a_line_through_a_play_leaves_hysteresis(width: float, size: float, alike: float) -> None:
    play = PI(thresholds=(5.0 * width / 2,), weights=(4.0,))
    for seed in range(6):
        measured = run(play, 1500, seed, alike=alike, size=20.0 * size)
        slope, offset = np.polyfit(measured["pressure"], measured["displacement"], 1)
        line = PI(thresholds=(0.0,), weights=(slope,), offset=offset)
        found = check(line, measured).outputs[0]
        assert found.missing[0].kind == "hysteresis"


def held(n: int) -> Array:
    return staircase(STEP * np.arange(n), [0.0, 4.0, 1.0, 5.0, 2.0, 3.0], n * STEP / 6)


def late(y: Array, samples: int) -> Array:
    return np.concatenate([np.repeat(y[:1], samples), y[:-samples]])


def creeping(u: Array) -> Array:
    share = np.exp(-STEP / 2)
    return np.asarray(u - lfilter([1 - share], [1, -share], u))


MISSED: dict[str, tuple[Callable[[int], Array], Callable[[Array, Array], Array]]] = {
    "offset": (cycles, lambda u, y: y + 0.4),
    "drift": (cycles, lambda u, y: y + np.linspace(0, 1, u.size)),
    "lag": (cycles, lambda u, y: late(y, 10)),
    "curve": (cycles, lambda u, y: y + 0.15 * (u - 2.5) ** 2),
    "creep": (held, lambda u, y: y - 0.4 * creeping(u)),
}


@pytest.mark.parametrize("what", MISSED)
def test_what_is_missed_is_named_first(what: str) -> None:
    given, spoilt = MISSED[what]
    u = given(4000)
    for seed in range(2):
        y = spoilt(u, TRUE.simulate(u)) + 0.1 * noise(u.size, 0.8, seed)
        one = check(TRUE, recording(u, y)).outputs[0].missing[0]
        assert one.kind == what
        assert 0.3 < one.share <= 1.0
        if what == "lag":
            assert one.coefficient == pytest.approx(10, abs=2)
    assert check(TRUE, recording(u, TRUE.simulate(u) + 0.1 * noise(u.size, 0.8, 9))).right


def test_a_load_that_the_model_does_not_read_is_named() -> None:
    u = cycles(4000)
    load = staircase(STEP * np.arange(u.size), [0.0, 20.0, 5.0, 30.0, 10.0, 25.0], 4.0)
    y = TRUE.simulate(u) - 0.02 * load + 0.1 * noise(u.size, 0.8, 1)
    measured = recording(u, y).with_channels({"force": "N"}, force=load)
    first = check(TRUE, measured).outputs[0].missing[0]
    assert (first.kind, first.channel) == ("load", "force")


def test_rounding_and_a_coarse_sensor_say_nothing() -> None:
    u = cycles(3000)
    coarse = np.round(TRUE.simulate(u) / 0.2) * 0.2
    assert check(TRUE, recording(u, TRUE.simulate(u))).right
    assert check(TRUE, recording(u, coarse)).right
    # a loop that the sensor does show is found all the same
    assert "hysteresis" in missed(LINE, recording(u, coarse))


@pytest.mark.parametrize("share", [0.5, 0.88, 0.92, 1.1])
def test_of_no_use_is_what_a_comparison_does_not_recommend(share: float) -> None:
    y = run(TRUE, 1500)["displacement"]
    u, mean = cycles(1500), 1.0
    modelled = y - share * (y - mean)
    measured = run_of(recording(u, y), ["pressure"], ["displacement"])
    taken = FreeRun.of(measured, modelled[:, np.newaxis])
    (one,) = check_runs(TRUE, [taken], means=np.array([mean])).outputs
    assert one.rmse == pytest.approx(share * one.mean_error)
    assert one.useless == (share > USEFUL)
    # where nothing is known of the training, it is the mean of what is checked
    assert check_runs(TRUE, [taken]).outputs[0].mean_error == pytest.approx(np.std(y))


GOOD = run(TRUE, 600)
STILL = np.full(600, 2.0)


@pytest.mark.parametrize(
    ("recordings", "fields"),
    [
        ([], {"parameter": "recordings"}),
        ([GOOD.select(["pressure"])], {"channel": "displacement"}),
        ([recording(cycles(20), cycles(20))], {"names": 20}),
        ([GOOD, recording(cycles(5), cycles(5))], {"names": 5}),
        ([recording(STILL, GOOD["displacement"])], {"channel": "pressure"}),
        ([recording(GOOD["pressure"], STILL)], {"channel": "displacement"}),
        ([GOOD, Recording(dict(GOOD.channels), 0.05)], {"options": ({"resample": 0.05},)}),
        ([GOOD, Recording(dict(GOOD.channels))], {"channel": "time"}),
    ],
)
def test_what_cannot_be_checked_is_refused(
    recordings: list[Recording], fields: dict[str, Any]
) -> None:
    with refused(DataError, **fields):
        check(TRUE, recordings)
