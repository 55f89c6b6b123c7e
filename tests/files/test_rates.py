"""Channels that were not sampled together, pieces of a run, and the order of cause and effect."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mckibben
from mckibben import Recording
from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.signals.lags import comes_first, lag, lags
from tests.files.made import one, put, refused, several

STEP = 0.01
T = STEP * np.arange(3000)
RNG = np.random.default_rng(0)
HEADER = "time_s,pressure_bar,displacement_mm"


def pressure(time: Any) -> Array:
    found: Array = 1.5 - 1.5 * np.cos(2 * np.pi * time / 5) * np.exp(-time / 60)
    return found


def play(samples: Array, width: float = 0.3) -> Array:
    state, found = 0.0, []
    for sample in samples:
        state = min(max(state, sample - width), sample + width)
        found.append(5 * state)
    return np.array(found)


P = pressure(T)
Y = play(P)


def test_rows_of_messages_are_put_on_one_grid(tmp_path: Path) -> None:
    lines = [f"{t:.3f},{p:.5f},\n{t + 0.007:.3f},,{y:.5f}" for t, p, y in zip(T, P, Y, strict=True)]
    path = tmp_path / "log.csv"
    path.write_text("\n".join([HEADER, *lines]))
    found = one(path)
    assert found.sample_time == pytest.approx(STEP)
    assert found["displacement"] == pytest.approx(np.interp(found.time, T + 0.007, Y), abs=1e-4)
    assert found["pressure"] == pytest.approx(pressure(found.time), abs=1e-4)


@pytest.mark.parametrize("rows", [3, 10, 3.3])
@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_a_sensor_slower_than_the_logger_is_read_at_its_rate(
    rows: float, noise: float, tmp_path: Path
) -> None:
    renewed = (rows * np.floor(np.arange(T.size) / rows + 1e-9)).astype(int)
    held = (5 * P + noise * RNG.standard_normal(T.size))[renewed]
    found = one(put(tmp_path / "run.csv", HEADER, T, P, held))
    assert found.meta["sampled"]["displacement"] == pytest.approx(1 / (STEP * rows), rel=0.02)
    assert found.sample_time == pytest.approx(STEP * rows, rel=0.02)
    late = 5 * found["pressure"] - found["displacement"]
    assert np.abs(late).max() < 0.2 + 4 * noise  # held, it is wrong by 2 mm


STAIRS = np.repeat(pressure(T[::20]), 20)
ORDINARY: dict[str, tuple[Array, Array]] = {
    "an encoder of few steps": (P, np.rint(Y / 0.5) * 0.5),
    "a triangle and few steps": (np.abs(T % 4 - 2), np.floor(np.abs(T % 4 - 2) / 0.05) * 0.05),
    "a held command": (STAIRS, play(STAIRS)),
    "rests": (np.minimum(P, 1.0), play(np.minimum(P, 1.0))),
    "levels": (np.floor(P / 0.5), np.floor(P / 0.5) * 4 + 0.01 * RNG.standard_normal(T.size)),
}


@pytest.mark.parametrize("case", ORDINARY)
def test_what_holds_for_another_reason_is_read_in_every_row(case: str, tmp_path: Path) -> None:
    found = one(put(tmp_path / "run.csv", HEADER, T, *ORDINARY[case]))
    assert found.n_samples == T.size
    assert "sampled" not in found.meta


def test_a_load_that_is_renewed_slowly_does_not_slow_down_the_others(tmp_path: Path) -> None:
    force = (20 + 3 * P)[np.arange(T.size) // 10 * 10]
    path = put(tmp_path / "run.csv", f"{HEADER},force_N", T, P, Y, force)
    found = one(path)
    assert found.n_samples == T.size
    assert found["force"] == pytest.approx(20 + 3 * P, abs=0.3)
    assert one(path, channels=["pressure", "force"]).sample_time == pytest.approx(10 * STEP)


def test_pieces_of_one_run_are_told_and_joined(tmp_path: Path) -> None:
    cuts = [slice(0, 700), slice(700, 1900), slice(1900, 3000)]
    paths = [
        put(tmp_path / f"{k}.csv", HEADER, T[cut] - k * T[cut][0], P[cut], Y[cut])
        for k, cut in enumerate(cuts)
    ]
    with pytest.warns(mckibben.errors.DataWarning, match="join"):
        assert len(mckibben.read(paths)) == 3
    (whole,) = several(paths, join=True)  # type: ignore[arg-type]
    assert whole["displacement"] == pytest.approx(Y, abs=1e-9)
    assert whole.duration == pytest.approx(T[-1])


def test_runs_from_rest_to_rest_are_no_pieces(
    tmp_path: Path, recwarn: pytest.WarningsRecorder
) -> None:
    cycle = 1.5 - 1.5 * np.cos(2 * np.pi * T / T[-1])
    paths = [put(tmp_path / f"{k}.csv", HEADER, T, cycle, play(cycle)) for k in range(3)]
    mckibben.read(paths)
    assert not recwarn.list


@pytest.mark.parametrize(
    ("gauge_at", "laser_at"),
    [
        ("2026-03-01T12:00:{:09.6f}", "2026-03-01T12:00:{:09.6f}"),
        ("2026-03-01T12:00:{:09.6f}", "12:00:{:09.6f}"),
        ("1772366400 + {:.6f}", "2026-03-01T12:00:{:09.6f}"),
    ],
)
def test_loggers_with_clocks_side_by_side(gauge_at: str, laser_at: str, tmp_path: Path) -> None:
    def stamp(form: str, t: float) -> str:
        whole, plus, _ = form.partition(" + ")
        return f"{int(whole) + t:.6f}" if plus else form.format(t)

    first = [stamp(gauge_at, t) for t in T]
    then = [stamp(laser_at, t + 0.5) for t in T[:2500:4]]
    gauge = put(tmp_path / "gauge.csv", "time,pressure_bar", first, P)
    laser = put(
        tmp_path / "laser.csv", "time,displacement_mm", then, np.interp(T[:2500:4] + 0.5, T, Y)
    )
    (joint,) = several([gauge, laser], join=True)  # type: ignore[arg-type]
    assert joint.sample_time == pytest.approx(4 * STEP)
    times = 0.5 + joint.step * np.arange(len(joint))
    assert joint["pressure"] == pytest.approx(pressure(times), abs=1e-3)
    with pytest.raises(DataError):
        several([gauge, laser], join=True, columns={"force": "F"})  # type: ignore[arg-type]


@pytest.mark.parametrize("lacking", [(0, 0), (300, 0), (0, 50), (300, 50)])
def test_loggers_of_one_motion_agree_wherever_their_samples_begin(
    lacking: tuple[int, int], tmp_path: Path
) -> None:
    """Rows without samples at the beginning are cut off, and shift nothing."""
    paths = []
    for name, every, fewer in zip(
        ("pressure_bar", "displacement_mm"), (1, 4), lacking, strict=True
    ):
        stamps = [f"2026-03-01T12:00:{t:09.6f}" for t in T[::every]]
        samples = ["" if k < fewer else f"{x:.6f}" for k, x in enumerate(P[::every])]
        paths.append(put(tmp_path / f"{name}.csv", f"time,{name}", stamps, samples))
    (joint,) = several(paths, join=True, gaps="interpolate")  # type: ignore[arg-type]
    assert joint["displacement"] == pytest.approx(joint["pressure"], abs=1e-3)
    lost = max(lacking[0], 4 * lacking[1]) * STEP
    assert joint.duration == pytest.approx(T[-1] - lost, abs=8 * STEP)


def test_the_clock_of_one_of_two_loggers_is_shifted_by_hand(tmp_path: Path) -> None:
    laser = put(tmp_path / "b.csv", "time_s,displacement_mm", T[:2500], Y[:2500])
    shifted = one(laser, calibration={"time": (1.0, 0.5)})
    assert shifted.start_time == pytest.approx(0.5)


@pytest.mark.parametrize("shift", [-40, -5, 0, 5, 40])
def test_lags_are_found_with_their_sign(shift: int) -> None:
    wide = pressure(STEP * np.arange(-100, T.size + 100)) + 0.3 * np.sin(
        np.arange(-100, T.size + 100) / 17
    )
    cause, effect = wide[100:-100], np.roll(wide, shift)[100:-100]
    assert lag(cause, effect).samples == pytest.approx(shift, abs=0.6)
    recording = Recording({"pressure": cause, "displacement": effect}, STEP)
    assert comes_first(lags(recording)["displacement"]) == (shift < 0)


def test_swapped_columns_are_told_by_their_hysteresis(tmp_path: Path) -> None:
    def told(*columns: Array) -> bool:
        found = one(put(tmp_path / "run.csv", HEADER, T, *columns))
        return any("before" in note for note in found.notes)

    wide = play(P, 0.8)
    assert told(wide / 5, 5 * P)
    assert not told(P, wide)


def test_repeated_rows_are_left_out_and_other_rows_of_one_time_refused(tmp_path: Path) -> None:
    again = np.r_[0:900, 850:900, 900:3000]
    found = one(put(tmp_path / "run.csv", HEADER, T[again], P[again], Y[again]))
    assert found["displacement"] == pytest.approx(Y, abs=1e-9)
    other = Y[again].copy()
    other[905] += 1.0
    assert refused(put(tmp_path / "run.csv", HEADER, T[again], P[again], other)).channel == "time"
