"""Force followed by feedforward where the length is imposed."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mckibben import Recording, write
from mckibben.blocks.compose import Parallel
from mckibben.blocks.force.feedforward import ForceFeedforward
from mckibben.blocks.force.multistate_friction import EACH_WAY, MultistateFriction
from mckibben.blocks.play_type.pi import PI
from mckibben.control import track
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


class Stand:
    """A plant that is the model itself, its length imposed."""

    name = "stand"
    inputs = ("pressure", "length")
    outputs = ("pressure", "length", "force")

    def __init__(self, step: float = 0.02, length: float = 200.0) -> None:
        self.time, self.length = step, length

    def changed(self, settings: Mapping[str, Any]) -> Stand:
        return Stand(settings["sample_time"], settings["start.length"])

    def limits(self, name: str) -> SimpleNamespace:
        low, high = {"length": (150.0, 250.0)}.get(name, (-9.0, 9.0))
        return SimpleNamespace(low=low, high=high)

    def reset(self, seed: int = 0) -> np.ndarray:
        self.stream = MODEL.stream(self.time)
        return np.array([0.0, self.length, 0.0])

    def step(self, action: Any) -> np.ndarray:
        force = float(self.stream.step([action["length"], action["pressure"]])[0])
        return np.array([action["pressure"], action["length"], force])


def reference() -> Recording:
    time = np.arange(600) * 0.02
    length = 194.0 + 6.0 * np.cos(2 * np.pi * time / 10)
    return Recording({"force": 150.0 + 30.0 * np.sin(time), "length": length}, 0.02)


def test_feedforward_gives_the_force_exactly_where_the_model_is_the_plant() -> None:
    ahead = ForceFeedforward.of(MODEL)
    assert ahead is not None
    found = track(ahead, Stand(), reference(), approach=2.0, pressure_loop=False)
    assert found.rmse["force"] < 1e-9
    assert found.recording.units["reference_force"] == "N"
    assert ForceFeedforward.of(LAW) == ForceFeedforward(LAW)
    blind = track(ForceFeedforward(LAW), Stand(), reference(), approach=2.0, pressure_loop=False)
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
    files = []
    pressure = np.linspace(0.0, 4.0, 50)
    for length in (190.0, 194.0, 198.0):
        run = Recording({"length": np.full(50, length), "pressure": pressure}, 0.1)
        files.append(tmp_path / f"{length:.0f}.csv")
        write(run.with_channels(force=LAW.simulate(run)["force"]), files[-1])
    channels = ["--input", "length", "--output", "force"]
    result = cli("fit", "force-bilinear", *files, *channels, "-o", tmp_path / "law.json", "--json")
    assert result.code == 0, result.err
    assert json.loads(result.out)["rmse"] < 1e-6
    alone = cli("fit", "force-bilinear", files[0], *channels, "-o", tmp_path / "law.json")
    assert alone.code == 2
    assert "length" in alone.err


@pytest.mark.parametrize("elements", [EACH_WAY, ("shared", "both", "shortening")])
def test_every_value_of_friction_has_a_name(elements: Any) -> None:
    n = {"shared": 5, "both": 6, "lengthening": 3, "shortening": 3}
    size = sum(n[element] for element in elements)
    friction = MultistateFriction(elements, tuple(1.0 + place for place in range(size)))
    named = dict(zip(friction.parameter_names, friction.pack().tolist(), strict=True))
    columns = {"lengthening": 0, "shortening": 3}
    quantities = ("k [N/mm]", "sigma [N s/mm]", "F_c [N]")
    for place, row in enumerate(friction.table(), start=1):
        for way, first in columns.items():
            if row[first + 2] == 0:
                continue
            for offset, quantity in enumerate(quantities):
                shared = f"element {place}: {quantity}"
                told = f"element {place}, {way}: {quantity}"
                assert named[shared if shared in named else told] == row[first + offset]
    assert Parallel((LAW, friction)).parameter_names[-size:] == friction.parameter_names
