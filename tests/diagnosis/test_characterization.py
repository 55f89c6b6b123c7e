"""Characterization against loops whose every number is known, and under noise."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from mckibben import PI, DataError, Recording
from mckibben.diagnosis.characterization import characterize
from mckibben.signals import irregular_triangle, sine, staircase, triangle
from tests.refusals import refused

Array = NDArray[np.float64]

STEP = 0.01
TIME = np.arange(10_001) * STEP
RAMP: Array = np.arange(50, dtype=float)


def run(u: Array, y: Array, step: float | None = STEP) -> Recording:
    """Return a recording of pressure and displacement."""
    return Recording({"pressure": u, "displacement": y}, step)


def play(u: Array, radius: float) -> Array:
    """Return a play operator that starts on its lower side."""
    return PI(thresholds=(radius,), weights=(1.0,)).simulate(u)


def noisy(recording: Recording, share: float, seed: int = 0) -> Recording:
    """Return a recording with noise of a share of each channel's range."""
    rng = np.random.default_rng(seed)
    channels = {
        name: x + share * float(np.ptp(x)) * rng.standard_normal(x.size)
        for name, x in recording.channels.items()
    }
    return Recording(channels, recording.sample_time)


def lag(u: Array, seconds: float) -> Array:
    """Return a first-order lag."""
    y = np.empty_like(u)
    y[0] = u[0]
    for i in range(1, u.size):
        y[i] = y[i - 1] + STEP / seconds * (u[i] - y[i - 1])
    return y


def parallelogram(gain: float, gap: float) -> Recording:
    """Return a loop whose branches are straight and a constant gap apart, jumping at the ends."""
    u = triangle(TIME, 20.0, 4.0)
    rising = np.diff(u, append=u[-1] + 1) > 0
    return run(u, gain * u + np.where(rising, 0.0, gap))


@given(st.floats(0.5, 20.0), st.floats(0.01, 2.0))
@settings(max_examples=25)
def test_every_number_of_a_parallelogram(gain: float, gap: float) -> None:
    found = characterize(parallelogram(gain, gap))
    span = 4 * gain + gap
    assert (found.n_cycles, found.n_reversals) == (5, 9)
    assert found.creep is None
    for name, value in {
        "mid_width": gap,
        "loop_width": 100 * gap / span,
        "loop_area": 4 * gap,
        "branch_gap": gap,
        "gain": gain,
        "asymmetry": 0.0,
        "drift": 0.0,
    }.items():
        assert getattr(found, name) == pytest.approx(value, rel=0.01, abs=1e-6), name
    for cycle in found.cycles:
        seen = (cycle.width, cycle.amplitude, cycle.rate)
        assert seen == pytest.approx((100 * gap / span, 4.0, 0.4), rel=0.01)


@given(st.floats(0.1, 0.9), st.sampled_from([0.0, 0.002, 0.01]))
@settings(max_examples=20)
def test_dead_zone_of_a_play_operator_is_twice_its_radius(radius: float, noise: float) -> None:
    u = triangle(TIME, 20.0, 4.0)
    found = characterize(noisy(run(u, play(u, radius)), noise))
    tolerance = 1e-9 if noise == 0 else 4 * noise
    assert found.dead_zone_upper == pytest.approx(2 * radius, abs=tolerance * 4)
    assert found.dead_zone_lower == pytest.approx(2 * radius, abs=tolerance * 4)
    assert found.mid_width == pytest.approx(2 * radius, abs=1e-9 + 4 * noise)


@pytest.mark.parametrize("noise", [0.0, 0.003, 0.01])
@pytest.mark.parametrize("seed", range(2))
def test_prandtl_ishlinskii_loops_are_symmetric(noise: float, seed: int) -> None:
    model = PI(thresholds=(0.0, 0.2, 0.5, 1.0), weights=(3.0, 2.0, 1.0, 1.0))
    u = np.concatenate(
        [triangle(TIME[:4000], 10.0, 5.0), irregular_triangle(TIME, 60, 5.0, seed=seed)]
    )
    found = characterize(noisy(run(u, model.simulate(u)), noise, seed))
    assert found.asymmetry == pytest.approx(0, abs=0.5 + 30 * noise)


RISING = np.diff(triangle(TIME, 20.0, 4.0), append=0.1) > 0


@pytest.mark.parametrize(
    ("bent", "expected"),
    [
        (lambda u: u + 0.0025 * TIME, {"drift": 0.05, "gain": 1.0}),
        # the centroid of a triangle lies at two thirds of its height
        (lambda u: u + np.where(RISING, 0.0, 0.3 * u), {"width_centroid": 1 / 3, "gain": 1.15}),
    ],
)
def test_figures_of_bent_lines(bent: Callable[[Array], Array], expected: dict[str, float]) -> None:
    u = triangle(TIME, 20.0, 4.0)
    found = characterize(run(u, bent(u)))
    assert {name: getattr(found, name) for name in expected} == pytest.approx(expected, abs=0.1)


@pytest.mark.parametrize("noise", [0.0, 0.002])
def test_creep_in_holds(noise: float) -> None:
    u = staircase(TIME, [0.0, 1, 2, 3, 4, 3, 2, 1, 0, 1], hold=9.5, ramp=0.5)
    y = 5 * u + 0.5 * lag(u, 3.0)
    found = characterize(noisy(run(u, y), noise))
    # An exponential that starts in the ramp, between the middles of the second tenth and the last.
    held, tau, ramp = 9.5, 3.0, 0.5
    start = 0.5 * tau / ramp * (1 - np.exp(-ramp / tau))
    expected = start * (np.exp(-0.15 * held / tau) - np.exp(-0.95 * held / tau))
    assert found.creep == pytest.approx(expected, rel=0.1)
    assert found.creep_time == pytest.approx(0.8 * held, rel=0.05)
    back = characterize(run(u, -5 * u + 0.5 * lag(u, 3.0))).creep
    assert back == pytest.approx(-expected, rel=0.1)


def test_dependence_on_rate() -> None:
    u = np.concatenate([sine(TIME[:4000], 20.0, 4.0), sine(TIME[:1001], 5.0, 4.0)])
    fast = characterize(run(u, lag(u, 0.3)))
    assert fast.intervals["rate_dependence"][0] > 5
    # The width of a lag is near 2 sin(phase), and the phase grows with the frequency.
    assert fast.rate_dependence == pytest.approx((33.5 - 9.4) / 2, rel=0.1)
    same = characterize(run(u, play(u, 0.3)))
    assert same.rate_dependence == pytest.approx(0.0, abs=1.0)
    assert same.speeds == pytest.approx((0.4, 1.6), rel=0.05)


def test_without_time_what_needs_time_is_none_and_the_rest_is_the_same() -> None:
    u = triangle(TIME, 10.0, 5.0)
    timed, found = (characterize(run(u, play(u, 0.3), step)) for step in (STEP, None))
    assert found.duration is found.sample_time is found.creep is found.rate_dependence is None
    assert [cycle.rate for cycle in found.cycles] == [None] * 10
    assert (found.loop_width, found.drift) == (timed.loop_width, timed.drift)


def test_an_output_that_falls_with_the_input() -> None:
    u = triangle(TIME, 10.0, 5.0)
    up, down = characterize(run(u, play(u, 0.3))), characterize(run(u, -play(u, 0.3)))
    for name in ("loop_width", "asymmetry", "dead_zone_upper", "dead_zone_lower", "branch_gap"):
        assert getattr(down, name) == pytest.approx(getattr(up, name))
    assert down.falls
    assert down.gain == pytest.approx(-1.0)


@given(st.integers(0, 50))
@settings(max_examples=10)
def test_noise_moves_nothing_much(seed: int) -> None:
    u = triangle(TIME, 20.0, 4.0)
    model = PI(thresholds=(0.0, 0.3, 0.8), weights=(3.0, 2.0, 1.0))
    clean = characterize(run(u, model.simulate(u)))
    found = characterize(noisy(run(u, model.simulate(u)), 0.01, seed))
    assert found.n_reversals == clean.n_reversals
    assert found.input_noise == pytest.approx(0.04, rel=0.15)
    assert found.loop_width == pytest.approx(clean.loop_width, abs=1.5)
    assert found.gain == pytest.approx(clean.gain, rel=0.05)
    assert found.loop_area_share == pytest.approx(clean.loop_area_share, abs=1.5)


@pytest.mark.parametrize("seed", range(2))
def test_where_noise_would_hide_a_loop_none_is_denied(seed: int) -> None:
    u = triangle(TIME[:1201:10], 6.0, 4.0)
    found = characterize(noisy(run(u, u, 10 * STEP), 0.1, seed))
    assert found.has_loop is None
    low, high = found.intervals["branch_gap"]
    assert low < 0 < high
    assert found.loop_width is None


@pytest.mark.parametrize(
    ("recordings", "fields"),
    [
        ([], {"parameter": "recordings"}),
        (run(np.zeros(50), RAMP), {"channel": "pressure"}),
        (run(RAMP, np.ones(50)), {"channel": "displacement"}),
        (run(RAMP, 1e-300 * RAMP), {"channel": "displacement"}),
        (run(RAMP[:5], RAMP[:5]), {"channel": "pressure"}),
        (Recording({"pressure": RAMP}), {"channel": "displacement"}),
    ],
)
def test_what_cannot_be_characterized_is_refused(
    recordings: Recording | list[Recording], fields: dict[str, Any]
) -> None:
    with refused(DataError, **fields):
        characterize(recordings)


def test_a_load_that_follows_from_the_motion_hides_no_loop() -> None:
    pressure = triangle(np.arange(1201) / 100, period=4.0, peaks=4.0)
    moved = pressure - 0.5 * np.sign(np.gradient(pressure))
    noise = np.random.default_rng(0).normal(0.0, 0.1, moved.size)
    alone = Recording({"pressure": pressure, "displacement": moved}, 0.01)
    spring = alone.with_channels({"force": "N"}, force=20.0 + 2.0 * moved + noise)
    found = characterize(spring, "pressure", "displacement")
    assert found.mid_width == pytest.approx(characterize(alone).mid_width)
    assert found.notes


def test_units_must_agree() -> None:
    runs = [Recording({"a": RAMP, "b": RAMP}, 1.0, {"a": unit}) for unit in ("rad", "deg")]
    with refused(DataError, channel="a", names="deg"):
        characterize(runs, "a", "b")


@given(
    st.integers(10, 60).flatmap(
        lambda n: st.tuples(*(st.lists(st.integers(-9, 9), min_size=n, max_size=n),) * 2)
    )
)
def test_any_recording_is_described_or_refused(channels: tuple[list[int], list[int]]) -> None:
    u, y = (np.array(channel, dtype=float) for channel in channels)
    try:
        found = characterize(run(u, y))
    except DataError:
        assert min(np.ptp(u), np.ptp(y)) == 0
        return
    json.dumps(found.to_dict(), allow_nan=False)


@pytest.mark.parametrize("periods", [1, 2, 5])
@pytest.mark.parametrize("noise", [0.0, 0.003])
def test_a_closed_loop_has_one_width_wherever_its_record_begins(periods: int, noise: float) -> None:
    n = 1000 * periods
    phase = 2 * np.pi * np.arange(2 * n) * periods / n
    u = 2.5 - 2.5 * np.cos(phase)
    y = PI(thresholds=(0.0, 0.4), weights=(1.0, 2.0)).simulate(u)[n:]  # it is periodic by then
    once = noisy(run(u[:n], y), noise)
    first = characterize(once)
    for shift in (1, 137, 500, 503, 862):
        rolled = {name: np.roll(x, shift) for name, x in once.channels.items()}
        found = characterize(Recording(rolled, STEP))
        for name in ("loop_width", "asymmetry", "loop_area", "branch_gap"):
            value = getattr(first, name)
            assert getattr(found, name) == pytest.approx(value, rel=0.001 + 4 * noise), name
        assert found.n_cycles == periods


@pytest.mark.parametrize("codes", [20, 100, 500])
def test_a_coarse_sensor_sees_the_loop(codes: int) -> None:
    u = sine(TIME, 20.0, 5.0)
    y = play(u, 0.15)
    step = np.ptp(y) / codes
    found = characterize(run(u, step * np.round(y / step)))
    assert found.has_loop
    assert found.loop_width == pytest.approx(100 * 0.3 / 4.7, abs=40 / codes)


def damper(seed: int, switch: float) -> Recording:
    """Return a force that follows the sign of speed, over wandering strokes."""
    rng = np.random.default_rng(seed)
    size = np.interp(TIME, np.arange(0, 102, 2), rng.uniform(3, 9, 51))
    x = 8 + size * np.sin(2 * np.pi * 0.3 * TIME)
    force = 800 * np.tanh(np.gradient(x, STEP) / switch) + 95 + 5 * rng.standard_normal(x.size)
    return Recording({"displacement": x, "force": force}, STEP)


def wandering(kind: str, seed: int) -> Array:
    """Return noise of a kind, of unit size."""
    white = np.random.default_rng(seed).standard_normal(4000)
    slow = lag(white, 3.0)
    return {
        "white": white,
        "slow": slow / slow.std(),
        "random walk": np.cumsum(white) / 60,
        "drift": np.linspace(0, 5, 4000) + 0.1 * white,
    }[kind]


@pytest.mark.parametrize("kind", ["white", "slow", "random walk", "drift"])
def test_noise_that_wanders_and_drift_are_no_loop(kind: str) -> None:
    """Of 60 recordings at a level of 1 %, four or more have a probability of 0.3 %."""
    looped = 0
    for seed in range(60):
        u = triangle(TIME[:4000], 40 / (3 + seed % 4), 5.0)
        looped += (
            characterize(run(u, u + 0.05 * u**2 + 0.2 * wandering(kind, seed))).has_loop is True
        )
    assert looped < 4
