"""What two recordings have in common is found, whatever its form; what is merely alike is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mckibben import GPI, DataError, Recording
from mckibben.comparison.shared_stretches import shared_stretches, told
from mckibben.signals import irregular_triangle, triangle

STEP = 0.02
TIME = np.arange(0, 24, STEP)


def recorded(u: np.ndarray, seed: int, noise: float = 0.02) -> Recording:
    rng = np.random.default_rng(seed)
    y = GPI.example().simulate(u) + noise * rng.standard_normal(u.size)
    return Recording({"pressure": u, "displacement": y}, STEP, meta={"name": f"run {seed}"})


def common(*recordings: Recording) -> list[tuple[int, int]]:
    found = shared_stretches(recordings, ["pressure"], ["displacement"])
    return [(one.first, one.second) for one in found]


def changed(recording: Recording, change: object) -> Recording:
    assert callable(change)
    return replace(
        recording, channels={name: change(recording[name]) for name in recording.channels}
    )


RUN = recorded(irregular_triangle(TIME, 12, 5.0, seed=3), 0)


@pytest.mark.parametrize(
    "copy",
    [
        RUN,
        changed(RUN, lambda x: x.astype(np.float32)),
        changed(RUN, lambda x: np.array([float(f"{value:.6g}") for value in x])),
        changed(RUN, lambda x: np.round(x, 3)),
        replace(RUN, start_time=77.0, meta={"name": "another"}),
        replace(RUN, sample_time=None),
        RUN.slice(0, 300),
        RUN.slice(900, 1200),
    ],
    ids=["same", "float32", "six digits", "three decimals", "later", "no time", "head", "tail"],
)
def test_a_copy_is_found_whatever_its_form(copy: Recording) -> None:
    (found,) = shared_stretches([RUN, copy], ["pressure"], ["displacement"])
    assert found.share > 0.99
    assert common(copy, RUN) == [(0, 1)]


@pytest.mark.parametrize("every", [2, 5])
def test_every_so_many_th_sample_of_a_recording_is_found(every: int) -> None:
    thin = replace(changed(RUN, lambda x: x[1::every]), sample_time=every * STEP)
    assert common(RUN, thin) == common(thin, RUN) == [(0, 1)]


@pytest.mark.parametrize("seed", range(3))
def test_overlapping_slices_are_found_where_they_overlap(seed: int) -> None:
    overlap = int(np.random.default_rng(seed).integers(150, 600))
    (found,) = shared_stretches(
        [RUN.slice(0, 700), RUN.slice(700 - overlap, 1200)], ["pressure"], ["displacement"]
    )
    assert found.start == pytest.approx(STEP * (700 - overlap))
    assert found.stop == pytest.approx(STEP * 699)
    assert common(RUN.slice(0, 700), RUN.slice(700, 1200)) == []


@pytest.mark.parametrize("noise", [0.003, 0.02, 0.2])
@pytest.mark.parametrize("resolution", [0.0, 0.0277], ids=["fine", "ten bits"])
def test_repeats_of_a_reference_with_sensor_noise_are_different_data(
    noise: float, resolution: float
) -> None:
    reference = triangle(TIME, 4.0, 5.0)
    runs = [recorded(reference, seed, noise) for seed in range(4)]
    if resolution:
        runs = [changed(run, lambda x: np.round(x / resolution) * resolution) for run in runs]
    assert common(*runs) == []


def test_a_little_in_common_is_let_and_more_is_refused() -> None:
    before, little, much = RUN.slice(0, 700), RUN.slice(660, 1200), RUN.slice(500, 1200)
    channels = ["pressure"], ["displacement"]
    assert told({"fit": [before], "test": [little]}, *channels) == ()
    both = {"fit": [before], "test": [much]}
    assert len(told(both, *channels, allow=True)) == 1
    for given in (
        both,
        {"fit": [before, before]},
        {"fit": [], "validate": [RUN], "test": [RUN]},
    ):
        with pytest.raises(DataError, match="run 0"):
            told(given, *channels)
