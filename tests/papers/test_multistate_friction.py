"""The paper's sequence: on one's own recordings, and on the command line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mckibben import Recording, read, write
from mckibben.blocks.compose import Parallel
from mckibben.blocks.force.feedforward import ForceFeedforward
from mckibben.blocks.force.multistate_friction import MultistateFriction
from mckibben.blocks.saving import load
from mckibben.errors import DataError
from mckibben.papers.experiment import reproduce
from mckibben.papers.multistate_friction.run import sort
from mckibben.rigs import Rig, load_rig, record
from mckibben.signals.protocol import protocol
from tests.cli.conftest import Cli
from tests.cli.conftest import cli as cli  # a fixture

OTHER = {
    "muscle.length": 300.0,
    "muscle.diameter": 20.0,
    "start.length": 300.0,
    "range.length.high": 303.0,
    "range.pressure.high": 9.0,
    "air.supply": 10.0,
}
"""What another stand has: half as long again in length and pressure."""

NAMES = ("isometric-300mm", "isometric-288mm", "isometric-276mm", "isobaric-3bar", "isobaric-6bar")


def stripped(rig: Rig, names: tuple[str, ...]) -> tuple[list[Recording], list[Any]]:
    """Return runs of the protocol on a rig without what they are for, and that."""
    recordings, labels = list[Recording](), list[Any]()
    for run, one in record("multistate-friction", rig, runs=names):
        labels.append((run.role, dict(run.labels)))
        meta = {key: value for key, value in one.meta.items() if key not in ("protocol", "role")}
        recordings.append(Recording(one.channels, one.sample_time, units=one.units, meta=meta))
    return recordings, labels


@pytest.fixture(scope="module")
def other() -> tuple[list[Recording], list[Any]]:
    """Runs of another stand, with minor loops at the pressure that identifies."""
    rig = load_rig("mas10-test-stand").changed(OTHER)
    return stripped(rig, (*NAMES, "isobaric-minor-loops"))


def test_the_protocol_is_in_proportion_to_the_stand() -> None:
    rig = load_rig("mas10-test-stand")
    same, wide = (protocol("multistate-friction", one) for one in (rig, rig.changed(OTHER)))
    assert same.runs[0].inputs == protocol("multistate-friction").runs[0].inputs
    for run, scaled in zip(same.runs, wide.runs, strict=True):
        for channel in ("length", "pressure"):
            expected = 1.5 * run.inputs[channel]
            np.testing.assert_allclose(scaled.inputs[channel], expected, rtol=1e-12)
    with pytest.raises(DataError, match="imposes no length"):
        protocol("multistate-friction", load_rig("mas20-hanging"))


def test_own_runs_are_sorted_by_what_was_driven(
    other: tuple[list[Recording], list[Any]],
) -> None:
    recordings, labels = other
    noisy = [
        one.with_channels(
            length=one["length"] + 0.05 * np.random.default_rng(0).standard_normal(len(one)),
            pressure=one["pressure"] + 0.05 * np.random.default_rng(1).standard_normal(len(one)),
        )
        for one in recordings
    ]
    for given in (recordings, noisy):
        found = [(one.role, dict(one.labels)) for one in sort(given) if one]
        assert found == labels
    both = recordings[0].with_channels(length=200.0 + 20.0 * np.sin(recordings[0].time))
    assert sort([*recordings, both])[-1] is None
    with pytest.raises(DataError, match="held at 1 values"):
        sort([recordings[0], *recordings[3:]])
    with pytest.raises(DataError, match="held at 0 values"):
        sort(recordings[:3])
    with pytest.raises(DataError, match="'force'"):
        sort([one.select(["length", "pressure"]) for one in recordings])


@pytest.mark.long
def test_one_loop_of_another_stand_is_enough(other: tuple[list[Recording], list[Any]]) -> None:
    recordings = [*other[0][:3], other[0][4]]
    given = [one.with_meta(name=str(place)) for place, one in enumerate(recordings)]
    both = given[0].with_channels(length=200.0 + 20.0 * np.sin(given[0].time))
    found = reproduce("multistate-friction", data=[*given, both.with_meta(name="odd")], quick=True)
    keys = {table.key for table in found.tables}
    assert keys == {"laws", "static", "closed", "loops", "friction"}
    assert "Recordings that are not used: odd." in found.notes
    search = next(one for one in found.figures if one.key == "search").panels[""]
    for steps, costs in search.values():
        assert np.all(np.diff(steps) > 0)
        assert costs[-1] < 0.8 * costs[0]
    (closed,) = (table for table in found.to_dict()["tables"] if table["key"] == "closed")
    assert closed["rows"][0]["r²"] > 0.99
    assert closed["rows"][0]["RMSE [N]"] < 10.0


@pytest.mark.long
def test_the_paper_can_be_typed(cli: Cli, tmp_path: Path) -> None:
    """Static law, extraction, friction: commands give the numbers of the re-run."""
    names = ("isometric-200mm", "isometric-192mm", "isometric-184mm", "isobaric-4bar")
    files = [tmp_path / f"{name}.csv" for name in names]
    for file, (_, one) in zip(files, record("multistate-friction", runs=names), strict=True):
        write(one, file)
    law, model = tmp_path / "law.json", tmp_path / "model.json"
    assert cli("fit", "force-bilinear", *files[:3], "-o", law).code == 0
    settings = [f"--set={one}" for one in ("static=null", "initial=first_sample", "n_refined=4")]
    given = ["fit", "multistate-11", files[3], *settings, "--between", "15:", "-o", model]
    result = cli(*given, "--residual-of", law, "--json")
    assert result.code == 0, result.err
    data = [one for file in files for one in read(file, informative=False)]
    found = {
        table.key: table for table in reproduce("multistate-friction", data=data, quick=True).tables
    }
    both = load(model)
    assert isinstance(both, Parallel)
    friction = both.parts[1]
    assert isinstance(friction, MultistateFriction)
    rows = {str(row[0]): row for row in found["friction"].rows}
    here = found["friction"].columns.index("here")
    ordered, _ = friction.by_strength()
    for name, value in zip(ordered.parameter_names, ordered.values, strict=True):
        assert value == pytest.approx(rows[name][here], rel=1e-9), name
    rmse = found["closed"].rows[0][found["closed"].columns.index("RMSE [N]")]
    assert json.loads(result.out)["rmse"] == pytest.approx(rmse, rel=1e-9)
    assert ForceFeedforward.of(both) is not None
    wrong = cli(*given, "--residual-of", law, "--output", "pressure")
    assert wrong.code == 2
    assert "gives force" in wrong.err


def test_a_part_is_read(cli: Cli, tmp_path: Path) -> None:
    time = np.arange(500) * 0.02
    u = 2.5 - 2.5 * np.cos(time)
    write(Recording({"pressure": u, "displacement": 2 * u}, 0.02), tmp_path / "run.csv")
    part = ["fit", "pi", tmp_path / "run.csv", "-o", tmp_path / "pi.json", "--json", "--between"]
    for text, n in (("2:6", 200), ("2:", 400), (":6", 300)):
        assert json.loads(cli(*part, text).out)["n_samples"] == n
    for text in ("6", "a:b"):
        assert "START:END" in cli(*part, text).err
