"""From Python: what is no recording, and no time between samples, is refused with a remedy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import mckibben
from mckibben import DataError, ModelError
from mckibben.blocks.base import run_many

GPI = mckibben.GPI.example()

MASKED = np.ma.masked_greater([1.0, 999999.0], 10.0)  # type: ignore[no-untyped-call]

TAKES_RECORDINGS: list[Callable[[Any], object]] = [
    mckibben.compare,
    mckibben.study,
    mckibben.characterize,
    mckibben.data_gaps,
    mckibben.plan,
    mckibben.review,
    lambda given: mckibben.check(GPI, given),
    lambda given: mckibben.GPIEstimator().fit(given),
]


@pytest.mark.parametrize("given", ["run.csv", ["run.csv"], 3, np.zeros(5)], ids=repr)
@pytest.mark.parametrize("takes", TAKES_RECORDINGS)
def test_what_is_no_recording_is_refused(takes: Callable[[Any], object], given: object) -> None:
    with pytest.raises(DataError):
        takes(given)


@pytest.mark.parametrize(
    "samples",
    [
        MASKED,
        np.array(["2020-01-01", "2020-01-02"], dtype="datetime64[D]"),
        np.array([1 + 2j, 3.0]),
        ["a", "b"],
        [object(), 1],
        [10**400, 1],
        [[1.0], [1.0, 2.0]],
        {1.0, 2.0},
    ],
    ids=range(8),
)
def test_what_are_no_samples_is_refused(samples: Any) -> None:
    with pytest.raises(DataError) as refused:
        mckibben.Recording({"pressure": samples})
    assert refused.value.channel == "pressure"


RECORDING: Any = mckibben.Recording
COMPARE: Any = mckibben.compare


@pytest.mark.parametrize(
    "made",
    [
        lambda run: RECORDING(None),
        lambda run: RECORDING([1.0, 2.0]),
        lambda run: RECORDING({"pressure": [1.0, 2.0]}, 0.1, units=3),
        lambda run: RECORDING({"pressure": [1.0, 2.0]}, "0.1"),
        lambda run: run.slice(0.5, 3.2),
        lambda run: COMPARE(run, models=5),
        lambda run: COMPARE(run, models={"a": 3}),
        lambda run: COMPARE(run, models={}),
        lambda run: COMPARE(run, models=["pi"], settings={"gpi": {"n_operators": 4}}),
        lambda run: COMPARE(run, models=["pi"], load=5),
        lambda run: GPI.simulate("run.csv"),
    ],
    ids=range(11),
)
def test_arguments_of_other_kinds_are_refused_and_never_passed_over(
    made: Callable[[Any], object],
) -> None:
    (run,) = mckibben.read(mckibben.example.TRAIN)
    with pytest.raises((DataError, ModelError)) as refused:
        made(run)
    assert "Remedy: " in str(refused.value)


@pytest.mark.parametrize("sample_time", [0.0, -0.01, np.nan, np.inf])
@pytest.mark.parametrize(
    "runs",
    [
        lambda time: GPI.stream(time),
        lambda time: GPI.inverse().stream(time),
        lambda time: GPI.simulate([1.0, 2.0], sample_time=time),
        lambda time: GPI.simulate_many([GPI.pack()], [1.0, 2.0], sample_time=time),
        lambda time: run_many([GPI], np.ones((2, 1)), sample_time=time),
    ],
)
def test_no_time_between_samples_is_refused(
    runs: Callable[[float], object], sample_time: float
) -> None:
    with pytest.raises(ModelError):
        runs(sample_time)
