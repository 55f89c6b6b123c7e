"""A right model is found right, a wrong one is told what it misses."""

from __future__ import annotations

import json
from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats
from scipy.signal import lfilter

import mckibben
from mckibben import GPI, PI, DataError, ModelError, PerChannel, PIEstimator, Recording
from mckibben.blocks.core.fields import Channel
from mckibben.blocks.dynamic.transfer_function import TransferFunction
from mckibben.signals import staircase
from mckibben.system.atomic import to_json
from mckibben.validation.check import check
from tests.validation.runs import LINE, STEP, TRUE, Array, cycles, noise, recording, run

SEEDS = 60
LEVEL = 0.2

LINEAR = TransferFunction(
    numerator=(0.0, 0.2), denominator=(-0.9,), sample_time=STEP, initial="first_sample"
)


def usual(hits: int, seeds: int, level: float) -> bool:
    """Return whether a test of that level hits so often, neither side of 99 %."""
    low, high = stats.binom.interval(0.99, seeds, level)
    return bool(low <= hits <= high)


@pytest.mark.parametrize("alike", [0.0, 0.9])
@pytest.mark.parametrize("model", [TRUE, GPI.example(), LINEAR], ids=lambda model: model.kind)
def test_right_models_are_accused_as_seldom_as_is_said(model: mckibben.Block, alike: float) -> None:
    branch, accused, coloured = 0, 0, 0
    for seed in range(SEEDS):
        found = check(model, run(model, 1500, seed, alike=alike))
        (one,) = found.outputs
        assert one.p_branch is not None
        assert one.whiteness.p_value is not None
        branch += one.p_branch <= LEVEL
        coloured += one.whiteness.p_value <= LEVEL
        accused += not found.right
    assert usual(branch, SEEDS, LEVEL)
    assert usual(accused, SEEDS, 0.01)
    if alike:
        assert coloured == SEEDS
    else:
        assert usual(coloured, SEEDS, LEVEL)


@pytest.mark.parametrize(("width", "size", "alike"), [(0.05, 0.03, 0.0), (0.2, 0.02, 0.9)])
def test_a_line_through_a_play_leaves_hysteresis(width: float, size: float, alike: float) -> None:
    play = PI(thresholds=(5.0 * width / 2,), weights=(4.0,))
    for seed in range(20):
        measured = run(play, 1500, seed, alike=alike, size=20.0 * size)
        slope, offset = np.polyfit(measured["pressure"], measured["displacement"], 1)
        found = check(PI(thresholds=(0.0,), weights=(slope,), offset=offset), measured)
        assert found.outputs[0].p_branch is not None
        assert found.outputs[0].p_branch < 1e-4
        assert "hysteresis over pressure" in found.verdict


def held(n: int) -> Array:
    return staircase(STEP * np.arange(n), [0.0, 4.0, 1.0, 5.0, 2.0, 3.0], n * STEP / 6)


def late(y: Array, samples: int) -> Array:
    return np.concatenate([np.repeat(y[:1], samples), y[:-samples]])


def creeping(u: Array) -> Array:
    share = np.exp(-STEP / 2)
    return np.asarray(u - lfilter([1 - share], [1, -share], u))


MISSED: dict[str, tuple[Callable[[int], Array], Callable[[Array, Array], Array], str]] = {
    "offset": (cycles, lambda u, y: y + 0.4, "an offset of 0.4"),
    "drift": (cycles, lambda u, y: y + np.linspace(0, 1, u.size), "drift over time"),
    "delay": (cycles, lambda u, y: late(y, 10), "a delay, about 0."),
    "curve": (cycles, lambda u, y: y + 0.15 * (u - 2.5) ** 2, "the gain or shape of the curve"),
    "creep": (held, lambda u, y: y - 0.4 * creeping(u), "creep after large steps"),
}


@pytest.mark.parametrize("what", MISSED)
def test_what_is_missed_is_named_alone(what: str) -> None:
    given, spoilt, said = MISSED[what]
    for seed in range(5):
        u = given(4000)
        y = spoilt(u, TRUE.simulate(u)) + 0.1 * noise(u.size, 0.8, seed)
        found = check(TRUE, recording(u, y))
        assert f"right but for {said}" in found.verdict or f"it misses {said}" in found.verdict
        assert len(found.outputs[0].missing) == 1
        assert 0.3 < found.outputs[0].missing[0].share <= 1.0
    right = check(TRUE, recording(u, TRUE.simulate(u) + 0.1 * noise(u.size, 0.8, 9)))
    assert right.right


def test_the_verdict_is_by_size_of_the_range() -> None:
    u = cycles(4000)
    y = TRUE.simulate(u) + 0.1 * noise(u.size, 0.5, 3)
    small = check(TRUE, recording(u, y + 0.01 * np.ptp(y)))
    assert small.verdict.startswith("The model is right but for an offset")
    large = check(TRUE, recording(u, y + 0.04 * np.ptp(y)))
    assert large.verdict.startswith("The model is wrong by 3.9 % of the range: it misses an offset")
    one = large.outputs[0]
    assert one.missing[0].size / one.span == pytest.approx(0.039, abs=0.001)
    assert "% of the range" in large.sentences[0]
    useless = check(TRUE, recording(u, y + 2 * np.ptp(y)))
    assert useless.verdict.startswith("The model is of no use here")


def test_a_level_larger_than_a_curve_brings_about_stands_apart() -> None:
    u = cycles(4000)
    bent = TRUE.simulate(u) + 0.1 * (u - 2.5) ** 2 + 0.05 * noise(u.size, 0.5, 3)
    (alone,) = check(TRUE, recording(u, bent)).outputs[0].missing
    assert alone.kind == "curve"
    first, second = check(TRUE, recording(u, bent + 0.5)).outputs[0].missing
    assert (first.kind, second.kind) == ("offset", "curve")
    assert first.share > 0.8
    assert first.share + second.share <= 1.0
    # a level that slow noise may have is neither the curve's nor certainly the model's
    wandering = bent + 2.0 * noise(u.size, 0.9995, 5) + 2.0
    one = check(TRUE, recording(u, wandering)).outputs[0]
    assert one.slow
    assert all(each.share < 0.1 for each in one.missing)


def test_over_one_sine_hysteresis_is_not_called_speed() -> None:
    u = 2.5 - 2.5 * np.cos(2 * np.pi * STEP * np.arange(3000) / 6.0)
    for seed in range(3):
        measured = recording(u, TRUE.simulate(u) + 0.1 * noise(u.size, 0.5, seed))
        slope, offset = np.polyfit(u, measured["displacement"], 1)
        found = check(PI(thresholds=(0.0,), weights=(slope,), offset=offset), measured)
        assert "hysteresis, speed or delay of pressure" in found.verdict
        assert "cannot tell them apart" in found.verdict
    late = recording(cycles(3000), 4 * cycles(3000) + 0.3 * np.gradient(cycles(3000)) / STEP)
    assert "hysteresis" not in check(LINE, late).verdict.split(" and ")[0]


@pytest.mark.parametrize(("n", "alike"), [(200, 0.9), (1500, 0.99)])
def test_few_independent_samples_accuse_nobody(n: int, alike: float) -> None:
    found = [check(TRUE, run(TRUE, n, seed, alike=alike)) for seed in range(30)]
    assert usual(sum(not one.right for one in found), 30, 0.01)
    assert sum(one.outputs[0].independent < 40 for one in found) > 15
    assert any("independent samples" in said for one in found for said in one.sentences)


def test_a_delay_is_told_in_seconds() -> None:
    u = cycles(6000)
    y = late(TRUE.simulate(u), 10) + 0.05 * noise(u.size, 0.0, 1)
    (missing,) = check(TRUE, recording(u, y)).outputs[0].missing
    assert missing.kind == "lag"
    assert missing.coefficient == pytest.approx(-10, abs=1)


def test_several_recordings_each_with_its_own_noise() -> None:
    runs = [run(TRUE, 700, seed) for seed in range(4)]
    found = check(TRUE, runs)
    assert found.right
    assert found.outputs[0].n_samples == 2800
    moved = [r.with_channels(displacement=r["displacement"] + 0.2 * k) for k, r in enumerate(runs)]
    assert not check(TRUE, moved).right


def test_one_output_that_is_wrong_is_named() -> None:
    parts = tuple(
        PI(
            TRUE.thresholds,
            TRUE.weights,
            input=Channel(f"pressure_{k}", "bar"),
            output=Channel(f"displacement_{k}", "mm"),
        )
        for k in (1, 2)
    )
    u = {"pressure_1": cycles(3000), "pressure_2": cycles(3000)[::-1].copy()}
    y = {
        f"displacement_{k}": TRUE.simulate(u[f"pressure_{k}"]) + 0.1 * noise(3000, 0.0, k)
        for k in (1, 2)
    }
    model = PerChannel(parts)
    assert check(model, Recording(u | y, STEP)).right
    y["displacement_2"] = y["displacement_2"] + 0.5
    found = check(model, Recording(u | y, STEP))
    assert [one.right for one in found.outputs] == [True, False]
    assert "displacement_2: the model is right but for an offset" in found.verdict


def test_rounding_and_a_coarse_sensor_say_nothing() -> None:
    u = cycles(3000)
    exact = check(TRUE, recording(u, TRUE.simulate(u)))
    assert exact.right
    assert "rounding" in exact.verdict
    coarse = check(TRUE, recording(u, np.round(TRUE.simulate(u) / 0.2) * 0.2))
    assert coarse.right
    assert "steps of the sensor, 0.20 mm" in coarse.verdict
    # a loop that the sensor does show is found all the same
    assert "hysteresis" in check(LINE, recording(u, np.round(TRUE.simulate(u) / 0.2) * 0.2)).verdict


def test_errors_ahead_are_those_of_the_model_with_noise_where_it_has_one() -> None:
    u = cycles(3000)
    model = TransferFunction(
        numerator=(0.0, 0.2),
        denominator=(-0.9,),
        noise_denominator=(-0.9,),
        sample_time=STEP,
        initial="first_sample",
    )
    y = model.simulate(u, sample_time=STEP) + lfilter([0.1], [1, -0.9], noise(u.size, 0.0, 0))
    ahead = {one.samples: one for one in check(model, recording(u, y)).outputs[0].ahead}
    assert ahead[1].rmse == pytest.approx(0.1, rel=0.05)
    assert ahead[None].rmse == pytest.approx(0.1 / np.sqrt(1 - 0.81), rel=0.2)
    assert "noise model" in ahead[1].how
    assert "free run" in ahead[None].how


def test_what_is_found_is_json_and_a_picture() -> None:
    found = check(TRUE, run(TRUE, 600))
    told = json.loads(to_json(found.to_dict()))
    assert told["verdict"] == found.verdict
    assert told["outputs"][0]["p_branch"] == found.outputs[0].p_branch
    axes = found.plot()
    assert len(axes) == 4
    assert all(axis.has_data() for axis in axes)
    with pytest.raises(DataError, match="no such output"):
        found.plot(output="force")
    with pytest.raises(DataError, match="four axes"):
        found.plot(list(axes)[:2])


def test_thinned_data_that_jump_are_checked_too() -> None:
    for seed in range(10):
        u = np.random.default_rng(seed).uniform(0, 5, 500)
        y = TRUE.simulate(u)
        assert check(TRUE, recording(u, y + 0.1 * noise(u.size, 0.0, seed))).right
        assert not check(LINE, recording(u, y + 0.1 * noise(u.size, 0.0, seed))).right


def test_bad_input_is_told_with_a_remedy() -> None:
    good = run(TRUE, 600)
    still = np.full(600, 2.0)
    cases: list[tuple[list[Recording], str]] = [
        ([], "no recording"),
        ([good.select(["pressure"])], "lacks it.*--column displacement"),
        ([recording(cycles(20), cycles(20))], "20 samples are too few.*record at least 60"),
        (
            [good, recording(cycles(5), cycles(5))],
            "5 samples are too few.*leave this recording out",
        ),
        ([recording(still, good["displacement"])], "the input is constant.*record while it moves"),
        ([recording(good["pressure"], still)], "stuck.*--column"),
        ([good, Recording(dict(good.channels), 0.05)], "0.02 s and 0.05 s.*--resample"),
        ([good, Recording(dict(good.channels))], "0.02 s and without time"),
        ([Recording(dict(good.channels), STEP, {"displacement": "mm"} | {"pressure": "bar"})], ""),
    ]
    for recordings, said in cases:
        if said:
            with pytest.raises(DataError, match=said):
                check(TRUE, recordings)
        else:
            check(TRUE, recordings)


def test_a_model_that_runs_away_is_told() -> None:
    unstable = TransferFunction(
        numerator=(0.0, 1.0), denominator=(-3.0,), sample_time=STEP, initial="first_sample"
    )
    with pytest.raises(ModelError, match="Remedy"):
        check(unstable, run(TRUE, 3000))


def test_a_fit_to_the_very_recording_is_not_accused() -> None:
    for seed in range(15):
        measured = run(TRUE, 2000, seed)
        assert check(PIEstimator(n_operators=8).fit(measured).model_, measured).right


def test_the_face_has_it() -> None:
    assert mckibben.check is check


def test_recordings_without_time_and_of_one_rise_are_checked() -> None:
    u = np.linspace(0, 5, 1000)
    untimed = Recording(
        {"pressure": u, "displacement": TRUE.simulate(u) + 0.1 * noise(1000, 0.0, 1)}
    )
    found = check(TRUE, untimed)
    assert found.right
    assert found.outputs[0].ahead[0].seconds is None


def test_a_run_too_short_beside_the_others_is_said_to_be_left_out() -> None:
    short = run(TRUE, 12, 2).with_meta(name="scrap")
    found = check(TRUE, [run(TRUE, 5000, 1), short])
    assert found.right
    assert "left out of most: scrap" in found.notes[0]
