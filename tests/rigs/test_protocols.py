"""The papers' protocols: what they print, and what recording them gives."""

from __future__ import annotations

import numpy as np
import pytest

from mckibben import DataError, example, read
from mckibben.recording import PROVENANCE
from mckibben.registry import names
from mckibben.rigs import load_rig, record
from mckibben.signals.protocol import protocol
from tests.refusals import refused


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


def test_recording_is_repeatable_whatever_else_is_recorded() -> None:
    (_, alone), *_ = record("field-models", runs=["irregular-triangle"], jobs=1)
    both = {run.name: recording for run, recording in record("field-models")}
    assert both["irregular-triangle"] == alone
    assert alone.meta["role"] == "test"
    assert alone.name == "irregular-triangle"
    other = {run.name: recording for run, recording in record("field-models", seed=1)}
    assert other["irregular-triangle"] != alone
    with refused(DataError, names="'x'"):
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
