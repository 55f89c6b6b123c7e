"""What a re-run keeps is read back."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mckibben import GPI, PIEstimator, Recording
from mckibben.comparison.kept import Kept
from mckibben.estimators.core.estimator import Estimator
from mckibben.papers.keeping import fitted, recorded
from mckibben.signals import triangle


@pytest.fixture
def recording() -> Recording:
    u = triangle(np.arange(0, 8, 0.02), 4.0, 5.0)
    return Recording({"pressure": u, "displacement": GPI.example().simulate(u)}, 0.02)


def test_a_fit_is_made_once(
    tmp_path: Path, recording: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    fits: list[Estimator] = []
    fit = Estimator.fit

    def counted(self: Any, *args: Any, **kwargs: Any) -> Any:
        fits.append(self)
        return fit(self, *args, **kwargs)

    monkeypatch.setattr(Estimator, "fit", counted)
    first, second = (fitted(Kept(tmp_path), "pi", PIEstimator(), recording) for _ in range(2))
    assert first == second
    assert len(fits) == 1
    fitted(Kept(tmp_path), "pi", PIEstimator(n_operators=3), recording)
    fitted(Kept(tmp_path, "another paper"), "pi", PIEstimator(), recording)
    assert len(fits) == 3


def test_an_interrupted_fit_is_not_kept(
    tmp_path: Path, recording: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    from mckibben import GPIEstimator
    from mckibben.estimators.optimisers.tracker import Tracker

    saw = Tracker.saw

    def impatient(self: Tracker, *args: Any) -> None:
        saw(self, *args)
        if self.evaluations == 5:
            raise KeyboardInterrupt

    monkeypatch.setattr(Tracker, "saw", impatient)
    with pytest.raises(KeyboardInterrupt):
        fitted(Kept(tmp_path), "gpi", GPIEstimator(), recording)
    assert not (tmp_path / "unfinished").exists()
    assert GPIEstimator().fit(recording).diagnostics_.interrupted  # by itself it is


def test_recordings_are_read_back_and_damaged_ones_made_again(tmp_path: Path) -> None:
    def again() -> Recording:
        ((_, found),) = recorded(
            Kept(tmp_path), "multistate-friction", ["isobaric-1bar"], 0, lambda share, text: None
        )
        return found

    first = again()
    (file,) = (tmp_path / "unfinished").glob("*.csv")
    stamp = file.stat().st_mtime_ns
    assert again() == first
    assert file.stat().st_mtime_ns == stamp
    file.write_bytes(file.read_bytes()[:1000])
    assert again() == first
