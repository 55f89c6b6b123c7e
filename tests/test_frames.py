"""Recordings as data frames and arrays, and back."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest
from sklearn.model_selection import cross_val_score

from mckibben import DataError, PIEstimator, Recording
from mckibben.estimators.coupled.play_ridge import PlayRidgeEstimator

U = 2.5 + 2.5 * np.sin(np.arange(400) / 20) * np.linspace(1.0, 0.3, 400)
Y = 3.0 * U + np.roll(U, 5)


def run(**fields: Any) -> Recording:
    return Recording({"pressure": U, "displacement": Y}, **{"sample_time": 0.07, **fields})


@pytest.mark.parametrize(
    "one",
    [
        run(start_time=1.3, meta={"name": "a", "load": 2.0}),
        run(sample_time=None),
        run().with_channels({"odd": "furlong"}, odd=U),
    ],
)
def test_frames_go_round(one: Recording) -> None:
    again = Recording.from_frame(one.to_frame())
    assert again == one
    assert again.name == one.name


def test_a_part_of_a_frame_has_its_own_times() -> None:
    """Whatever pandas has carried over of the whole."""
    frame = run(start_time=1.0).to_frame()
    later, seldom = (
        Recording.from_frame(frame[100:]),
        Recording.from_frame(frame[["pressure"]][::2]),
    )
    assert (later.start_time, later.sample_time) == pytest.approx((8.0, 0.07))
    assert (seldom.start_time, seldom.sample_time) == pytest.approx((1.0, 0.14))
    with pytest.raises(DataError):
        Recording.from_frame(frame[frame["pressure"] > 2.0])


@pytest.mark.parametrize(
    "index",
    [
        pd.date_range("2026-03-29 01:59", periods=400, freq="20ms"),
        pd.date_range("2026-03-29 01:59", periods=400, freq="20ms", tz="Europe/Berlin"),
        pd.timedelta_range("1h", periods=400, freq="20ms"),
        pd.Index(0.02 * np.arange(400), name="time"),
    ],
)
@pytest.mark.parametrize("as_column", [False, True])
def test_times_are_seconds(index: Any, as_column: bool) -> None:
    frame = pd.DataFrame({"pressure": U, "displacement": Y}, index=index)
    one = Recording.from_frame(frame.rename_axis("time").reset_index() if as_column else frame)
    assert one.sample_time == pytest.approx(0.02, rel=1e-9)
    assert list(one.channels) == ["pressure", "displacement"]


def test_times_that_are_not_uniform_are_named_with_their_row() -> None:
    time = 0.02 * np.arange(400)
    time[300:] += 0.5
    with pytest.raises(DataError) as caught:
        Recording.from_frame(pd.DataFrame({"time": time, "pressure": U}))
    assert (caught.value.channel, caught.value.row) == ("time", 301)


def test_bad_samples_are_errors() -> None:
    texts, gap = ["a", "b"], pd.DatetimeIndex(["2026-01-01", "NaT", "2026-01-03"])
    for bad in (
        pd.DataFrame(),
        pd.DataFrame({"pressure": texts}),
        pd.DataFrame({"time": texts, "pressure": [1.0, 2.0]}),
        pd.DataFrame({"pressure": [1.0, 2.0, 3.0]}, index=gap),
        run().to_frame()[:0],
    ):
        with pytest.raises(DataError):
            Recording.from_frame(bad)


def test_frames_and_arrays_are_fitted_like_recordings() -> None:
    one, estimator = run(), PIEstimator(n_operators=4)
    model = estimator.fit(one).model_
    assert estimator.fit(one.to_frame()).model_ == model
    assert estimator.fit([one.to_frame(), one]).model_ == estimator.fit([one, one]).model_
    assert estimator.fit(U, Y, sample_time=0.07).model_ == model
    assert estimator.fit(U[:, None], Y[:, None], sample_time=0.07).model_ == model
    predicted = estimator.predict(one)
    assert predicted.shape == (400,)
    assert np.array_equal(predicted, model.simulate(one)["displacement"])
    for other in (one.to_frame(), [one]):
        assert np.array_equal(np.ravel(estimator.predict(other)), predicted)
    for inputs in (U, U[:, None], one.select(["pressure"])):
        at_rest = model.simulate(U, sample_time=0.07)
        assert np.array_equal(np.ravel(estimator.predict(inputs)), at_rest)
    with pytest.raises(DataError):
        estimator.fit(np.column_stack([U, U]), Y, sample_time=0.07)
    with pytest.raises(DataError):
        estimator.fit(U, Y[:-1], sample_time=0.07)


def test_arrays_of_several_channels() -> None:
    names = ("pressure_1", "pressure_2")
    given = np.column_stack([U, np.roll(U, 40)])
    estimator = PlayRidgeEstimator(input=names, output=("displacement",))
    model = estimator.fit(given, Y, sample_time=0.07).model_
    named = Recording({**dict(zip(names, given.T, strict=True)), "displacement": Y}, 0.07)
    assert model == estimator.fit(named).model_
    assert np.array_equal(estimator.predict(given, sample_time=0.07), estimator.predict(named))


def test_cross_validation_takes_recordings_and_frames() -> None:
    runs = [run(), run(start_time=100.0), run(start_time=200.0)]
    scores = cross_val_score(PIEstimator(n_operators=3), runs, cv=3)
    frames = cross_val_score(PIEstimator(n_operators=3), [one.to_frame() for one in runs], cv=3)
    assert scores.shape == (3,)
    assert np.allclose(scores, frames)
