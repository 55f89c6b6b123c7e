"""The paper's sequence: in Python and on the command line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from mckibben import Recording, read, write
from mckibben.blocks.compose import Parallel
from mckibben.blocks.force.feedforward import ForceFeedforward
from mckibben.blocks.force.multistate_friction import MultistateFriction
from mckibben.blocks.saving import load
from mckibben.errors import DataError
from mckibben.papers.experiment import reproduce
from mckibben.rigs import load_rig, record
from mckibben.signals.protocol import protocol
from tests.cli.conftest import Cli
from tests.cli.conftest import cli as cli  # a fixture
from tests.refusals import refused

OTHER = {
    "muscle.length": 300.0,
    "muscle.diameter": 20.0,
    "start.length": 300.0,
    "range.length.high": 303.0,
    "range.pressure.high": 9.0,
    "air.supply": 10.0,
}
"""What another stand has: half as long again in length and pressure."""


def test_the_protocol_is_in_proportion_to_the_stand() -> None:
    rig = load_rig("mas10-test-stand")
    same, wide = (protocol("multistate-friction", one) for one in (rig, rig.changed(OTHER)))
    assert same.runs[0].inputs == protocol("multistate-friction").runs[0].inputs
    for run, scaled in zip(same.runs, wide.runs, strict=True):
        for channel in ("length", "pressure"):
            expected = 1.5 * run.inputs[channel]
            np.testing.assert_allclose(scaled.inputs[channel], expected, rtol=1e-12)
    with refused(DataError, channel="length"):
        protocol("multistate-friction", load_rig("mas20-hanging"))


@pytest.mark.long
def test_the_paper_can_be_typed(cli: Cli, tmp_path: Path) -> None:
    """Static law, extraction, friction: commands give the numbers of the re-run."""
    names = (
        "isometric-200mm",
        "isometric-192mm",
        "isometric-184mm",
        "isobaric-4bar",
        "isobaric-2bar",
    )
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
    assert "force" in wrong.err


def test_a_part_is_read(cli: Cli, tmp_path: Path) -> None:
    time = np.arange(500) * 0.02
    u = 2.5 - 2.5 * np.cos(time)
    write(Recording({"pressure": u, "displacement": 2 * u}, 0.02), tmp_path / "run.csv")
    part = ["fit", "pi", tmp_path / "run.csv", "-o", tmp_path / "pi.json", "--json", "--between"]
    for text, n in (("2:6", 200), ("2:", 400), (":6", 300)):
        assert json.loads(cli(*part, text).out)["n_samples"] == n
    for text in ("6", "a:b"):
        assert "START:END" in cli(*part, text).err
