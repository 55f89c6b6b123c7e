"""What jobs do, called in this process: models, judgements, plans, loops, logs and forces."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mckibben import PI, Banded, DataError, Recording, read, write
from mckibben.app import forms, motions
from mckibben.app.following import (
    compensated,
    estimate,
    look_back,
    loop,
    too_fast,
)
from mckibben.app.jobs import Jobs
from mckibben.app.motions import parsed, reference_recording
from mckibben.app.recorded import pace, reached
from mckibben.app.work import check, fit, plan, record
from mckibben.app.workspace import Workspace
from mckibben.errors import ModelError
from mckibben.registry import load
from tests.app.simulated import (
    WEAKER,
    asked,
    desk_of,
    filled,
    modelled,
    quiet,
    swung,
    workspace_of,
)
from tests.report.studies_by_hand import QUICKLY, hung

MODEL = PI.example()
(LOW,), (HIGH,) = MODEL.reachable()


def rising(gain: float = 5.0) -> Recording:
    pressure = np.linspace(0.5, 4.0, 50)
    return Recording({"pressure": pressure, "displacement": gain * pressure}, 0.1)


def sine() -> Recording:
    points = motions.motion("sine", 4.0, float(LOW), float(HIGH))
    return reference_recording({"displacement": points}, 0.02)


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    """Return one with models of a muscle, of an arm, and an inverse, and with a motion."""
    bigger = replace(MODEL, weights=tuple(3 * weight for weight in MODEL.weights))
    found = modelled(
        tmp_path,
        mine=MODEL,
        inverse=MODEL.inverse(),
        bigger=bigger,
        unlimited=replace(MODEL, input_range=None),
        arm=load("blocks", "balance").example().inverse(),
    )
    replace(Banded.example(), forward=bigger).save(found.path("banded", "bigger.json"))
    write(sine(), found.path("runs", "reference.csv"))
    return found


# -- fits and what follows them ------------------------------------------------------------------


def test_a_fit_leaves_a_model_its_figures_and_a_judgement(tmp_path: Path) -> None:
    workspace = filled(tmp_path)
    fit(workspace, asked("gpi", "first"), quiet)
    assert workspace.model("first").kind == "gpi"
    (row,) = workspace.results()
    low, high = row["test"]["rmse_interval"]
    assert 0 < low <= row["test"]["rmse"] <= high
    assert row["current"]
    trained = check(workspace, {"name": "first", "file": "check.html"}, quiet)
    workspace.add(swung(7.0).slice(0, 30), origin="", call="", name="short", role="test")
    assert trained in check(workspace, {"name": "first", "file": "again.html"}, quiet)
    page = workspace.path("takeaway", "check.html").read_text("utf-8")
    assert "models/first.json" in page
    plan(workspace, {"name": "", "minutes": 0.4, "file": "next.csv", "seed": 0}, quiet)
    (found,) = read(workspace.path("takeaway", "next.csv"))
    assert "pressure" in found


def test_a_fit_that_cannot_be_leaves_nothing(tmp_path: Path) -> None:
    workspace = filled(tmp_path)
    with pytest.raises((DataError, ModelError), match="n_operators"):
        fit(workspace, asked("gpi", "a", n_operators=-1), quiet)
    with pytest.raises(DataError, match="voltage"):
        fit(workspace, asked("pi", "b") | {"input": "voltage"}, quiet)
    assert workspace.results() == []
    assert workspace.models() == []


def test_a_protocol_is_recorded_and_undone(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    record(workspace, {"protocol": "field-models", "runs": ["decaying-triangle"]}, quiet)
    (entry,) = workspace.entries()
    assert entry.role == "train"
    assert "mas20-hanging" in entry.origin
    workspace.undo()
    assert workspace.entries() == []


def test_what_is_asked_for_again_is_not_begun_twice(tmp_path: Path) -> None:
    workspace = filled(tmp_path)
    jobs = Jobs(workspace, at_once=1)
    jobs.at_once = 0  # none is started
    first = jobs.submit("fit", asked("pi", "one"))
    assert jobs.submit("fit", asked("pi", "one")) is first
    assert jobs.submit("fit", asked("pi", "one", n_operators=7)) is not first
    workspace.set_role("run", "test")
    again = jobs.submit("fit", asked("pi", "one"))
    assert again is not first
    jobs.cancel(again.name)
    assert jobs.submit("fit", asked("pi", "one")) is not again
    assert len(jobs.active()) == 3
    jobs.close()


def test_under_dead_loads_what_is_reached_depends_on_the_load(tmp_path: Path) -> None:
    workspace = workspace_of(tmp_path, hung10=hung(10.0), hung20=hung(20.0))
    desk = desk_of(workspace)
    given = {"model": "balance", "name": "balance", "settings": QUICKLY["balance"]}
    fit(workspace, given | desk.channels, quiet)
    (row,) = desk.results()
    assert (row["name"], row["input"], row["load"]) == ("balance", "pressure", "force")
    ends = [reached(workspace, "balance", {"force": pull}) for pull in (10.0, 20.0)]
    (_, above), (low, below) = (each["displacement"] for each in ends)
    assert above > below + 0.5
    light, heavy = (
        compensated(
            workspace,
            "balance",
            reference_recording(
                {"displacement": [(0.0, low), (5.0, below)]}, 0.05, {"force": pull}, {"force": "N"}
            ),
            "inverse",
            {},
        )[0]["pressure"].mean()
        for pull in (12.0, 18.0)
    )
    assert heavy > light + 0.1


# -- motions -------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", motions.MOTIONS)
def test_ready_made_motions_stay_between_their_ends(kind: str) -> None:
    times, values = np.array(motions.motion(kind, 10.0, 2.0, 5.0, cycles=3, seed=4)).T
    assert times[0] == 0.0
    assert times[-1] <= 10.0
    assert (np.diff(times) > 0).all()
    assert (values.min(), values.max()) >= (2.0, 2.0)
    assert values.max() <= 5.0
    falling = np.array(motions.motion(kind, 10.0, 5.0, 2.0, cycles=3, seed=4))
    assert np.allclose(falling[:, 1], 7.0 - values)
    with pytest.raises(DataError):
        motions.motion(kind, 10.0, 5.0, 5.0)


def test_points_are_read_and_become_a_reference() -> None:
    points = parsed("0 10\n\n 2; 20\n4,10")
    assert points == [(0.0, 10.0), (2.0, 20.0), (4.0, 10.0)]
    reference = reference_recording({"displacement": points}, 0.5)
    np.testing.assert_allclose(reference["displacement"][[0, 2, 4, 8]], [10, 15, 20, 10])
    for text in ("1", "a b", "1 2 3"):
        with pytest.raises(DataError):
            parsed(text)
    for none in ([], [(0.0, 1.0)], [(0.0, 1.0), (0.0, 2.0)], [(0.0, 1.0), (1e9, 2.0)]):
        with pytest.raises(DataError):
            reference_recording({"displacement": none}, 0.01)


def test_steps_and_cycles_are_those_of_the_training_recordings(workspace: Workspace) -> None:
    assert pace(workspace, "mine") == (forms.STEP, 10.0, 0.0)
    load("blocks", "process-model").example().save(workspace.path("models", "lag.json"))
    wave = 5.0 - 5.0 * np.cos(2 * np.pi * np.arange(1200) / 400.0)
    run = Recording({"pressure": 0.3 * wave, "displacement": wave}, 0.1)
    workspace.add(run, origin="", call="", role="train")
    step, usual, shortest = pace(workspace, "lag")
    assert step == 0.1
    assert usual == pytest.approx(shortest, rel=0.05) == pytest.approx(40.0, rel=0.05)

    def doubts(step: float, seconds: float, model: str = "lag") -> str:
        wished = {"displacement": motions.motion("sine", seconds, 2.0, 8.0)}
        return " ".join(too_fast(workspace, model, reference_recording(wished, step)))

    assert doubts(0.1, 80.0) == doubts(0.01, 8.0, "mine") == ""
    assert "0.01 s" in doubts(0.01, 80.0)
    assert "4 s" in doubts(0.1, 8.0)


# -- compensators and plants ---------------------------------------------------------------------


def test_models_are_inverted_and_inverses_are_not(workspace: Workspace) -> None:
    assert [workspace.invertible(name) for name in ("mine", "arm", "inverse")] == [1, 1, 0]
    assert forms.possible(workspace, "mine") == ["model", "inverse", "adaptive", "predictive"]
    assert "force" in forms.possible(workspace, "arm")
    load("blocks", "duhem-oscillator").example().save(workspace.path("models", "a.json"))
    assert "a" in workspace.ranked()
    assert "a" not in workspace.to_invert()


def test_a_compensator_that_looks_ahead_gives_pressures_when_they_are_due(
    workspace: Workspace,
) -> None:
    exact, _ = compensated(workspace, "mine", sine(), "inverse", {})
    ahead, _ = compensated(workspace, "mine", sine(), "predictive", {"horizon": 5})
    assert np.array_equal(ahead.time, sine().time)
    np.testing.assert_allclose(ahead["pressure"], exact["pressure"], atol=1e-9)
    slow, _ = compensated(workspace, "mine", sine(), "predictive", {"rate_limit": 0.5})
    assert np.abs(np.diff(slow["pressure"])).max() <= 0.5 * 0.02 + 1e-12
    with pytest.raises(ModelError):
        compensated(workspace, "mine", sine(), "predictive", {"horizon": 0})


def test_plants_are_other_models_first_with_time_and_worse_ones_last(workspace: Workspace) -> None:
    assert workspace.plants("mine") == ["bigger", "mine"]
    workspace.add(rising(), origin="", call="", role="train")  # has the limits of what has none
    assert workspace.plants("mine") == ["bigger", "unlimited", "mine"]
    assert workspace.twin("bigger").scatters
    assert not workspace.twin("mine").scatters
    assert tuple(workspace.twin("unlimited").limits("pressure")) == (0.5, 4.0)
    later = load("blocks", "process-model").example()
    assert later.rate_dependent
    later.save(workspace.path("models", "later.json"))
    assert workspace.plants("mine") == ["later", "bigger", "unlimited", "mine"]
    WEAKER.save(workspace.path("models", "close.json"))
    for name, rmse in {"mine": 0.5, "close": 0.55, "later": 3.125, "bigger": 0.4}.items():
        row = {"status": "ok", "model": "pi", "validation_rmse": rmse, "unit": "mm"}
        workspace.write_json("results", name, row)
    assert workspace.plants("mine") == ["bigger", "close", "unlimited", "later", "mine"]
    weaker = workspace.weaker("mine")
    assert set(weaker) == {"later"}
    assert all(figure in weaker["later"] for figure in ("3.12", "0.500"))


@pytest.mark.parametrize("plant", ["bigger", "mine"])
def test_a_loop_is_stored_beside_no_compensation(workspace: Workspace, plant: str) -> None:
    given = {"model": "mine", "plant": plant, "controller": "feedforward", "name": "try"}
    loop(workspace, given | {"reference": "reference.csv"}, quiet)
    run = workspace.runs("mine")["try"]
    assert (run.plant, run.rig) == (plant, "")
    error = run.rmse["displacement"]
    assert error is not None
    assert (error < 1e-6) == (plant == "mine")
    (stored,) = read(workspace.path("runs", "try.csv"), informative=False)
    scored = stored.time >= 0
    for channel, noted in (
        ("uncompensated_displacement", run.uncompensated["displacement"]),
        ("displacement", error),
    ):
        off = (stored[channel] - stored["reference_displacement"])[scored]
        assert float(np.sqrt(np.mean(off**2))) == pytest.approx(noted, rel=1e-6, abs=1e-9)
    assert run.offset["displacement"] == pytest.approx(off.mean(), rel=1e-6, abs=1e-9)


def test_a_log_is_split_into_what_its_error_comes_from(workspace: Workspace) -> None:
    given = {"model": "mine", "plant": "mine", "controller": "feedforward", "name": "run"}
    loop(workspace, given | {"reference": "reference.csv"}, quiet)
    content = workspace.path("runs", "run.csv").read_bytes()
    workspace.path("uploads", "log.csv").write_bytes(content)
    look_back(workspace, {"model": "mine", "log": "log.csv", "name": "log"}, quiet)
    found = workspace.reviews()["log"]
    assert found.output == "displacement"
    assert found.achieved is not None
    assert {curve.name for curve in found.curves} >= {"reference", "measured", "error"}


def test_a_force_is_estimated_beside_the_measured_one(workspace: Workspace) -> None:
    arm = workspace.model("arm")
    t = np.arange(300) * 0.02
    values = {
        channel.name: (1.5 if channel.unit == "bar" else 1.0) + np.sin(t + k)
        for k, channel in enumerate(arm.inputs)
    }
    run = Recording(values, 0.02, {channel.name: channel.unit for channel in arm.inputs})
    moved = arm.simulate(run)
    units = {c.name: c.unit for c in arm.outputs}
    whole = run.with_channels(units, **{name: moved[name] for name in units})
    small = whole.with_channels({"force": "N"}, force=0.01 * whole["force"])
    for name, recording in (("run", whole), ("small", small)):
        workspace.add(recording, origin="", call="", name=name)
        estimate(workspace, {"model": "arm", "recording": name, "name": name}, quiet)
    found = workspace.estimates()
    assert found["run"].output == "force"
    measured, estimated, error = found["run"].curves
    y = [np.array(curve.y, dtype=float) for curve in (measured, estimated, error)]
    np.testing.assert_allclose(y[2], y[0] - y[1], atol=1e-4)
    assert found["run"].rmse is not None
    assert found["small"].rmse is not None
    assert len(found["small"].notes) > len(found["run"].notes)  # it is of no use there
