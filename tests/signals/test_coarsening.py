"""Thinning for fits: what memory depends on stays."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mckibben import DataError, Recording
from mckibben.signals import coarsened, made_manageable, reversals

levels = st.lists(st.integers(0, 20), min_size=3, max_size=12)


def run_through(turns: list[int], per_branch: int, noise: float = 0.0) -> Recording:
    u = np.interp(
        np.linspace(0, len(turns) - 1, per_branch * (len(turns) - 1) + 1), range(len(turns)), turns
    )
    u = u + noise * np.random.default_rng(0).standard_normal(u.size)
    return Recording({"pressure": u, "displacement": 2.0 * u}, 0.01, start_time=3.0)


@given(levels, st.integers(20, 60), st.integers(1, 9), st.sampled_from([0.0, 0.01]))
def test_turning_levels_stay_and_every_channel_is_taken_at_the_same_instants(
    turns: list[int], per_branch: int, factor: int, noise: float
) -> None:
    recording = run_through(turns, per_branch, noise)
    thin = coarsened(recording, factor, "pressure")
    assert len(thin) == -(-len(recording) // factor)
    assert thin.sample_time == pytest.approx(0.01 * factor)
    assert thin.start_time == recording.start_time
    np.testing.assert_array_equal(thin["displacement"], 2.0 * thin["pressure"])
    if np.ptp(recording["pressure"]) == 0:
        return
    inner = reversals(recording["pressure"])[1:-1]
    np.testing.assert_array_equal(thin["pressure"][inner // factor], recording["pressure"][inner])


@given(levels, st.integers(2, 6), st.integers(5, 40))
def test_extremes_survive_bins_of_many_turns(
    turns: list[int], per_branch: int, factor: int
) -> None:
    recording = run_through(turns, per_branch)
    if len(recording) <= factor:
        return
    u, thin = recording["pressure"], coarsened(recording, factor, "pressure")["pressure"]
    inner = u[reversals(u)[1:-1]]
    assert thin[0] == u[0]
    if inner.size:
        middle = 0.5 * (u.max() + u.min())
        assert np.abs(thin - middle).max() >= np.abs(inner - middle).max() - 1e-12
    if u[-1] in (u.max(), u.min()):
        assert np.abs(thin - u[-1]).min() == 0


def test_recordings_are_thinned_alike_and_short_ones_left_out_with_a_word() -> None:
    long, short = run_through([0, 5, 0], 2000), run_through([0, 5, 0], 20).with_meta(name="short")
    (train, checks, test), notes = made_manageable([[long, short], [], [long]], "pressure", 100)
    assert checks == []
    assert [len(r) for r in train] == [98]
    assert train[0].sample_time == test[0].sample_time
    assert len(notes) == 2
    assert "short" in notes[1]
    assert made_manageable([[short], [short]], "pressure", 100)[1] == ()
    with pytest.raises(DataError):
        made_manageable([[long], [short]], "pressure", 100)
    with pytest.raises(DataError):
        made_manageable([[long], []], "pressure", 5)
