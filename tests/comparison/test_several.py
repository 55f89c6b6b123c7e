"""What models of several muscles are chosen on, and that the test has no say."""

from __future__ import annotations

import numpy as np
import pytest

from mckibben import GPI, DataError, Recording, compare
from mckibben.channels import Channels, channels_of, held_at_levels
from mckibben.comparison.planning import plan_of
from mckibben.signals import triangle
from mckibben.splits import held_out
from tests.refusals import refused

TIME = np.arange(0, 20, 0.05)
INPUTS, OUTPUTS = ("pressure_1", "pressure_2"), ("displacement_1", "displacement_2")
CHANNELS = Channels(INPUTS, OUTPUTS)


def run(peak: float, seed: int = 0) -> Recording:
    rng = np.random.default_rng(seed)
    waves = {name: triangle(TIME + k, 4.0, peak) for k, name in enumerate(INPUTS, start=1)}
    moved = [GPI.example().simulate(wave) for wave in waves.values()]
    mixed = {
        name: moved[k] - 0.2 * moved[1 - k] + 0.02 * rng.standard_normal(TIME.size)
        for k, name in enumerate(OUTPUTS)
    }
    return Recording(waves | mixed, 0.05)


def test_channels_are_found_by_name() -> None:
    assert channels_of([run(3.0)], None, None, None) == CHANNELS
    assert channels_of([run(3.0)], "pressure", "displacement_1", None).outputs == OUTPUTS[:1]
    names = ("pressure", "voltage", "displacement", "force")
    single = Recording(dict.fromkeys(names, TIME.astype(np.float64)))
    assert channels_of([single], None, None, None).inputs == ("pressure",)
    assert channels_of([single], None, None, "force").inputs == ("pressure",)
    t = TIME.astype(np.float64)
    wing = Recording({"voltage": t, "angle": t}, 0.1)
    assert channels_of([wing], None, None, None) == Channels(("voltage",), ("angle",))
    arm = Recording({"voltage_1": t, "voltage_2": t, "angle_1": t, "angle_2": t}, 0.1)
    found = channels_of([arm], None, None, None)
    assert found == Channels(("voltage_1", "voltage_2"), ("angle_1", "angle_2"))
    with refused(DataError, channel="weight"):
        channels_of([single], None, None, "weight")


def test_the_order_of_recordings_does_not_decide_the_channels() -> None:
    less = run(3.0).select(["pressure_1", "pressure_2", "displacement_1"])
    for runs in ([less, run(3.0)], [run(3.0), less]):
        assert channels_of(runs, None, None, None) == CHANNELS
        with refused(DataError, channel="displacement_2"):
            compare(runs, models=["coupled-memory"], jobs=1)


@pytest.mark.parametrize("load", [*INPUTS, *OUTPUTS])
def test_no_model_is_told_what_it_is_to_give(load: str) -> None:
    with refused(DataError, channel=load):
        channels_of([run(3.0)], INPUTS, OUTPUTS, load)
    found = channels_of([run(3.0)], scheduling=load)
    assert load not in (*found.inputs, *found.outputs)


def hung(load: float, seed: int = 0) -> Recording:
    """Return a muscle under a dead load that stretches it."""
    moved = GPI.example().simulate(wave := triangle(TIME + seed, 7.0, 4.0)) - 0.2 * load
    moved += 0.01 * np.random.default_rng(seed).standard_normal(TIME.size)
    channels = {"pressure": wave, "displacement": moved, "force": np.full(TIME.size, load)}
    return Recording(channels, 0.05, meta={"name": f"under {load:g} N"})


def test_a_force_beside_other_inputs_is_given_and_never_commanded() -> None:
    runs = [hung(10.0), hung(20.0, 1)]
    told = Channels(("pressure",), ("displacement",), ("force",), held=("force",))
    assert channels_of(runs, ["pressure", "force"], None, None) == told
    found = channels_of(runs, "force")
    assert (found.inputs, found.outputs, found.unused) == (("force",), told.outputs, told.inputs)
    both = ["pressure", "force"]
    plan = plan_of(runs, [], input=both, models=["balance"], seed=0)
    assert plan.empty.inputs == ("pressure",)
    with refused(DataError, channel="force"):
        plan_of([*runs, hung(5.0).select(["pressure", "displacement"])], input=both)


def test_only_what_is_held_at_a_level_of_each_recording_is_held_at_levels() -> None:
    shaken = 0.3 * np.random.default_rng(0).random(TIME.size)
    noisy = [run.with_channels(force=run["force"] + shaken) for run in (hung(10.0), hung(20.0, 1))]
    assert held_at_levels([hung(10.0), hung(20.0)], "force")
    assert held_at_levels(noisy, "force")
    assert not held_at_levels([hung(10.0), hung(10.0)], "force")
    varied = hung(10.0).with_channels(force=TIME.astype(float))
    assert not held_at_levels([varied, hung(20.0)], "force")


def test_levels_of_what_schedules_are_held_out() -> None:
    levels = (0.0, 0.5, 1.0, 2.0)
    runs = [
        run(3.0, seed).with_channels(pressure_extensor=np.full(TIME.size, level))
        for level in levels
        for seed in (1, 2)
    ]
    split = held_out(runs, channels_of(runs))
    assert [one["pressure_extensor"][0] for one in split.test] == [0.5, 0.5]
    assert "pressure_extensor" in split.described
    many = [run(3.0, seed) for seed in range(6)]
    assert held_out(many, CHANNELS).test == (many[2], many[5])
    few = held_out([run(3.0)], CHANNELS)
    assert few.train[0].n_samples < few.test[0].n_samples


def test_of_runs_that_each_hold_the_input_the_last_at_each_level_are_held_out() -> None:
    def held(length: float) -> Recording:
        channels = {"length": np.full(50, length), "force": np.linspace(0, length, 50)}
        return Recording(channels, 0.05, {"length": "mm", "force": "N"})

    runs = [held(length) for length in (100.0, 90.0, 80.0, 100.0, 80.0, 90.0)]
    channels = channels_of(runs, "length", "force")
    twice = held_out(runs, channels)
    assert [run["length"][0] for run in twice.train] == [100.0, 90.0, 80.0]
    assert [run["length"][0] for run in twice.test] == [100.0, 80.0, 90.0]
    once = held_out(runs[:3], channels)
    assert [run["length"][0] for run in once.test] == [90.0]


def test_models_without_a_place_are_left_out_and_said() -> None:
    runs = [run(5.0), run(4.0)]
    several = plan_of(runs, run(3.0, 4), models="all", seed=0)
    assert {"balance", "tsfnn"} <= set(several.items)
    assert "pressure_1" in several.empty.left_out["sdchm"]
    alone = [run(5.0).with_channels(**{name: np.zeros(TIME.size)}) for name in INPUTS]
    told = plan_of([*runs, *alone], run(3.0, 4), models="all", seed=0)
    assert {"sdchm", "balance", "tsfnn"} <= set(told.items)
    assert "gpi" in several.empty.left_out
    assert "mpi-narmax" in several.empty.left_out
    one = run(5.0).select(["pressure_1", "displacement_1"])
    single = plan_of([one], (), models="all", seed=0)
    assert "gpi" in single.items
    assert "sdchm" in single.empty.left_out


def test_outputs_of_different_units_have_no_mean() -> None:
    one = run(3.0)
    mixed = one.with_channels(force=one["displacement_2"])
    with refused(DataError, parameter="output", names="'force'"):
        compare(mixed, output=["displacement_1", "force"], models=["coupled-memory"], jobs=1)
