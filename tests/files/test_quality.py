"""Impossible values, codes for missing samples, wraps, outliers, units; the condition of signals."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mckibben
from mckibben import DataError, DataWarning, Recording
from mckibben.files.condition import condition, early, lag
from mckibben.registry import load

N = 400
T = np.arange(N) / 50
P = 2.5 - 2.5 * np.cos(2 * np.pi * T / 4)
Y = 6 * P + 2

Put = Callable[..., Path]


@pytest.fixture
def put(tmp_path: Path) -> Put:
    """Write a file of three columns and return its path."""

    def write(header: str, *columns: Sequence[Any], rows: Sequence[str] = ()) -> Path:
        path = tmp_path / "run.csv"
        lines = (",".join(f"{x:.10g}" for x in row) for row in zip(*columns, strict=True))
        path.write_text("\n".join([header, *rows, *lines]) + "\n")
        return path

    return write


def refused(path: Path, **options: Any) -> DataError:
    with pytest.raises(DataError) as caught:
        one(path, **options)
    assert caught.value.remedy
    return caught.value


def one(path: Path, **options: Any) -> Recording:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)
        (recording,) = mckibben.read(path, **options)
    return recording


@pytest.mark.parametrize(
    ("header", "columns", "channel", "unit", "gain"),
    [
        ("t_s,pressure_bar,x_mm", (T, 100 * P, Y), "pressure", "kPa", 1.0),
        ("t_s,pressure_MPa,x_mm", (T, 100 * P, Y), "pressure", "kPa", 1.0),
        ("t_s,pressure_bar,displacement_mm", (T, P, 1e3 * Y), "displacement", "um", 1.0),
        ("t_s,pressure_bar,force_N", (T, P, 1e6 * Y), "force", "mN", 1e3),
    ],
)
def test_impossible_values_are_refused_and_the_proposed_unit_is_read(
    put: Put, header: str, columns: Any, channel: str, unit: str, gain: float
) -> None:
    path = put(header, *columns)
    error = refused(path)
    assert error.channel == channel
    assert error.row is not None
    assert f"--unit {channel}={unit}" in error.remedy
    right = P if channel == "pressure" else Y
    assert one(path, units={channel: unit})[channel] == pytest.approx(gain * right)


@pytest.mark.parametrize("header", ["time,pressure_bar,x_mm", "Time,p_bar,x_mm"])
def test_steps_of_many_seconds_ask_for_the_unit(put: Put, header: str) -> None:
    path = put(header, 20 * np.arange(N), P, Y)
    assert refused(path).channel == "time"
    assert one(path, units={"time": "ms"}).sample_time == pytest.approx(0.02)
    assert one(path, units={"time": "s"}).sample_time == 20


@pytest.mark.parametrize("code", [-9999.0, 99999.0, 32767.0, 9.91e37, -9.9e37])
@pytest.mark.parametrize("length", [1, 3, 40])
def test_codes_are_missing_samples(put: Put, code: float, length: int) -> None:
    y = Y.copy()
    y[100 : 100 + length] = code
    path = put("t_s,pressure_bar,displacement_mm", T, P, y)
    error = refused(path)
    assert (error.channel, error.row) == ("displacement", 102)
    recording = one(path, gaps="interpolate")
    assert recording["displacement"].max() == Y.max()
    assert recording.bridged.nonzero()[0].tolist() == list(range(100, 100 + length))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)
        assert len(mckibben.read(path, gaps="split")) == 2


@pytest.mark.filterwarnings("ignore::mckibben.DataWarning")
def test_zeros_are_codes_only_where_other_samples_exclude_them(put: Put) -> None:
    dropped = Y + 40
    dropped[[50, 51, 200, 201, 202]] = 0.0
    assert refused(put("t_s,p_bar,length_mm", T, P, dropped)).row == 52
    steps = 2.0 * ((np.arange(N) // 50) % 2) + (np.arange(N) // 100)
    switched = np.where(T % 2 < 1, 0.0, 9999.0)
    for legitimate in (steps, np.maximum(P - 2.0, 0.0), np.where(T < 1, 0.0, Y), switched):
        assert len(one(put("t_s,p_bar,displacement_mm", T, P, legitimate))) == N


@pytest.mark.parametrize("size", [2**8, 2**16])
def test_wraps_of_counters_are_refused(put: Put, size: int) -> None:
    counts = np.rint(Y / 30 * 2.5 * size)
    path = put("t_s,p_bar,displacement_um", T, P, counts % size)
    assert refused(path).channel == "displacement"
    assert len(one(path, gaps="raw")) == N
    assert len(one(put("t_s,p_bar,displacement_um", T, P, np.minimum(counts, size - 1)))) == N
    about_zero = np.where(T < 7, np.arange(N) % 3 - 1, T > 7.9) % size
    assert refused(put("t_s,p_bar,displacement_um", T, P, about_zero)).channel == "displacement"
    valve = np.where(T % 2 < 1, size - 1, 0)
    assert len(one(put("t_s,displacement_um,valve", T, counts / size, valve))) == N


def test_a_time_counter_that_wraps_goes_on(put: Put) -> None:
    ticks = (65000 + 20 * np.arange(N)) % 2**16
    recording = one(put("time_ms,pressure_bar,x_mm", ticks, P, Y))
    assert recording.sample_time == pytest.approx(0.02)
    assert recording.duration == pytest.approx(0.02 * (N - 1))


@pytest.mark.parametrize("length", [1, 3])
def test_outliers_are_noted(put: Put, length: int) -> None:
    y = Y.copy()
    y[100 : 100 + length] = 100.0
    path = put("t_s,pressure_bar,displacement_mm", T, P, y)
    with pytest.warns(DataWarning, match="row 102"):
        mckibben.read(path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        y[100 : 100 + 4] = 100.0  # lasts, and so was measured
        mckibben.read(put("t_s,pressure_bar,displacement_mm", T, P, y))


@pytest.mark.parametrize(
    ("row", "toml"), [("s,kPa,mm", ""), ("", '[channels.pressure]\nunit="kPa"\n')]
)
def test_units_that_contradict_each_other_are_refused(put: Put, row: str, toml: str) -> None:
    path = put("t_s,pressure_bar,displacement_mm", T, P, Y, rows=[row] if row else [])
    if toml:
        path.with_name("channels.toml").write_text(toml)
    assert refused(path).channel == "pressure"
    assert one(path, units={"pressure": "bar"})["pressure"] == pytest.approx(P)


@pytest.mark.parametrize("unit", ["bara", "psia", "kPa abs", "bar(a)"])
def test_absolute_pressure_is_noted_and_never_mixed(put: Put, unit: str) -> None:
    with pytest.warns(DataWarning, match="absolute"):
        (absolute,) = mckibben.read(put(f"t_s,p [{unit}],displacement_mm", T, P + 1, Y))
    assert absolute.meta["pressure_reference"] == {"pressure": "absolute"}
    gauge = one(put("t_s,p [barg],displacement_mm", T, P, Y))
    assert gauge.meta["pressure_reference"] == {"pressure": "gauge"}
    with pytest.raises(DataError) as caught:
        mckibben.compare(absolute, gauge, models=["pi"], jobs=1)
    assert caught.value.channel == "pressure"


def test_what_is_calibrated_again_is_neither_absolute_nor_calibrated_twice(put: Put) -> None:
    path = put("t_s,p [bara],displacement_mm", T, P + 1, Y)
    again = path.with_name("again.csv")
    mckibben.write(one(path, calibration={"displacement": (2.0, 0.0)}), again)
    found = one(again, calibration={"pressure": (1.0, -1.0)}, units={"pressure": "bar"})
    assert found["pressure"] == pytest.approx(P)
    assert "pressure" not in found.meta["pressure_reference"]
    assert set(found.meta["calibration"]) == {"pressure", "displacement"}


def test_flaws_of_columns_not_asked_for_do_not_matter(put: Put) -> None:
    path = put(
        "t_s,pressure_bar,displacement_mm,force_parsec,force 2_N,force_2_N", T, P, Y, P, P, P
    )
    assert refused(path).channel in ("force", "force_2")
    asked = one(path, columns={"pressure": "pressure", "displacement": "displacement"})
    assert {"pressure", "displacement"} <= set(asked.channels)
    assert asked["displacement"].tolist() == pytest.approx(Y)


def test_bridged_samples_are_not_fitted(put: Put) -> None:
    y = Y.copy()
    y[150:190] = np.nan
    path = put("t_s,pressure_bar,displacement_mm", T, P, y)
    recording = one(path, gaps="interpolate")
    wrong = recording.with_channels(displacement=np.where(recording.bridged, 99.0, Y))
    block = load("estimators", "pi")().fit(wrong.slice(20, N)).model_
    assert block.simulate(recording)["displacement"][-50:] == pytest.approx(Y[-50:], abs=0.1)


@pytest.mark.parametrize(
    "header",
    [
        *("displacement_cm_filtered", "displacement cm 1", "displacement_ft_1", "displacement_adc"),
        *("displacement_raw", "displacement_x_inc"),
    ],
)
def test_a_unit_within_a_header_is_never_replaced_by_the_default(put: Put, header: str) -> None:
    path = put(f"t_s,pressure_bar,{header}", T, P, Y)
    columns = {"displacement": header}
    assert refused(path, columns=columns).channel == "displacement"
    assert one(path, columns=columns, units={"displacement": "cm"})["displacement"].max() > 300


@pytest.mark.parametrize(
    ("header", "largest"),
    [("pressure", 40.0), ("angle", 85.0), ("contraction", 22.0), ("displacement", 0.03)],
)
def test_sizes_of_another_unit_are_asked_for(put: Put, header: str, largest: float) -> None:
    path = put(f"t_s,x_mm,{header}", T, Y, largest * P / 5)
    assert header in refused(path).remedy


@pytest.mark.parametrize("rest", [0.0, 3.0])
def test_zeros_that_were_measured_are_read_raw(put: Put, rest: float) -> None:
    on = (np.arange(N) + 25) % 50 < 42
    noise = 0.01 * np.random.default_rng(0).standard_normal((2, N))
    pressure, moved = np.where(on, 4 + noise[0], 0.0), np.where(on, 20.0 + noise[1], rest)
    path = put("t_s,pressure_bar,displacement_mm", T, pressure, moved)
    assert "--gaps raw" in refused(path).remedy
    found = one(path, gaps="raw")
    assert found["pressure"] == pytest.approx(pressure)
    assert found["displacement"] == pytest.approx(moved)


def test_levels_are_no_codes(put: Put) -> None:
    force = np.array([200.0, 500.0, 999.0])[np.arange(N) * 3 // N]
    assert len(one(put("t_s,p_bar,force_gf", T, P, force))) == N
    assert len(one(put("t_s,p_bar,x_mm,status", T, P, Y, np.where(T < 1, 0, 999)))) == N
    within = 400 * P + 20
    within[[70, 150]] = -999.0
    assert refused(put("t_s,pressure_mbar,x_mm", T, within, Y)).row == 72


def test_a_calibration_is_of_the_column_that_is_described(put: Put) -> None:
    path = put("t_s,pressure_bar,displacement_mm", T, P, Y)
    toml = '[channels.pressure]\ncolumn="A0"\ngain=2.5\noffset=-0.5\nunit="bar"\n'
    path.with_name("channels.toml").write_text(toml)
    assert one(path)["pressure"] == pytest.approx(P)


# The condition of signals ------------------------------------------------------------------------


def test_lag_is_that_of_what_was_shifted() -> None:
    rng = np.random.default_rng(1)
    p = np.convolve(rng.standard_normal(900), np.hanning(60), "same")
    for shift in (-20, -3, 0, 5, 40):
        recording = Recording({"pressure": p, "displacement": np.roll(np.tanh(p), shift)}, 0.01)
        assert lag(recording, "pressure", "displacement") == pytest.approx(shift, abs=1)
        assert (early([recording], "pressure", "displacement") is None) == (shift >= 0)
    noise = Recording({"pressure": p, "displacement": rng.standard_normal(900)}, 0.01)
    assert lag(noise, "pressure", "displacement") is None


def test_an_early_output_is_compared_only_where_that_is_allowed() -> None:
    recording = Recording({"pressure": P, "displacement": np.roll(Y, -8)}, 0.02)
    with pytest.raises(DataError) as caught:
        mckibben.compare(recording, models=["pi"], jobs=1)
    assert caught.value.channel == "displacement"
    board = mckibben.compare(recording, models=["pi"], jobs=1, allow_early=True)
    assert board.rows


def test_condition_counts_what_is_saturated_and_stuck() -> None:
    clipped = np.minimum(Y, 20.0)
    assert condition(clipped)["saturated"] == pytest.approx(np.mean(Y >= 20), abs=0.01)
    stuck = Y.copy()
    stuck[110:170] = stuck[110]
    assert condition(stuck)["stuck"] == 60
