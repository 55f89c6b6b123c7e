"""Recordings of rigs of any size are recognised as runs of a paper, whatever their names."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mckibben import Recording, registry
from mckibben.channels import renamed
from mckibben.errors import DataError
from mckibben.files.headers import by_words
from mckibben.papers.paper import paper as about
from mckibben.papers.recognising import Recognised, of_its_size, recognise
from mckibben.rigs import Rig, load_rig
from mckibben.signals.features import grouped
from mckibben.signals.protocol import PlannedRun, Protocol, protocol, scaling
from tests.refusals import refused

SMALLER: dict[str, dict[str, Any]] = {
    "field-models": {"range.pressure.high": 3.0, "start.pressure": 0.5},
    "mpi-narmax": {"range.voltage.high": 5.0, "range.force.high": 120.0},
    "multistate-friction": {
        "range.pressure.high": 3.0,
        "range.length.high": 303.0,
        "muscle.length": 300.0,
        "start.length": 300.0,
    },
    "activation-pressure": {"range.pressure.high": 2.5, "range.force.high": 120.0},
    "sdchm": {"range.pressure.high": 1.25},
}
"""Rigs of another size than the papers'."""

PAPERS = registry.names("papers")


def rig_of(paper: str, size: str) -> Rig:
    rig = load_rig(protocol(paper).rig)
    return rig.changed(SMALLER[paper]) if size == "smaller" else rig


def measured(run: PlannedRun, name: str) -> Recording:
    """Return a recording of a run, as far as recognition goes: its commands with noise."""
    rng = np.random.default_rng(len(name))
    lead = round(run.lead / run.inputs.step)
    inputs = run.inputs.slice(lead, len(run.inputs))
    channels = dict(inputs.channels)
    if "force" in channels:
        channels["force"] = channels["force"] + 9.81 * run.settings.get("payload", 0.0)
    channels = {k: x + 0.001 * rng.standard_normal(x.size) for k, x in channels.items()}
    still = np.zeros(len(inputs))
    for channel in ("displacement", "contraction", "force", "displacement_1"):
        channels.setdefault(channel, still)
    return Recording(channels, inputs.step, meta={"name": name})


def found_of(plan: Protocol, paper: str) -> tuple[Recognised, dict[str, PlannedRun]]:
    named = {f"{2026 + k}": run for k, run in enumerate(plan.runs)}
    return recognise(paper, [measured(run, name) for name, run in named.items()]), named


@pytest.mark.parametrize("size", ["paper's", "smaller"])
@pytest.mark.parametrize("paper", PAPERS)
def test_runs_are_recognised_by_their_signals(paper: str, size: str) -> None:
    plan = protocol(paper, rig_of(paper, size))
    found, named = found_of(plan, paper)
    assert found.absent == ""
    assert [row[0] for row in found.rows] == [*named]
    assert of_its_size(paper, found.runs) == (size == "paper's")
    for name, run in named.items():
        role, labels = found.runs.labels[name]
        if run.labels.get("stage") == "joint":
            continue  # all alike, so that roles are by order
        assert role == run.role, run.name
        for key in {*run.labels} - {"start"} - ({"stage"} if "status" in run.labels else set()):
            planned = run.labels[key]
            if isinstance(planned, float):
                assert labels[key] == pytest.approx(planned, rel=0.03, abs=0.05), (run.name, key)
            else:
                assert labels[key] == planned, (run.name, key)


@pytest.mark.parametrize("size", ["paper's", "smaller"])
@pytest.mark.parametrize("paper", PAPERS)
def test_no_command_is_beyond_the_rig(paper: str, size: str) -> None:
    rig = rig_of(paper, size)
    for run in protocol(paper, rig).runs:
        changed = rig.changed(run.settings)
        for channel, (low, high) in run.inputs.ranges.items():
            limits = changed.limits(channel)
            assert limits.low - 1e-9 <= low <= high <= limits.high + 1e-9, (run.name, channel)
    factors = {one.factor for one in scaling(paper, rig)}
    assert (factors == {1.0}) == (size == "paper's")


@pytest.mark.parametrize("paper", PAPERS)
def test_all_kinds_that_are_missing_are_named_at_once(paper: str) -> None:
    run = protocol(paper).runs[-1]  # random, ours, or a test
    with refused(DataError) as told:
        recognise(paper, [measured(run, "a")])
    needed = [kind.what for kind in about(paper).runs.values() if kind.least]
    missing = [what for what in needed if what in told.value.problem]
    assert len(missing) >= max(len(needed) - 1, 1)


def test_channels_of_other_names_are_known_by_their_units() -> None:
    plan = protocol("field-models")
    own = [
        Recording(
            {"regulator": one["pressure"], "wire": one["displacement"]},
            one.step,
            units={"regulator": "bar", "wire": "mm"},
            meta={"name": name},
        )
        for name, one in ((run.name, measured(run, run.name)) for run in plan.runs)
    ]
    found = recognise("field-models", own)
    assert found.by_units == {"regulator": "pressure", "wire": "displacement"}
    assert found.runs.names("train") == ["decaying-triangle"]


def alone(one: Recording, names: dict[str, str], **more: Any) -> Recording:
    channels = {own: one[name] for name, own in names.items()} | more
    units = {name: "bar" if name.startswith("p") else "mm" for name in channels}
    return Recording(channels, one.step, units=units, meta={"name": str(one.meta["name"])})


def test_of_several_muscles_the_one_that_moves_is_the_papers() -> None:
    names = {"pressure": "p2_ist", "displacement": "laser2"}
    own = []
    for run in protocol("field-models").runs:
        still = np.zeros(len(one := measured(run, run.name)))
        own.append(alone(one, names, p1_ist=still, laser1=still))
    found = recognise("field-models", [by_words_of(one) for one in own])
    assert {*found.by_units.values()} == {"pressure", "displacement"}
    assert all("2" in own for own in found.by_units)
    assert found.runs.names("train") == ["decaying-triangle"]


def by_words_of(one: Recording) -> Recording:
    """Return a recording as a file of its columns is read."""
    return renamed(one, by_words({name: one.units[name] or "" for name in one}))


def test_beside_numbered_pressures_that_of_another_name_is_the_extensors() -> None:
    names = {"pressure_extensor": "p_core"} | {f"pressure_{k}": f"pressure_{k}" for k in (1, 2, 3)}
    names["displacement_1"] = "displacement_1"
    runs = [measured(run, f"{k}") for k, run in enumerate(protocol("sdchm").runs)]
    own = [alone(one, names) for one in runs]
    found = recognise("sdchm", own)
    assert found.by_units == {"p_core": "pressure_extensor"}
    assert found.absent == ""


def test_a_supply_beside_the_muscle_is_not_its_pressure() -> None:
    own = []
    for run in protocol("field-models").runs:
        supply = np.full(len(one := measured(run, run.name)), 7.0)
        own.append(alone(one, {"pressure": "pressure_1", "displacement": "wire"}, p_supply=supply))
    found = recognise("field-models", own)
    assert found.by_units["pressure_1"] == "pressure"
    assert max(one["pressure"].max() for one in found.runs.values()) < 7.0


def test_what_a_channel_measures_is_the_same_in_all_runs() -> None:
    own = []
    for place, run in enumerate(protocol("field-models").runs):
        one = measured(run, f"{place}")
        wire = 200.0 * (place % 2) + 10 * one["pressure"]  # alone, one of two is as a length
        own.append(alone(one, {"pressure": "pressure"}, wire=wire))
    assert recognise("field-models", own).by_units == {"wire": "displacement"}


def test_pulls_of_the_wrong_sign_are_refused() -> None:
    own = [measured(run, run.name) for run in protocol("mpi-narmax").runs]
    turned = [one.with_channels(force=-one["force"]) for one in own]
    with pytest.raises(DataError) as refused:
        recognise("mpi-narmax", turned)
    assert refused.value.channel == "force"


def test_levels_are_split_where_their_group_is_too_wide() -> None:
    assert grouped([49, 50, 51, 52, 53, 54, 200, 201], 4.0)[-2:] == [200.0, 200.0]
    assert grouped([0.0, 0.1], 0.0) == [0.0, 0.1]
