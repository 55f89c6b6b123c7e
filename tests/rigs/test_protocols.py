"""The papers' protocols: what they print, and what recording them gives."""

from __future__ import annotations

import numpy as np
import pytest

from mckibben import DataError, example, read
from mckibben.recording import PROVENANCE
from mckibben.registry import names
from mckibben.rigs import load_rig, record
from mckibben.signals import reversals
from mckibben.signals.protocol import protocol


@pytest.mark.parametrize("name", names("protocols"))
def test_a_protocol_fits_its_rig(name: str) -> None:
    plan = protocol(name)
    rig = load_rig(plan.rig)
    assert len({run.name for run in plan.runs}) == len(plan.runs)
    assert {"train", "test"} <= {run.role for run in plan.runs}
    for run in plan.runs:
        changed = rig.changed(run.settings)
        assert set(run.inputs.channels) <= set(rig.inputs)
        for channel, samples in run.inputs.channels.items():
            limits = changed.limits(channel)
            assert samples.min() >= limits.low, f"{run.name}: {channel}"
            assert samples.max() <= limits.high, f"{run.name}: {channel}"


def test_sdchm_has_the_printed_numbers_of_samples() -> None:
    plan = protocol("sdchm")
    for role, samples in (("train", 104_000), ("validation", 56_000), ("test", 48_000)):
        runs = plan.select(role, stage="network")  # type: ignore[arg-type]
        assert sum(len(run.inputs) for run in runs) == samples
        assert all(run.inputs.sample_time == 1 / 20 for run in runs)
    pressures = {run.labels["p0"] for run in plan.select(stage="network")}
    assert pressures == {round(0.1 * i, 1) for i in range(26)}
    first = plan["gpi-1"].inputs
    assert first.sample_time == 1 / 50
    peaks = [first["pressure_1"][i : i + 2500].max() for i in range(0, 10_000, 2500)]
    assert peaks == pytest.approx([1.0, 1.5, 2.0, 2.5])
    assert first["pressure_1"][::2500] == pytest.approx(0.0)
    assert not first["pressure_2"].any()


def test_sdchm_has_joint_random_runs_that_no_other_role_repeats() -> None:
    plan = protocol("sdchm")
    waves = []
    for role in ("train", "validation", "test"):
        runs = plan.select(role, stage="joint")
        assert {run.labels["extensor"] for run in runs} == {"constant", "moving"}
        for run in runs:
            inputs = run.inputs
            waves += [inputs[f"pressure_{k}"] for k in (1, 2, 3)]
            assert all(wave[0] == 0.0 and np.ptp(wave) > 1.5 for wave in waves[-3:])
            travels = np.ptp(inputs["pressure_extensor"])
            assert travels == 0.0 if run.labels["extensor"] == "constant" else travels > 1.5
            assert run.settings["start.pressure_extensor"] == inputs["pressure_extensor"][0]
    # no two waves are alike, so no run is in another role, and none drives two muscles alike
    likeness = np.corrcoef(waves) - np.eye(len(waves))
    assert np.abs(likeness).max() < 0.95


def test_field_models_starts_at_one_bar_and_falls_each_cycle() -> None:
    falling = protocol("field-models")["decaying-triangle"].inputs["pressure"]
    tops = [falling[i : i + 501].max() for i in range(0, 4500, 500)]
    assert protocol("field-models").select("validation") == ()
    assert falling[0] == falling.min() == 1.0
    assert tops[0] == 5.5
    assert (np.diff(tops) < 0).all()
    irregular = protocol("field-models")["irregular-triangle"].inputs["pressure"]
    assert len(reversals(irregular)) >= 15


def test_mpi_narmax_has_its_four_statuses() -> None:
    plan = protocol("mpi-narmax")
    found = {run.labels["status"]: run for run in plan.runs if "status" in run.labels}
    assert {k: (run.labels["frequency"], run.labels["mass"]) for k, run in found.items()} == {
        1: (0.1, 0.0),
        2: (0.2, 10.04),
        3: (0.2, 21.75),
        4: (0.22, 0.0),
    }
    assert found[4].inputs["force"].max() == pytest.approx(150.0)
    assert found[4].role == "test"
    assert all(run.inputs.sample_time == 0.001 for run in plan.runs)
    voltage = found[1].inputs["voltage"]
    assert (voltage.min(), voltage.max()) == pytest.approx((0.1, 10.0))


def test_activation_pressure_has_28_conditions_twice() -> None:
    plan = protocol("activation-pressure")
    for stage in ("hysteresis", "random"):
        runs = plan.select(stage=stage)
        assert len({(run.labels["force"], run.labels["frequency"]) for run in runs}) == 28
    # y_1 and y_2 of Table 1 at 300 N, in bar.
    wave = plan["sine-300N-1.0Hz"].inputs["pressure"]
    assert (wave.min(), wave.max()) == pytest.approx((2.108, 3.399), abs=0.005)


def test_multistate_holds_lengths_and_pressures() -> None:
    plan = protocol("multistate-friction")
    assert [run.labels["pressure"] for run in plan.select("train", stage="friction")] == [4.0]
    for run in plan.select(stage="static"):
        late = run.inputs["length"][int(run.lead / 0.02) :]
        assert np.ptp(late) == 0.0
        assert late[0] == run.labels["length"]


def test_recording_is_repeatable_whatever_else_is_recorded() -> None:
    (_, alone), *_ = record("field-models", runs=["irregular-triangle"], jobs=1)
    both = {run.name: recording for run, recording in record("field-models")}
    assert both["irregular-triangle"] == alone
    assert alone.meta["role"] == "test"
    assert alone.name == "irregular-triangle"
    other = {run.name: recording for run, recording in record("field-models", seed=1)}
    assert other["irregular-triangle"] != alone
    with pytest.raises(DataError, match="'x'"):
        list(record("field-models", runs=["x"]))
    # a lead is driven, but not recorded
    (run, led), *_ = record("multistate-friction", runs=["isometric-190mm"])
    assert run.lead > 0
    assert led.start_time == 0.0
    assert led.duration == pytest.approx(60.0)
    assert np.ptp(led["length"]) < 0.03


def test_the_examples_are_what_the_rig_records() -> None:
    for run, recording in record("field-models"):
        (stored,) = read(example.FOLDER / f"{run.name}.csv")
        for channel in recording.channels:
            step = load_rig("mas20-hanging").sensor[channel].resolution
            # Another computer may round a sample to the step beside.
            assert stored[channel] == pytest.approx(recording[channel], abs=1.01 * step)
            assert np.mean(stored[channel] == recording[channel]) > 0.99
        told, known = (
            {key: what for key, what in one.meta.items() if key not in PROVENANCE}
            for one in (stored, recording)
        )
        assert told == known
