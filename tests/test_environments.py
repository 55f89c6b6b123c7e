"""Gymnasium environments: the checker passes, plants are twins and models too, seeds mean something."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mckibben import PI
from mckibben.control import Twin
from mckibben.rigs import load_rig, rig_names

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.utils.env_checker import check_env  # noqa: E402

import mckibben.environments as environments  # noqa: E402
from tests.refusals import refused  # noqa: E402

IDS = sorted(name for name in gymnasium.registry if name.startswith("mckibben/"))


def test_every_rig_with_displacement_is_registered() -> None:
    expected = {
        f"mckibben/{name}-v{load_rig(name).version}"
        for name in rig_names()
        if "displacement" in load_rig(name).sensor
    }
    assert set(IDS) == expected
    assert len(IDS) >= 4


@pytest.mark.parametrize("name", IDS)
def test_gymnasiums_own_checker_passes(name: str) -> None:
    check_env(gymnasium.make(name, duration=1.0).unwrapped)


def episode(env: Any, act: Callable[[np.ndarray, dict[str, Any]], Any], seed: int = 0) -> list[Any]:
    seen, info = env.reset(seed=seed)
    steps = []
    while True:
        seen, reward, terminated, truncated, info = env.step(act(seen, info))
        steps.append((seen, reward, info))
        assert not terminated
        assert env.observation_space.contains(seen)
        if truncated:
            return steps


@pytest.mark.parametrize(
    ("options", "fields"),
    [
        ({"rig": "mas10-test-stand"}, {"channel": "displacement"}),
        ({"rig": "crane"}, {"names": "'crane'"}),
        ({"control_time": 0.0}, {"parameter": "control_time"}),
        ({"duration": 0.0}, {"parameter": "duration"}),
        ({"duration": float("nan")}, {"parameter": "duration"}),
        ({"preview": -1}, {"parameter": "preview"}),
        ({"effort": -1.0}, {"parameter": "effort"}),
        ({"load": 5.0}, {"parameter": "load"}),
        ({"settings": {"payload": -1}}, {"names": "payload"}),
        ({"plant": 3}, {"parameter": "plant"}),
        ({"plant": "absent.json"}, {"file": "absent.json"}),
        ({"plant": PI.example().inverse()}, {"names": "'pi-inverse'"}),
        ({"plant": Twin(PI.example()), "load": 5.0}, {"parameter": "load"}),
        ({"plant": Twin(PI.example())}, {"parameter": "control_time"}),
    ],
)
def test_impossible_options_are_refused(options: dict[str, Any], fields: dict[str, Any]) -> None:
    with refused(**fields):
        environments.Tracking(**options)


def test_settings_and_loads_are_those_of_the_rig() -> None:
    ends = []
    for payload, load in ((0.5, 50.0), (0.5, 250.0), (3.0, 50.0)):
        settings = {"payload": payload}
        env = environments.Tracking("rail", duration=1.0, load=load, settings=settings)
        steps = episode(env, lambda *_: np.ones(1, np.float32))
        ends.append(float(steps[-1][2]["displacement"][0]))
    assert ends[1] < ends[0]
    assert ends[2] != ends[0]


def test_a_twin_of_ones_own_muscle_is_an_environment() -> None:
    inverse = PI.example().inverse()

    def errors(twin: Twin, seed: int) -> Any:
        env = environments.Tracking(plant=twin, control_time=0.02, duration=4.0, preview=1)
        stream = inverse.stream()

        def act(seen: np.ndarray, info: dict[str, Any]) -> np.ndarray:
            ahead = float(env._reference[len(env._measured), 0])  # what is due at the next step
            return np.array(2.0 * stream.step(ahead) / 5.0 - 1.0)

        return np.array([float(info["error"][0]) for _, _, info in episode(env, act, seed)])

    twin = Twin(PI.example())
    check_env(
        environments.Tracking(plant=twin, control_time=0.02, duration=1.0), skip_render_check=True
    )
    assert np.abs(errors(twin, 1)[20:]).max() < 1e-6  # once the start is forgotten


def test_a_model_or_its_file_is_a_plant(tmp_path: Path) -> None:
    model = PI.example()
    model.save(tmp_path / "mine.json")
    found = []
    for plant in (model, tmp_path / "mine.json", str(tmp_path / "mine.json")):
        env = environments.Tracking(plant=plant, control_time=0.02, duration=1.0)
        env.reset(seed=1)
        found.append(env.step(np.array([0.5], dtype=np.float32))[4])
        # which measures no pressure
        assert found[-1]["pressure"] == pytest.approx([0.75 * 5.0])
        assert found[-1]["displacement"] == found[0]["displacement"]
