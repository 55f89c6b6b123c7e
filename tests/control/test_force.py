"""Force followed by feedforward where the length is imposed."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from mckibben import Recording, write
from mckibben.blocks.compose import Parallel
from mckibben.blocks.force.feedforward import ForceFeedforward
from mckibben.blocks.force.multistate_friction import EACH_WAY, MultistateFriction
from mckibben.blocks.play_type.pi import PI
from mckibben.control import Twin, track
from mckibben.papers.multistate_friction.published import static_force
from tests.cli.conftest import Cli
from tests.cli.conftest import cli as cli  # a fixture

LAW = static_force()
FRICTION = MultistateFriction(
    EACH_WAY,
    (*(7.0, 5e-3, 52.0, 5e-3, 60.0), *(5.0, 5e-3, 30.0), *(12.0, 5e-3, 50.0)),
    initial="virgin",
)
MODEL = Parallel((LAW, FRICTION))


STAND = Twin(MODEL, limits={"pressure": (-9.0, 9.0)}, sample_time=0.02)


def reference() -> Recording:
    time = np.arange(600) * 0.02
    length = 194.0 + 6.0 * np.cos(2 * np.pi * time / 10)
    return Recording({"force": 150.0 + 30.0 * np.sin(time), "length": length}, 0.02)


def test_feedforward_gives_the_force_exactly_where_the_model_is_the_plant() -> None:
    ahead = ForceFeedforward.of(MODEL)
    assert ahead is not None
    found = track(ahead, STAND, reference(), approach=2.0, pressure_loop=False)
    assert found.rmse["force"] < 1e-9
    assert found.recording.units["reference_force"] == "N"
    assert ForceFeedforward.of(LAW) == ForceFeedforward(LAW)
    blind = track(ForceFeedforward(LAW), STAND, reference(), approach=2.0, pressure_loop=False)
    assert blind.rmse["force"] > 30.0
    assert ForceFeedforward.of(PI.example()) is None


def test_commands_follow_a_force_on_the_test_stand(cli: Cli, tmp_path: Path) -> None:
    wanted = tmp_path / "wanted.csv"
    write(reference().slice(0, 300), wanted)
    reached = {}
    for name, model in (("friction", MODEL), ("static", LAW)):
        model.save(tmp_path / f"{name}.json")
        ahead = tmp_path / f"{name}-ahead.json"
        result = cli("invert", tmp_path / f"{name}.json", "-o", ahead)
        assert result.code == 0, result.err
        options = ["--rig", "mas10-test-stand", "--reference", wanted, "--approach", 2]
        result = cli("track", ahead, *options, "--json")
        assert result.code == 0, result.err
        reached[name] = json.loads(result.out)["rmse"]["force"]
    assert reached["friction"] < 0.7 * reached["static"]
    assert cli("track", ahead, *options, "--controller", "pid").code == 2
    without = tmp_path / "without.csv"
    write(reference().select(["force"]), without)
    result = cli("track", ahead, "--rig", "mas10-test-stand", "--reference", without)
    assert result.code == 2
    assert "length" in result.err


def test_runs_that_hold_the_length_are_fitted_together(cli: Cli, tmp_path: Path) -> None:
    files = [tmp_path / f"{length}.csv" for length in (190, 194, 198)]
    for file in files:
        held = {"length": np.full(50, float(file.stem)), "pressure": np.linspace(0.0, 4.0, 50)}
        run = Recording(held, 0.1)
        write(run.with_channels(force=LAW.simulate(run)["force"]), file)
    options = ["--input", "length", "--output", "force", "-o", tmp_path / "law.json"]
    result = cli("fit", "force-bilinear", *files, *options, "--json")
    assert result.code == 0, result.err
    assert json.loads(result.out)["rmse"] < 1e-6
    alone = cli("fit", "force-bilinear", files[0], *options)
    assert alone.code == 2
    assert "length" in alone.err
