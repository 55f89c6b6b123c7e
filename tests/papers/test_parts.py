"""Parts of re-runs that are quick: calls, fits that are kept, methods that break, what tables are of."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from mckibben import GPI, GPIEstimator, PIEstimator, Recording, example, read, registry
from mckibben.blocks.dynamic.transfer_function import TransferFunction
from mckibben.comparison.kept import Kept
from mckibben.estimators.core.estimator import Estimator
from mckibben.estimators.optimisers.tracker import Tracker
from mckibben.papers.field_models import rerun as field_models
from mckibben.papers.field_models.methods import LEAST_SQUARES, PRINTED
from mckibben.papers.field_models.published import THRESHOLDS, prandtl_ishlinskii
from mckibben.papers.keeping import fitted, recorded
from mckibben.papers.reproduction import reproduce
from mckibben.papers.sdchm.compensation import references
from mckibben.papers.sdchm.models import BALANCE, LINEAR, OURS, PREDICTING, PUBLISHED, Models
from mckibben.papers.sdchm.prediction import Predictions
from mckibben.papers.sdchm.recordings import EXTENSOR, OUTPUTS, Recordings, plan
from mckibben.signals import triangle
from mckibben.signals.protocol import protocol
from tests.cli.conftest import (
    Cli,
    files,  # noqa: F401  # a fixture
)
from tests.cli.conftest import cli as cli  # a fixture


def test_list_names_every_paper(cli: Cli) -> None:
    listed = json.loads(cli("reproduce", "--list", "--json").out)
    assert sorted(listed) == sorted(registry.names("papers"))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nobody"], "nobody"),
        ([], "--list"),
        (["field-models", "--train", "x.csv"], "--test"),
        (["multistate-friction", "--train", "x.csv", "--test", "y.csv"], "field-models"),
        (["field-models", "--train", "x.csv", "--test", "y.csv"], "x.csv"),
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


def test_a_method_that_breaks_is_a_row_with_its_reason(
    monkeypatch: pytest.MonkeyPatch,
    files: tuple[Path, Path],  # noqa: F811
) -> None:
    """Of methods that are quick to fit, on few data."""
    methods = dict.fromkeys((*PRINTED, LEAST_SQUARES), PIEstimator(thresholds=THRESHOLDS))
    methods["NARX"] = PIEstimator(thresholds=(0.0, 9.0), method="slopes")
    monkeypatch.setattr(field_models, "published", lambda seed: methods)
    monkeypatch.setattr(field_models, "QUICK", ("pi",))
    train, test = (read(file)[0] for file in files)
    found = reproduce("field-models", quick=True, train=train, test=test).to_dict()
    (table,) = (t for t in found["tables"] if t["title"].startswith("The paper's methods"))
    rows = {row["model"]: row for row in table["rows"]}
    assert rows["NARX"]["RMSE test [mm], here"] is None
    assert rows["NARX"]["failed because"].startswith("3 of 3 seeds")
    assert rows["P2UZ"]["failed because"] == ""


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


def test_the_rig_is_no_stranger_to_the_printed_model_than_the_papers_muscle() -> None:
    errors: list[float] = []
    line = np.zeros(2)
    for name in ("decaying-triangle", "irregular-triangle"):
        (recording,) = read(example.FOLDER / f"{name}.csv")
        shape = prandtl_ishlinskii().simulate(recording)["unscaled_displacement"]
        if not errors:
            line = np.polyfit(shape, recording["displacement"], 1)
        errors.append(np.sqrt(np.mean((np.polyval(line, shape) - recording["displacement"]) ** 2)))
    assert errors[0] < PRINTED["PI by slopes"][0]
    assert errors[1] < PRINTED["PI by slopes"][2]


@dataclass(frozen=True)
class Off:
    """A model that is off by so much, and by the extensor's pressure where none is given."""

    by: float | None = None

    def simulate(self, recording: Recording) -> Recording:
        by = recording[EXTENSOR] if self.by is None else self.by
        return Recording({name: recording[name] + by for name in OUTPUTS}, recording.sample_time)


@pytest.fixture(scope="module")
def runs() -> Recordings:
    """All runs that predictions are scored on, with displacements that are cheap."""
    made = {}
    for run in protocol("sdchm").runs:
        u = run.inputs
        driven = [u[f"pressure_{k}"] for k in (1, 2, 3)]
        moved = {y: 20.0 * p + sum(driven) for y, p in zip(OUTPUTS, driven, strict=True)}
        channels = {name: u[name][::20] for name in u.channels}
        channels |= {name: y[::20] for name, y in moved.items()}
        made[run.name] = (run, Recording(channels, 20 * (u.sample_time or 1.0)))
    return Recordings(made)


def predictions(runs: Recordings, **off: float | None) -> Predictions:
    blocks: Any = dict.fromkeys(PREDICTING, Off(1.0)) | {k: Off(v) for k, v in off.items()}
    return Predictions(Models(blocks, dict.fromkeys(blocks, 0.0)), runs)


def test_groups_of_table_4_are_at_its_stiffness(runs: Recordings) -> None:
    found = predictions(runs, **{OURS: None}).groups(OURS, 0.1)
    assert list(found) == list("abcdefghijkl")
    assert [rmse for _, rmse in found.values()] == pytest.approx([0.1] * 12)


def test_joint_runs_come_first_and_choose_by_validation(runs: Recordings) -> None:
    found = predictions(runs, **{LINEAR: 3.0, PUBLISHED: 8.0, BALANCE: 0.5})
    assert found.headline == BALANCE
    assert found.only_along_patterns == [PUBLISHED]


def test_the_whole_test_set_is_recorded_and_scored(runs: Recordings) -> None:
    whole, names = plan(quick=False)
    recorded = [whole[name] for name in names]
    chosen = [run for run in recorded if run.role == "test" and run.labels["stage"] == "network"]
    assert sum(len(run.inputs) for run in chosen) == 48_000


def test_figure_13_follows_the_printed_reference() -> None:
    task = references(2, 3, 0.05)["task"]
    y = task[OUTPUTS[0]]
    assert y == pytest.approx(np.abs(40 * np.sin(0.04 * np.pi * task.time) + 5))
    cycle = y[:1000]
    assert cycle.min() == pytest.approx(0.0, abs=0.2)
    assert (cycle[:500].max(), cycle[500:].max()) == pytest.approx((45.0, 35.0), abs=0.01)
    assert (task[EXTENSOR] == 0.6).all()
