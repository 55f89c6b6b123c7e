"""Long work shows how far it is, or tells who asked."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import pytest

import mckibben
from mckibben import Recording, example
from mckibben.control import track, tune_pid


@pytest.fixture(scope="module")
def run() -> Recording:
    return mckibben.read(example.TRAIN)[0].slice(0, 1500)


def model(run: Recording) -> Any:
    return mckibben.PIEstimator(n_operators=4).fit(run).model_


WORK: dict[str, Callable[[Recording, Any], object]] = {
    "comparing": lambda run, p: mckibben.compare(run, models=["pi"], jobs=1, progress=p),
    "studying": lambda run, p: mckibben.study(run, models=["pi"], jobs=1, progress=p),
    "fitting": lambda run, p: mckibben.GPIEstimator(n_operators=3).fit(run, progress=p),
    "checking": lambda run, p: mckibben.check(model(run), run, progress=p),
    "tracking": lambda run, p: track(
        model(run).inverse(), mckibben.load_rig("mas20-hanging"), run.slice(0, 50), progress=p
    ),
    "tuning": lambda run, p: tune_pid(
        mckibben.load_rig("mas20-hanging"), sample_time=0.02, hold=1.0, progress=p
    ),
    "calibrating": lambda run, p: mckibben.calibrate(
        model(run), [run.slice(0, 700), run.slice(700, 1500)], progress=p
    ),
}


LONG = ("comparing", "studying", "checking", "tuning")


@pytest.mark.parametrize(
    "what",
    [
        *("fitting", "tracking", "calibrating"),
        *(pytest.param(what, marks=pytest.mark.long) for what in LONG),
    ],
)
@pytest.mark.filterwarnings("ignore::mckibben.ModelWarning")
def test_true_shows_a_bar_and_a_callable_is_told(
    what: str,
    run: Recording,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    told: list[Any] = []
    WORK[what](run, lambda *given: told.append(given))
    assert told
    shares = [getattr(first, "share", first) for first, *_ in told]
    assert shares == sorted(shares)
    assert 0 <= shares[0] <= shares[-1] <= 1
    assert capfd.readouterr() == ("", "")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    WORK[what](run, True)
    out, error = capfd.readouterr()
    assert what in error
    assert not out


@pytest.mark.long
def test_without_a_terminal_steps_are_lines(
    run: Recording, capfd: pytest.CaptureFixture[str]
) -> None:
    WORK["fitting"](run, True)
    assert capfd.readouterr() == ("", "")
    mckibben.compare(run, models=["pi", "gpi"], jobs=1, progress=True)
    lines = capfd.readouterr().err.splitlines()
    assert len(lines) >= 2
    assert all(line.startswith("comparing: ") for line in lines)
