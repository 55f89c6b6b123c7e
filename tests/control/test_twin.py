"""Twins: fitted models as plants."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mckibben import (
    PI,
    Affine,
    Banded,
    DataError,
    ModelError,
    PiecewiseLinear,
    Recording,
    Series,
    load_rig,
    write,
)
from mckibben.blocks.bands import Band
from mckibben.blocks.base import Block
from mckibben.blocks.feedback import PIDFeedback
from mckibben.blocks.fields import Channel
from mckibben.control import Twin, before, slow_cycle, track, tune_pid
from mckibben.control.connecting import flatters_feedback, kind_of
from mckibben.control.uncompensated import curve
from mckibben.registry import load as registered
from mckibben.registry import names
from tests.cli.conftest import Cli
from tests.cli.conftest import cli as cli  # a fixture
from tests.refusals import refused

MODEL = PI.example()
LOW, HIGH = (float(end[0]) for end in MODEL.reachable())
STEP = 0.02


def wave(n: int = 1500) -> Recording:
    t = np.arange(n) * STEP
    middle, half = 0.5 * (LOW + HIGH), 0.35 * (HIGH - LOW)
    return Recording({"displacement": middle + half * np.sin(2 * np.pi * t / 10)}, STEP)


def plants() -> list[Block]:
    """All examples of blocks that can stand where a muscle stands."""
    found = []
    for name in names("blocks"):
        block = registered("blocks", name).example()
        moves = all(c.name.startswith(("displacement", "force")) for c in block.outputs)
        drives = any(c.name.startswith(("pressure", "voltage")) for c in block.inputs)
        if moves and drives and name not in ("banded", "band", "inverse", "load-estimate"):
            found.append(block)
    return found


def test_no_compensation_is_the_middle_of_a_loop() -> None:
    wave_of = wave()
    found = slow_cycle(Twin(MODEL), wave_of)
    knots, pressures = curve(found["pressure"], found["displacement"], "displacement")
    middle = np.interp(found["pressure"], pressures, knots)
    off = middle - found["displacement"]
    half = len(off) // 2
    assert off[:half].mean() == pytest.approx(-off[half:].mean(), rel=0.1)
    assert abs(off[:half].mean()) > 0.01 * (HIGH - LOW)


@pytest.mark.parametrize("block", plants(), ids=lambda block: block.kind)
def test_without_a_band_a_twin_is_simulate_to_the_bit(block: Block) -> None:
    limits, held = {}, {}
    for channel in block.inputs:
        if channel.name.startswith(("pressure", "voltage")):
            limits[channel.name] = (0.5, 4.5)
        else:
            held[channel.name] = {"length": 4.0}.get(channel.name, 2.0)
    twin = Twin(block, limits=limits, held=held, sample_time=block.sample_time or STEP)
    rest = [0.5 if name in limits else held[name] for name in twin.inputs]
    rng = np.random.default_rng(1)
    rows = np.array(
        [rest, *([held.get(n, rng.uniform(0.5, 4.5)) for n in twin.inputs] for _ in range(60))]
    )
    measured = [twin.reset(seed=3), *(twin.step(row) for row in rows[1:])]
    alone = block.simulate(rows, sample_time=twin.sample_time)
    np.testing.assert_array_equal(np.array(measured), alone)
    recording = Recording(dict(zip(twin.inputs, rows.T, strict=True)), twin.sample_time)
    ran = twin.run(recording)
    np.testing.assert_array_equal(ran.matrix(twin.outputs), alone)


def test_a_compensator_beats_no_compensation_and_plants_are_told_apart() -> None:
    with_it = track(MODEL.inverse(), Twin(MODEL), wave())
    without = before(MODEL.inverse(), Twin(MODEL), wave())
    assert with_it.rmse["displacement"] < 1e-9 * (HIGH - LOW)
    assert without.tracked is not None
    assert without.tracked.rmse["displacement"] > 0.02 * (HIGH - LOW)
    assert not without.notes
    compensator = MODEL.inverse()
    assert kind_of(Twin(Banded(MODEL, Band.example())), compensator) == "same model"
    assert kind_of(Twin(registered("blocks", "gpi").example()), compensator) == "another model"
    assert kind_of(load_rig("mas20-hanging"), compensator) == "rig"


def test_pressures_recorded_with_a_reference_are_passed_over() -> None:
    bare = wave(200)
    both = bare.with_channels({"pressure": "bar"}, pressure=np.full(200, 1.15))
    errors = []
    for one in (bare, both):
        without = before(MODEL.inverse(), Twin(MODEL), one, approach=1.0).tracked
        assert without is not None
        errors.append((track(MODEL.inverse(), Twin(MODEL), one, approach=1.0).rmse, without.rmse))
    assert errors[0] == errors[1]


def test_pid_is_tuned_on_a_twin() -> None:
    lagging = Series((MODEL, registered("blocks", "creep").example()))
    pid = tune_pid(Twin(lagging), sample_time=STEP)
    assert isinstance(pid, PIDFeedback)
    assert track(pid, Twin(lagging), wave()).rmse["displacement"] < 0.2 * (HIGH - LOW)
    # a model without time is no plant for feedback
    assert flatters_feedback(Twin(MODEL), "pid")
    assert not flatters_feedback(Twin(MODEL), "feedforward")
    assert not flatters_feedback(Twin(lagging), "pid")
    assert not flatters_feedback(load_rig("mas20-hanging"), "pid")


def test_pid_is_tuned_for_the_steepest_part_of_a_muscle_that_is_flat_in_its_middle() -> None:
    bar, mm = MODEL.input, MODEL.output
    flat = PiecewiseLinear((0.0, 3.0, 5.0, 8.0), (0.0, 10.0, 10.1, 20.0), bar, mm)
    twin = Twin(flat, limits={"pressure": (0.0, 8.0)})
    wanted = Recording(
        {"displacement": 10.0 - 9.0 * np.cos(0.2 * np.pi * STEP * np.arange(1000))}, STEP
    )
    tracked = track(tune_pid(twin, sample_time=STEP), twin, wanted, approach=5.0, settle=2.0)
    assert tracked.rmse["displacement"] < 1.0


def test_pid_is_tuned_where_displacement_falls_as_pressure_rises() -> None:
    turned = Affine(gain=-1.0, offset=20.0, input=MODEL.output, output=MODEL.output)
    twin = Twin(Series((MODEL, turned)), limits={"pressure": (0.0, 8.0)})
    pid = tune_pid(twin, sample_time=STEP)
    assert pid.kp[0] < 0.0
    wanted = Recording({"displacement": 20.0 - wave()["displacement"]}, STEP)
    tracked = track(pid, twin, wanted, approach=5.0, settle=2.0)
    assert tracked.rmse["displacement"] < 0.05 * (HIGH - LOW)
    still = replace(turned, gain=1e-300)
    with refused(ModelError, channel="pressure"):
        tune_pid(Twin(Series((MODEL, still)), limits={"pressure": (0.0, 8.0)}), sample_time=STEP)


def test_feedback_is_the_same_where_everything_counts_the_other_way() -> None:
    def pid(way: float) -> PIDFeedback:
        channels = ((MODEL.output,), (MODEL.input,), (way * 0.5,), (way * 2.0,))
        return PIDFeedback.of(*channels, limits=(0.0, 6.0))

    rng = np.random.default_rng(1)
    inputs = np.cumsum(rng.normal(size=(3000, 2)), axis=0)  # far beyond the limits, both ways
    here, there = pid(1.0).stream(STEP), pid(-1.0).stream(STEP)
    for row in inputs:
        assert np.array_equal(here.step(row), there.step(-row))


@pytest.mark.parametrize(("given", "moved"), [("voltage", "angle"), ("force", "output")])
def test_loops_are_closed_whatever_the_channels_are_called(given: str, moved: str) -> None:
    model = replace(MODEL, input=Channel(given, "V"), output=Channel(moved, "rad"))
    twin = Twin(model, limits={given: (0.0, 8.0)})
    assert twin.driving == {given}
    reference = Recording({moved: wave()["displacement"]}, STEP, units={moved: "rad"})
    tracked = track(model.inverse(), twin, reference, approach=5.0, settle=2.0)
    assert tracked.rmse[moved] < 1e-9
    creep = replace(
        registered("blocks", "creep").example(), input=model.output, output=model.output
    )
    lagging = Twin(Series((model, creep)), limits={given: (0.0, 8.0)})
    assert tune_pid(lagging, sample_time=STEP).outputs[0].name == given


def test_bad_twins_are_refused() -> None:
    for limits in ({"voltage": (0, 1)}, {"pressure": (3, 1)}):
        with refused(DataError, channel=next(iter(limits))):
            Twin(MODEL, limits=limits)
    with refused(DataError, parameter="payload"):
        Twin(MODEL).changed({"payload": 3.0})
    with pytest.raises(DataError):  # before it is reset
        Twin(MODEL).step([1.0])
    discrete = registered("blocks", "transfer-function").example()
    with refused(ModelError, parameter="sample_time", names=0.01):
        Twin(discrete, sample_time=0.02)
    assert Twin(discrete).sample_time == 0.01
    law = registered("blocks", "tondu-lopez").example()
    with refused(DataError, channel="length"):
        Twin(law, limits={"pressure": (0.0, 4.0)}).reset()
    for impossible in (MODEL.inverse(), replace(MODEL, input_range=None)):
        with refused(ModelError, names="pressure"):
            Twin(impossible).reset()


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ([], "--plant"),
        (["--plant", "model.json", "--rig", "mas20-hanging"], "--rig"),
        (["--rig", "mas20-hanging", "--limits", "pressure=0:3"], "limits"),
        (["--plant", "model.json", "--limits", "pressure=0:3:1"], "pressure"),
        (["--plant", "model.json", "--limits", "voltage=0:3"], "voltage"),
        (["--plant", "absent.json"], "absent.json"),
        (
            ["--rig", "mas20-hanging", "--controller", "observer", "--controller-out", "c"],
            "observer",
        ),
    ],
)
def test_bad_plants_are_refused(
    cli: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: list[str], named: str
) -> None:
    monkeypatch.chdir(tmp_path)
    MODEL.save("model.json")
    MODEL.inverse().save("inverse.json")
    write(wave(100), tmp_path / "wished.csv")
    result = cli("track", "inverse.json", "--reference", "wished.csv", *options)
    assert result.code == 2
    assert named in " ".join(result.err.split())


def test_commands_to_an_unpaired_plant_stay_within_its_limits() -> None:
    block = registered("blocks", "coupled-memory").example()
    twin = Twin(block, limits={"pressure_1": (0, 4), "pressure_2": (0, 4)})
    wanted = Recording({"displacement_1": np.full(50, 3.0)}, STEP)
    tracked = before(MODEL.inverse(), twin, wanted, approach=0.2).tracked
    assert tracked is not None
    commands = tracked.recording.matrix(["command_pressure_1", "command_pressure_2"])
    assert 0.0 <= commands.min() <= commands.max() <= 4.0


def test_what_is_out_of_reach_is_counted_and_told_apart() -> None:
    """On the model itself all error is there, though the plant takes all pressures of the model."""
    wanted = wave(500)
    far = wanted["displacement"] + np.where(np.arange(500) > 400, HIGH, 0.0)
    wanted = Recording({"displacement": far}, STEP)
    found = track(MODEL.inverse(), Twin(MODEL), wanted, approach=1.0)
    beyond = found.beyond["displacement"]
    due = np.concatenate([far[:1], far[:-1]])
    assert beyond.samples == found.clipped == np.count_nonzero(due > HIGH)
    assert (beyond.low, beyond.high) == (LOW, HIGH)
    assert beyond.rmse_elsewhere < 1e-9 < found.rmse["displacement"]
    assert not track(MODEL.inverse(), Twin(MODEL), wave(100), approach=1.0).beyond
