"""Signals that drive rigs: their laws, their bands, and making them by name."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mckibben import DataError, ModelError
from mckibben.registry import names
from mckibben.signals import binary_steps, build, settings_of
from mckibben.signals.steps import REGISTER_BITS
from tests.refusals import refused

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
    with refused(ModelError, names="'cosine'"):
        build("cosine", TIME)
    for name, setting, settings in (
        ("sine", "tempo", {"tempo": 1, "period": 1, "peaks": 1}),
        ("sine", "peaks", {"period": 1}),
        ("decaying-sine", "n_cycles", {"period": 1, "high": 2, "n_cycles": "two"}),
        ("decaying-sine", "n_cycles", {"period": 1, "high": 2, "n_cycles": 0}),
        ("chirp", "law", SETTINGS["chirp"] | {"law": "quadratic"}),
        ("random-wave", "min_frequency", SETTINGS["random-wave"] | {"min_frequency": 3}),
        ("multisine", "max_frequency", SETTINGS["multisine"] | {"period": 1, "max_frequency": 0.5}),
        ("binary-steps", "ramp", SETTINGS["binary-steps"] | {"hold": 1, "ramp": 1}),
        ("pulls", "duration", SETTINGS["pulls"] | {"n_pulls": 3, "duration": 30}),
        ("pulls", "n_pulls", SETTINGS["pulls"] | {"n_pulls": 0}),
        ("sine", "period", {"period": 0.0, "peaks": 1.0}),
        ("sine", "peaks", {"period": 1.0, "peaks": ()}),
        ("irregular-triangle", "n_turns", SETTINGS["irregular-triangle"] | {"n_turns": 0}),
        ("irregular-triangle", "high", {"n_turns": 3, "high": 1.0, "low": 2.0, "seed": 0}),
        ("staircase", "levels", {"levels": (), "hold": 1.0}),
        ("staircase", "hold", {"levels": (1.0,), "hold": 0.0}),
        ("staircase", "ramp", {"levels": (1.0,), "hold": 1.0, "ramp": -1.0}),
        ("random-wave", "high", {"max_frequency": 1.0, "high": 0.0, "seed": 0}),
        ("ramps", "instants", {"instants": (1.0, 0.0), "values": (1.0, 2.0)}),
        ("ramps", "instants", {"instants": (0.0,), "values": (1.0, 2.0)}),
    ):
        with refused(DataError, parameter=f"{name}:{setting}"):
            build(name, TIME, **settings)
    with pytest.raises(DataError):  # before it begins
        build("triangle", TIME - 1.0, **SETTINGS["triangle"])


def test_binary_steps_are_a_maximum_length_sequence() -> None:
    period = 2**REGISTER_BITS - 1
    bits = binary_steps(np.arange(2 * period) + 0.5, 1.0, seed=3)
    assert np.array_equal(bits[:period], bits[period:])
    assert bits[:period].sum() == (period + 1) / 2  # one more high than low
    signs = 2 * bits[:period] - 1
    other = np.fft.ifft(np.abs(np.fft.fft(signs)) ** 2).real
    assert other[1:] == pytest.approx(-1.0, abs=1e-6)
