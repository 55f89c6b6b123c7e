"""What two recordings have in common is found, whatever its form; what is merely alike is not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import mckibben
from mckibben import GPI, DataError, Recording
from mckibben.signals import irregular_triangle, triangle
from mckibben.signals.shared_rows import check_shared, shared_rows, without_copies
from tests.refusals import refused

STEP = 0.02
TIME = np.arange(0, 24, STEP)
CHANNELS = ["pressure"], ["displacement"]


def recorded(u: np.ndarray, seed: int, noise: float = 0.02) -> Recording:
    rng = np.random.default_rng(seed)
    y = GPI.example().simulate(u) + noise * rng.standard_normal(u.size)
    return Recording({"pressure": u, "displacement": y}, STEP, meta={"name": f"run {seed}"})


def common(*recordings: Recording) -> list[tuple[int, int]]:
    return [(one.first, one.second) for one in shared_rows(recordings, *CHANNELS)]


def changed(recording: Recording, change: Callable[[np.ndarray], np.ndarray]) -> Recording:
    return replace(
        recording, channels={name: change(recording[name]) for name in recording.channels}
    )


def quantised(recording: Recording, resolution: float) -> Recording:
    return changed(recording, lambda x: np.round(x / resolution) * resolution)


RUN = recorded(irregular_triangle(TIME, 12, 5.0, seed=3), 0)


@pytest.mark.parametrize(
    "copy",
    [
        RUN,
        changed(RUN, lambda x: x.astype(np.float32)),
        changed(RUN, lambda x: np.array([float(f"{value:.6g}") for value in x])),
        changed(RUN, lambda x: np.array([float(f"{100 * value:.6g}") for value in x]) / 100),
        replace(RUN, start_time=77.0, meta={"name": "another"}),
        replace(RUN, sample_time=None),
        RUN.slice(0, 300),
        RUN.slice(900, 1200),
        RUN.slice(700, 712),
    ],
    ids=["same", "float32", "six-digits", "kPa", "later", "no-time", "head", "tail", "twelve-rows"],
)
def test_a_copy_is_found_whatever_its_form(copy: Recording) -> None:
    (found,) = shared_rows([RUN, copy], *CHANNELS)
    assert found.share > 0.95
    assert common(copy, RUN) == [(0, 1)]
    assert without_copies([RUN, copy], *CHANNELS) == [RUN]


@pytest.mark.parametrize("resolution", [0.01, 0.0277], ids=["decimals", "ten bits"])
def test_a_file_in_other_units_is_the_same_data(resolution: float, tmp_path: Path) -> None:
    run = quantised(RUN, resolution)
    table = np.column_stack([TIME, run["pressure"] * 100, run["displacement"] / 1000])
    header = "time [s],pressure [kPa],displacement [m]"
    path = tmp_path / "copy.csv"
    np.savetxt(path, table, "%.9g", delimiter=",", header=header, comments="")
    (found,) = shared_rows([run, *mckibben.read(path)], *CHANNELS)
    assert found.share > 0.99


@pytest.mark.parametrize("seed", range(3))
def test_overlapping_slices_are_found_where_they_overlap(seed: int) -> None:
    overlap = int(np.random.default_rng(seed).integers(150, 600))
    (found,) = shared_rows([RUN.slice(0, 700), RUN.slice(700 - overlap, 1200)], *CHANNELS)
    assert found.start == pytest.approx(STEP * (700 - overlap), abs=5 * STEP)
    assert found.start_in_first == pytest.approx(found.start)
    assert found.stop == pytest.approx(STEP * 699)
    assert found.share == pytest.approx(overlap / 700, abs=0.02)
    assert common(RUN.slice(0, 700), RUN.slice(700, 1200)) == []


@pytest.mark.parametrize("noise", [0.003, 0.02, 0.2])
@pytest.mark.parametrize("resolution", [1e-9, 0.0277], ids=["fine", "ten bits"])
def test_repeats_of_a_reference_with_sensor_noise_are_different_data(
    noise: float, resolution: float
) -> None:
    reference = triangle(TIME, 4.0, 5.0)
    runs = [quantised(recorded(reference, seed, noise), resolution) for seed in range(4)]
    assert common(*runs) == []
    assert common(*(runs[0].slice(200 * k, 200 * k + 200) for k in range(6))) == []


def test_a_quantised_sensor_at_holds_is_no_copy() -> None:
    held = np.repeat(np.tile([1.0, 3.0, 2.0, 5.0], 6), 100)[: TIME.size]
    runs = [quantised(recorded(held, seed), 0.05) for seed in range(4)]
    assert common(*runs) == []


def test_a_little_in_common_is_let_and_more_is_refused() -> None:
    before, little, much = RUN.slice(0, 700), RUN.slice(660, 1200), RUN.slice(500, 1200)
    assert check_shared({"fit": [before], "test": [little]}, *CHANNELS) == ()
    both = {"fit": [before], "test": [much]}
    assert len(check_shared(both, *CHANNELS, allow=True)) == 1
    for given in (
        both,
        {"fit": [before, before]},
        {"fit": [], "validate": [RUN], "test": [RUN]},
    ):
        with refused(DataError, names=RUN.name):
            check_shared(given, *CHANNELS)
