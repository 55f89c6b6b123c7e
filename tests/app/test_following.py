"""Uses of a model, motions to wish for, looks back on logs, and estimates of force."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mckibben import PI, Recording, write
from mckibben.app import forms, motions
from mckibben.app.following import compensated, estimate, look_back, loop, too_fast
from mckibben.app.pages.axes import Axes
from mckibben.app.recorded import pace
from mckibben.app.workspace import Workspace
from mckibben.errors import DataError, ModelError
from mckibben.registry import load


def quiet(share: float, cost: float) -> None:
    """Tell nobody."""


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    found = Workspace(tmp_path)
    PI.example().save(found.path("models", "pi.json"))
    PI.example().inverse().save(found.path("models", "inverse.json"))
    load("blocks", "balance").example().inverse().save(found.path("models", "arm.json"))
    return found


def wave() -> Recording:
    (low,), (high,) = PI.example().reachable()
    points = motions.motion("sine", 4.0, float(low), float(high))
    return motions.reference_recording({"displacement": points}, 0.02)


def test_models_of_several_muscles_are_inverted_and_inverses_are_not(workspace: Workspace) -> None:
    assert workspace.invertible("pi")
    assert workspace.invertible("arm")
    assert not workspace.invertible("inverse")
    assert forms.possible(workspace, "pi") == ["model", "inverse", "adaptive", "predictive"]
    assert "force" in forms.possible(workspace, "arm")


def test_a_compensator_that_looks_ahead_gives_pressures_when_they_are_due(
    workspace: Workspace,
) -> None:
    exact, _ = compensated(workspace, "pi", wave(), "inverse", {})
    ahead, _ = compensated(workspace, "pi", wave(), "predictive", {"horizon": 5})
    assert np.array_equal(ahead.time, wave().time)
    np.testing.assert_allclose(ahead["pressure"], exact["pressure"], atol=1e-9)
    slow, _ = compensated(workspace, "pi", wave(), "predictive", {"rate_limit": 0.5})
    assert np.abs(np.diff(slow["pressure"])).max() <= 0.5 * 0.02 + 1e-12
    with pytest.raises(ModelError, match="Remedy"):
        compensated(workspace, "pi", wave(), "predictive", {"horizon": 0})


@pytest.mark.parametrize("kind", motions.MOTIONS)
def test_ready_made_motions_stay_between_their_ends(kind: str) -> None:
    points = motions.motion(kind, 10.0, 2.0, 5.0, cycles=3, seed=4)
    times, values = np.array(points).T
    assert times[0] == 0.0
    assert times[-1] <= 10.0
    assert (np.diff(times) > 0).all()
    assert values.min() >= 2.0
    assert values.max() <= 5.0
    with pytest.raises(DataError, match="Remedy"):
        motions.motion(kind, 10.0, 5.0, 5.0)
    falling = np.array(motions.motion(kind, 10.0, 5.0, 2.0, cycles=3, seed=4))
    assert np.allclose(falling[:, 1], 7.0 - values)


def test_points_snap_and_lie_where_they_are_drawn() -> None:
    axes = Axes(20.0, 0.0, 10.0, "mm", "displacement")
    assert axes.at(*axes.place(7.0, 4.0)) == pytest.approx((7.0, 4.0))
    assert motions.snapped(7.13, 3.9, 0.5, 0.5) == (7.0, 4.0)
    assert motions.with_point([(1.0, 1.0), (3.0, 3.0)], 3.0, 2.0) == [(1.0, 1.0), (3.0, 2.0)]


def test_a_log_says_where_its_error_comes_from(workspace: Workspace) -> None:
    write(wave(), workspace.path("runs", "reference.csv"))
    asked = {
        "model": "pi",
        "plant": "pi",
        "controller": "feedforward",
        "reference": "reference.csv",
    }
    loop(workspace, asked | {"name": "run"}, quiet)
    content = workspace.path("runs", "run.csv").read_bytes()
    workspace.path("uploads", "log.csv").write_bytes(content)
    look_back(workspace, {"model": "pi", "log": "log.csv", "name": "log"}, quiet)
    found = workspace.reviews()["log"]
    assert found.output == "displacement"
    assert found.achieved is not None
    assert {curve.name for curve in found.curves} >= {"reference", "measured", "error"}


def test_a_force_is_estimated_beside_the_measured_one(workspace: Workspace) -> None:
    arm = workspace.model("arm")
    t = np.arange(300) * 0.02
    given = {
        channel.name: (1.5 if channel.unit == "bar" else 1.0) + np.sin(t + k)
        for k, channel in enumerate(arm.inputs)
    }
    units = {channel.name: channel.unit for channel in arm.inputs}
    run = Recording(given, 0.02, units)
    moved = arm.simulate(run)
    whole = run.with_channels(
        {c.name: c.unit for c in arm.outputs}, **{c.name: moved[c.name] for c in arm.outputs}
    )
    workspace.add(whole, origin="", call="", name="run")
    estimate(workspace, {"model": "arm", "recording": "run", "name": "try"}, quiet)
    found = workspace.estimates()["try"]
    assert found.output == "force"
    assert found.rmse is not None
    measured, estimated, error = found.curves
    assert (measured.name, estimated.name) == ("measured", "estimated")
    assert error.name == "measured − estimated"
    y = [np.array(curve.y, dtype=float) for curve in (measured, estimated, error)]
    np.testing.assert_allclose(y[2], y[0] - y[1], atol=1e-4)
    assert not any("of no use" in note for note in found.notes)
    small = whole.with_channels({"force": "N"}, force=0.01 * whole["force"])
    workspace.add(small, origin="", call="", name="small")
    estimate(workspace, {"model": "arm", "recording": "small", "name": "again"}, quiet)
    assert "off by more than what was measured" in workspace.estimates()["again"].notes[0]


def test_steps_and_cycles_are_those_of_the_training_recordings(workspace: Workspace) -> None:
    assert pace(workspace, "pi") == (forms.STEP, 10.0, 0.0)
    load("blocks", "process-model").example().save(workspace.path("models", "lag.json"))
    t = np.arange(1200) * 0.1
    wave = 5.0 - 5.0 * np.cos(2 * np.pi * t / 40.0)
    run = Recording({"pressure": 0.3 * wave, "displacement": wave}, 0.1)
    workspace.add(run, origin="", call="", role="train")
    step, usual, shortest = pace(workspace, "lag")
    assert step == 0.1
    assert usual == pytest.approx(shortest, rel=0.05) == pytest.approx(40.0, rel=0.05)

    def told(step: float, seconds: float, model: str = "lag") -> str:
        low, high = (2.0, 8.0)
        drawn = {"displacement": motions.motion("sine", seconds, low, high)}
        wished = motions.reference_recording(drawn, step)
        return " ".join(too_fast(workspace, model, wished))

    assert told(0.1, 80.0) == told(0.01, 8.0, "pi") == ""
    assert "steps take 0.01 s, and those of the training recordings 0.1 s" in told(0.01, 80.0)
    assert "cycles take 4 s, and those of the training recordings" in told(0.1, 8.0)
