"""Signals that drive rigs: their laws, their bands, and making them by name."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mckibben import DataError, ModelError
from mckibben.registry import names
from mckibben.signals import (
    binary_steps,
    build,
    chirp,
    decaying_sine,
    decaying_triangle,
    multisine,
    progressive_sine,
    progressive_triangle,
    pulls,
    random_steps,
    random_wave,
    settings_of,
)
from mckibben.signals.steps import REGISTER_BITS

TIME = np.arange(6000) / 100
SETTINGS: dict[str, dict[str, Any]] = {
    "binary-steps": {"high": 5.0, "low": 1.0, "hold": 0.7, "ramp": 0.2},
    "chirp": {"start_frequency": 0.1, "end_frequency": 2.0, "high": 5.0, "low": 1.0},
    "constant": {"value": 3.0},
    "decaying-sine": {"period": 7.0, "high": 5.0, "low": 1.0},
    "decaying-triangle": {"period": 7.0, "high": 5.0, "low": 1.0},
    "irregular-triangle": {"n_turns": 9, "high": 5.0, "low": 1.0, "seed": 0},
    "multisine": {"period": 10.0, "max_frequency": 1.0, "high": 5.0, "low": 1.0},
    "progressive-sine": {"period": 7.0, "high": 5.0, "low": 1.0},
    "progressive-triangle": {"period": 7.0, "high": 5.0, "low": 1.0},
    "pulls": {"high": 5.0, "low": 1.0},
    "ramps": {"instants": (5.0, 50.0), "values": (1.0, 5.0)},
    "random-steps": {"high": 5.0, "low": 1.0, "seed": 0},
    "random-wave": {"max_frequency": 1.0, "high": 5.0, "low": 1.0, "seed": 0},
    "sine": {"period": 7.0, "peaks": 5.0, "low": 1.0},
    "staircase": {"levels": (1.0, 5.0, 2.0), "hold": 3.0},
    "triangle": {"period": 7.0, "peaks": 5.0, "low": 1.0},
}


def test_every_signal_is_tried_here() -> None:
    assert set(SETTINGS) == set(names("signals"))


@pytest.mark.parametrize("name", names("signals"))
def test_a_signal_stays_within_its_limits_and_is_repeatable(name: str) -> None:
    wave = build(name, TIME, **SETTINGS[name])
    assert wave.shape == TIME.shape
    assert np.isfinite(wave).all()
    assert 1.0 - 1e-12 <= wave.min() <= wave.max() <= 5.0 + 1e-12
    assert np.array_equal(wave, build(name, TIME, **SETTINGS[name]))


@pytest.mark.parametrize("name", names("signals"))
def test_words_make_the_signal_that_numbers_make(name: str) -> None:
    words = {
        key: "/".join(map(str, value)) if isinstance(value, tuple) else str(value)
        for key, value in SETTINGS[name].items()
    }
    assert np.array_equal(build(name, TIME, **words), build(name, TIME, **SETTINGS[name]))


@pytest.mark.parametrize("name", names("signals"))
def test_numbers_seeds_and_times_that_are_none_are_refused(name: str) -> None:
    settings = settings_of(name)
    wrong: dict[str, tuple[str, ...]] = {
        key: ("nan", "inf", "-inf") for key, (kind, _) in settings.items() if kind == "number"
    }
    if "seed" in settings and name != "multisine":
        wrong["seed"] = ("-1",)
    for key, values in wrong.items():
        for value in values:
            with pytest.raises(DataError):
                build(name, TIME, **{**SETTINGS[name], key: value})
    for time in ([], [0.0, np.nan], [[0.0, 1.0]]):
        with pytest.raises(DataError):
            build(name, time, **SETTINGS[name])


def test_settings_are_listed_and_checked() -> None:
    assert settings_of("chirp")["law"] == ("linear or logarithmic", "linear")
    assert settings_of("sine")["period"] == ("number", None)
    assert settings_of("staircase")["levels"] == ("numbers joined by /", None)
    with pytest.raises(ModelError, match="'cosine'"):
        build("cosine", TIME)
    for name, about, settings in (
        ("sine", r"'tempo'.*period", {"tempo": 1, "period": 1, "peaks": 1}),
        ("sine", "'peaks'", {"period": 1}),
        ("decaying-sine", "n_cycles='two'", {"period": 1, "high": 2, "n_cycles": "two"}),
        ("decaying-sine", "0", {"period": 1, "high": 2, "n_cycles": 0}),
        ("chirp", "'quadratic'", SETTINGS["chirp"] | {"law": "quadratic"}),
        ("random-wave", "min_frequency 3", SETTINGS["random-wave"] | {"min_frequency": 3}),
        ("multisine", "0 harmonics", SETTINGS["multisine"] | {"period": 1, "max_frequency": 0.5}),
        ("binary-steps", "ramp", SETTINGS["binary-steps"] | {"hold": 1, "ramp": 1}),
        ("random-steps", "longest", SETTINGS["random-steps"] | {"shortest": 3, "longest": 1}),
        ("pulls", "3", SETTINGS["pulls"] | {"n_pulls": 3, "duration": 30}),
        ("pulls", "0 pulls", SETTINGS["pulls"] | {"n_pulls": 0}),
        ("ramps", "instants|points", {"instants": (1.0, 0.0), "values": (1.0, 2.0)}),
        ("ramps", "instants|points", {"instants": (0.0,), "values": (1.0, 2.0)}),
    ):
        with pytest.raises(DataError, match=about):
            build(name, TIME, **settings)


@given(st.integers(1, 12), st.floats(-2, 2), st.floats(0.1, 5))
def test_amplitudes_grow_and_fall_evenly(n: int, low: float, span: float) -> None:
    time = np.arange(n) + 0.5
    rising = low + span * np.arange(1, n + 1) / n
    for wave in (progressive_sine, progressive_triangle):
        assert wave(time, 1.0, low + span, low, n) == pytest.approx(rising, abs=1e-9)
    for wave in (decaying_sine, decaying_triangle):
        assert wave(time, 1.0, low + span, low, n) == pytest.approx(rising[::-1], abs=1e-9)


def spectrum(wave: np.ndarray, rate: float) -> tuple[np.ndarray, np.ndarray]:
    power = np.abs(np.fft.rfft((wave - wave.mean()) * np.hanning(wave.size))) ** 2
    return np.fft.rfftfreq(wave.size, 1 / rate), power / power.sum()


def test_a_random_wave_keeps_to_its_band() -> None:
    time = np.arange(20_000) / 50
    wave = random_wave(time, 2.0, 5.0, min_frequency=0.5, seed=1)
    frequency, power = spectrum(wave, 50)
    within = (frequency > 0.48) & (frequency < 2.02)
    assert power[within].sum() > 0.9999
    halves = power[within & (frequency < 1.25)].sum() / power[within].sum()
    assert 0.25 < halves < 0.75


@pytest.mark.parametrize("phases", ["low-crest", "random"])
def test_a_multisine_has_all_harmonics_equally_strong(phases: Any) -> None:
    time = np.arange(2000) / 100
    wave = multisine(time, 10.0, 2.0, 5.0, 1.0, phases=phases)
    assert wave[:1000] == pytest.approx(wave[1000:], abs=1e-9)
    lines = np.abs(np.fft.rfft(wave[:1000] - wave[:1000].mean()))
    assert lines[1:21] == pytest.approx(lines[1], rel=1e-6)
    assert lines[21:].max() < 1e-6 * lines[1]


def test_low_crest_phases_lower_the_crest() -> None:
    time = np.arange(1000) / 100
    spread = [
        np.std(multisine(time, 10.0, 3.0, 1.0, -1.0, phases="random", seed=i)) for i in range(5)
    ]
    assert np.std(multisine(time, 10.0, 3.0, 1.0, -1.0)) > max(spread)


@pytest.mark.parametrize("law", ["linear", "logarithmic"])
def test_a_chirp_has_the_frequency_of_its_law(law: Any) -> None:
    time = np.arange(0, 40.0, 1e-3)
    wave = chirp(time, 0.2, 3.2, 1.0, -1.0, law=law)
    assert wave[0] == -1.0
    rising = np.flatnonzero((wave[1:] >= 0) & (wave[:-1] < 0))
    found = 1 / np.diff(time[rising])
    middle = 0.5 * (time[rising][1:] + time[rising][:-1]) / time[-1]
    expected = 0.2 + 3.0 * middle if law == "linear" else 0.2 * 16.0**middle
    assert found == pytest.approx(expected, rel=0.05)


def test_binary_steps_are_a_maximum_length_sequence() -> None:
    period = 2**REGISTER_BITS - 1
    bits = binary_steps(np.arange(2 * period) + 0.5, 1.0, seed=3)
    assert np.array_equal(bits[:period], bits[period:])
    assert bits[:period].sum() == (period + 1) / 2  # one more high than low
    signs = 2 * bits[:period] - 1
    other = np.fft.ifft(np.abs(np.fft.fft(signs)) ** 2).real
    assert other[1:] == pytest.approx(-1.0, abs=1e-6)


def test_steps_can_take_their_time() -> None:
    time = np.arange(0, 50, 0.01)
    for wave in (
        binary_steps(time, 4.0, 1.0, hold=2.0, ramp=0.5),
        random_steps(time, 4.0, 1.0, 2.0, 3.0, ramp=0.5, seed=2),
    ):
        assert np.abs(np.diff(wave)).max() <= 3.0 * 0.01 / 0.5 + 1e-9
        assert np.ptp(wave) > 1.5


@given(st.integers(0, 50))
def test_random_steps_hold_as_long_as_asked(seed: int) -> None:
    time = np.arange(0, 60, 0.01)
    wave = random_steps(time, 4.0, 1.0, 2.0, 3.0, seed=seed)
    assert wave[0] == 1.0
    holds = np.diff(np.flatnonzero(np.diff(wave))) * 0.01
    assert holds.min() >= 2.0 - 0.011
    assert holds.max() <= 3.0 + 0.011


def test_pulls_come_and_go() -> None:
    wave = pulls(TIME, 100.0, n_pulls=3, duration=9.0)
    assert wave[0] == wave[-1] == 0.0
    assert [wave[i : i + 2000].max() for i in (0, 2000, 4000)] == pytest.approx([100.0] * 3)
    assert np.count_nonzero(wave > 0) == pytest.approx(2700, abs=10)
    assert np.abs(np.diff(wave)).max() < 1.0
