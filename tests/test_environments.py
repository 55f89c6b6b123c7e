"""Gymnasium environments: the checker passes, the task can be solved, seeds mean something."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mckibben import PI, DataError, ModelError
from mckibben.blocks.bands.band import Band
from mckibben.blocks.bands.banded import Banded
from mckibben.control import Twin
from mckibben.rigs import load_rig, rig_names

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.utils.env_checker import check_env  # noqa: E402

import mckibben.environments as environments  # noqa: E402

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


class Integrator:
    """Feedback of what the last actions made of the error, in actions over millimetres."""

    def __init__(self, proportional: float, integral: float) -> None:
        self.proportional, self.integral, self.sum = proportional, integral, -1.0

    def __call__(self, seen: np.ndarray, info: dict[str, Any]) -> np.ndarray:
        error = -float(info["error"][0])
        self.sum = float(np.clip(self.sum + self.integral * error, -1.0, 1.0))
        return np.clip([self.sum + self.proportional * error], -1, 1).astype(np.float32)


@pytest.mark.parametrize("reference", ["random-wave", "irregular-triangle", "sine"])
def test_feedback_solves_the_task_and_chance_does_not(reference: str) -> None:
    env = gymnasium.make("mckibben/mas20-hanging-v2", duration=8.0, reference=reference)
    rng = np.random.default_rng(0)
    chance = episode(env, lambda *_: rng.uniform(-1, 1, 1).astype(np.float32))
    control = episode(env, Integrator(0.015, 0.01))
    assert len(control) == len(chance) == 400
    errors = [
        np.mean([abs(info["error"][0]) for _, _, info in steps[100:]])
        for steps in (control, chance)
    ]
    assert errors[0] < 0.25 * errors[1]
    assert errors[0] < 1.5
    rewards = [sum(reward for _, reward, _ in steps) for steps in (control, chance)]
    assert rewards[0] > rewards[1]


def test_an_episode_is_repeatable_for_its_seed() -> None:
    env = gymnasium.make("mckibben/soft-arm-v2", duration=1.0, preview=3, spread=0.1)

    def act(seen: np.ndarray, info: dict[str, Any]) -> np.ndarray:
        return np.full(4, 0.2, np.float32)

    first, again = episode(env, act, seed=4), episode(env, act, seed=4)
    other = episode(env, act, seed=5)
    assert all(np.array_equal(a[0], b[0]) for a, b in zip(first, again, strict=True))
    assert not np.array_equal(first[-1][0], other[-1][0])
    assert first[0][0].shape == (3 * 5 + 4 + 4,)
    assert first[-1][2]["pressure"] == pytest.approx(1.5, abs=0.1)


@pytest.mark.parametrize(
    ("options", "about"),
    [
        ({"rig": "mas10-test-stand"}, "displacement"),
        ({"rig": "crane"}, "'crane'"),
        ({"control_time": 0.0}, "control_time"),
        ({"duration": 0.0}, "duration"),
        ({"duration": float("nan")}, "duration"),
        ({"reference": "square"}, "'square'"),
        ({"preview": -1}, "preview"),
        ({"effort": -1.0}, "effort"),
        ({"spread": 2.0}, "spread"),
        ({"load": 5.0}, "load"),
        ({"settings": {"payload": -1}}, "payload"),
        ({"render_mode": "human"}, "render_mode"),
        ({"plant": 3}, "plant"),
        ({"plant": "absent.json"}, "absent"),
        ({"plant": PI.example().inverse()}, "inverse"),
        ({"plant": Twin(PI.example()), "spread": 0.1}, "spread"),
        ({"plant": Twin(PI.example()), "load": 5.0}, "load"),
    ],
)
def test_impossible_options_are_refused(options: dict[str, Any], about: str) -> None:
    with pytest.raises((DataError, ModelError), match=about):
        environments.Tracking(**options)


def test_settings_loads_and_pictures_are_those_of_the_rig() -> None:
    env = environments.Tracking(
        "rail", duration=1.0, load=50.0, settings={"payload": 3.0}, render_mode="rgb_array"
    )
    env.reset(seed=0)
    env.step(np.zeros(1, np.float32))
    picture = env.render()
    assert picture.shape == (300, 600, 3)
    assert np.ptp(picture) > 100
    pulled = []
    for load in (50.0, 250.0):
        env = environments.Tracking(load_rig("rail"), duration=1.0, load=load)
        steps = episode(env, lambda *_: np.ones(1, np.float32))
        pulled.append(float(steps[-1][2]["displacement"][0]))
    assert pulled[1] < pulled[0]


def test_a_twin_of_ones_own_muscle_is_an_environment() -> None:
    inverse = PI.example().inverse()

    def errors(twin: Twin, seed: int) -> Any:
        env = environments.Tracking(plant=twin, duration=4.0, preview=1)
        stream = inverse.stream()

        def act(seen: np.ndarray, info: dict[str, Any]) -> np.ndarray:
            ahead = float(env._wanted[len(env._done), 0])  # what is due at the next step
            return np.array(2.0 * stream.step(ahead) / 5.0 - 1.0)

        return np.array([float(info["error"][0]) for _, _, info in episode(env, act, seed)])

    bare, scattering = Twin(PI.example()), Twin(Banded(PI.example(), Band.example()))
    check_env(environments.Tracking(plant=scattering, duration=1.0), skip_render_check=True)
    assert np.abs(errors(bare, 1)[20:]).max() < 1e-6  # once the start is forgotten
    first, again, other = (errors(scattering, seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)
    assert first.std() > 0.05


def test_a_model_or_its_file_is_a_plant(tmp_path: Path) -> None:
    model = PI.example()
    model.save(tmp_path / "mine.json")
    found = []
    for plant in (model, tmp_path / "mine.json", str(tmp_path / "mine.json")):
        env = environments.Tracking(plant=plant, duration=1.0)
        env.reset(seed=1)
        found.append(env.step(np.array([0.5], dtype=np.float32))[4])
        # which measures no pressure
        assert found[-1]["pressure"] == pytest.approx([0.75 * 5.0])
        assert found[-1]["displacement"] == found[0]["displacement"]
