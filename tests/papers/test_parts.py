"""Parts of re-runs that are quick: calls, fits that are kept, methods that break, what tables are of."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from mckibben import GPI, Recording, registry
from mckibben.blocks.dynamics.transfer_function import TransferFunction
from mckibben.checkpoints import Checkpoints
from mckibben.estimators.core.estimator import Estimator
from mckibben.papers.activation_pressure.run import by_condition
from mckibben.papers.experiment import Experiment
from mckibben.papers.recognising import Labels, Runs
from mckibben.rigs import load_rig
from mckibben.signals import triangle
from mckibben.signals.protocol import protocol
from tests.cli.conftest import Cli
from tests.cli.conftest import cli as cli  # a fixture


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nobody"], "nobody"),
        ([], "--list"),
        (["field-models", "--data", "nowhere"], "nowhere"),
        (["field-models", "--rig", "no-rig"], "no-rig"),
    ],
)
def test_bad_calls_are_refused(cli: Cli, arguments: list[str], said: str) -> None:
    result = cli("reproduce", *arguments)
    assert result.code == 2
    assert said in result.err


@pytest.fixture
def recording() -> Recording:
    u = triangle(np.arange(0, 8, 0.02), 4.0, 5.0)
    return Recording({"pressure": u, "displacement": GPI.example().simulate(u)}, 0.02)


def experiment(folder: Path, name: str = "multistate-friction") -> Experiment:
    return Experiment(
        name,
        load_rig(protocol(name).rig),
        None,
        quick=True,
        seed=0,
        jobs=1,
        checkpoints=Checkpoints(folder, name),
        progress=lambda share, text: None,
    )


def test_a_fit_is_made_once(
    tmp_path: Path, recording: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    fits: list[Estimator] = []
    fit = Estimator.fit

    def counted(self: Any, *args: Any, **kwargs: Any) -> Any:
        fits.append(self)
        return fit(self, *args, **kwargs)

    monkeypatch.setattr(Estimator, "fit", counted)
    first, second = (experiment(tmp_path).fit("pi", "pi", recording) for _ in range(2))
    assert first == second
    assert len(fits) == 1
    experiment(tmp_path).fit("pi", "pi", recording, {"n_operators": 3})
    experiment(tmp_path, "field-models").fit("pi", "pi", recording)
    assert len(fits) == 3


def test_box_jenkins_finds_a_numerator_of_the_printed_structure() -> None:
    rng = np.random.default_rng(0)
    u = np.repeat(rng.uniform(1.0, 5.5, 150), 10) + 0.1 * rng.standard_normal(1500)
    clean = lfilter([0.8, 0.0, -0.3], [1.0, -1.2, 0.36], u)
    noise = lfilter([1.0, 0.1284, -0.5], [1.0, -1.2, 0.4], 0.01 * rng.standard_normal(1500))
    recording = Recording({"pressure": u, "displacement": clean + noise}, 0.02)
    model = registry.load("estimators", "bj")(lags=(0, 2)).fit(recording).model_
    assert isinstance(model, TransferFunction)
    assert model.numerator[1] == 0.0
    assert model.numerator == pytest.approx((0.8, 0.0, -0.3), abs=0.01)


def test_runs_of_one_condition_have_rows_of_their_own(recording: Recording) -> None:
    labels = Labels("train", {"stage": "static", "force": 50.0, "frequency": 1.0})
    runs = Runs({"a": recording, "b": recording}, {"a": labels, "b": labels})
    assert [row for *_, row in by_condition(runs, "static")] == ["50 N, 1 Hz", "50 N, 1 Hz, b"]
