"""A policy learned by reinforcement on a fitted model: a controller of benchmarks/loops.py.

Proximal policy optimisation (Schulman et al., arXiv:1707.06347) of stable-baselines3 (Raffin et al.,
Journal of Machine Learning Research 22(268), 2021), which is imported when it is used and is not in this
project's environment. It sees what a controller does, and the model only: motions to follow in training
are what the model answers to random commands.

- Observation: the outputs as measured now and a step ago, with the plant's noise; the reference at the
  next step and at those of `AHEAD`, and its difference from the outputs; and the commands now.
- Action: the change of the commands.
- Reward: minus the mean distance from the reference, each relative to its range, and minus a little of
  the square of the action.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from tests.plants import Bench, motions

from mckibben import Block
from mckibben.arrays import Array
from mckibben.blocks.bands import inside
from mckibben.control.controller import Ahead, Controller
from mckibben.control.twin import plain

AHEAD = (0.02, 0.05, 0.1, 0.2, 0.4)
"""How much later than at the next step the reference is seen [s]."""

FASTEST = 1.5
"""Fastest change of a command, relative to its range [1/s]."""

ROBOTS, STEPS, POOL, EPISODE = 64, 128, 64, 10.0
"""Copies of the model that learn together, steps between updates, references, and their length [s]."""

LAG = 0.1
"""Longest time constant by which commands lag in training [s], drawn for each episode of a copy."""

EFFORT = 0.02
"""Weight of the square of the action against a distance of one range."""

SETTINGS: dict[str, Any] = {
    "n_steps": STEPS,
    "batch_size": 1024,
    "n_epochs": 6,
    "gamma": 0.95,
    "gae_lambda": 0.9,
    "learning_rate": 1e-3,
    "policy_kwargs": {"net_arch": [64, 64], "log_std_init": -1.0},
}
"""Of stable-baselines3; others are its defaults."""


@dataclass(frozen=True)
class Scales:
    """Ranges of outputs and commands, and samples ahead at which a policy sees the reference."""

    bench: Bench
    low: Array
    span: Array
    ahead: tuple[int, ...]

    @property
    def largest_change(self) -> float:
        """Return the largest change of a command in a step [bar or V]."""
        return FASTEST * self.bench.high * self.bench.sample_time

    def observed(self, references: Array, outputs: Array, before: Array, commands: Array) -> Array:
        """Return an observation, or one a row, from references (..., 1 + len(ahead), n_outputs)."""
        seen = 2.0 * (outputs - self.low) / self.span - 1.0
        wanted = (references - outputs[..., None, :]) / self.span
        moved = (outputs - before) / self.span
        pressed = 2.0 * commands / self.bench.high - 1.0
        flat = wanted.reshape(*wanted.shape[:-2], -1)
        parts = (seen, 20.0 * moved, 20.0 * wanted[..., 0, :], 5.0 * flat, pressed)
        return np.clip(np.concatenate(parts, axis=-1), -5.0, 5.0).astype(np.float32)

    def commands(self, before: Array, action: Array) -> Array:
        """Return the commands that an action makes of those before."""
        changed = before + self.largest_change * np.clip(action, -1.0, 1.0)
        return np.clip(changed, 0.0, self.bench.high)


class Models:
    """Copies of a fitted model that are run sample by sample, with all else held."""

    def __init__(self, model: Block, bench: Bench, count: int) -> None:
        self.model, self.bench = inside(model), bench
        inputs = [plain(channel.name) for channel in self.model.inputs]
        held = dict.fromkeys(bench.loads, bench.load)
        self._row = np.array([held.get(name, 0.0) for name in inputs])
        self._driven = [inputs.index(name) for name in bench.pressures]
        outputs = [channel.name for channel in self.model.outputs]
        self._given = [outputs.index(name) for name in bench.outputs]
        self._streams = [self.model.stream(bench.sample_time) for _ in range(count)]

    def run(self, commands: Array) -> Array:
        """Return the outputs over commands, shape (n, n_pressures)."""
        rows = np.tile(self._row, (len(commands), 1))
        rows[:, self._driven] = commands
        found = self.model.simulate(rows, sample_time=self.bench.sample_time)
        return found.reshape(len(commands), -1)[:, self._given]

    def begin(self) -> None:
        """Begin anew."""
        for stream in self._streams:
            stream.reset()

    def step(self, commands: Array) -> Array:
        """Return the outputs of all, from a row of commands each."""
        rows = np.tile(self._row, (len(commands), 1))
        rows[:, self._driven] = commands
        pairs = zip(self._streams, rows, strict=True)
        return np.array([stream.step(row)[self._given] for stream, row in pairs])


def references(models: Models, rng: np.random.Generator, longest: int) -> Array:
    """Return what the model answers to random commands from rest, (POOL, n, n_outputs)."""
    bench, found = models.bench, []
    n = round(EPISODE / bench.sample_time) + longest + 2
    for _ in range(POOL):
        low, high = np.sort(rng.uniform(0.0, bench.high, 2))
        low, high = 0.3 * low, 0.6 * bench.high + 0.4 * high
        drawn = [
            motions.wander(rng, n * bench.sample_time + 1.0, bench.sample_time, low, high)[:n]
            for _ in bench.pressures
        ]
        growing = np.minimum(np.arange(n) * bench.sample_time / 1.0, 1.0)
        found.append(models.run(growing[:, None] * np.column_stack(drawn)))
    return np.array(found)


def trained(model: Block, bench: Bench, seed: int, seconds: float) -> tuple[Any, Scales]:
    """Return a policy after so many seconds of training on a model, and its scales."""
    torch, sb3 = import_module("torch"), import_module("stable_baselines3")
    spaces = import_module("gymnasium.spaces")
    base: Any = import_module("stable_baselines3.common.vec_env").VecEnv
    torch.set_num_threads(1)
    rng = np.random.default_rng(seed)
    models = Models(model, bench, ROBOTS)
    ahead = tuple(max(round(later / bench.sample_time), 1) for later in AHEAD)
    pool = references(models, rng, max(ahead))
    low = pool.min(axis=(0, 1))
    scales = Scales(bench, low, pool.max(axis=(0, 1)) - low, ahead)
    offsets = np.array([0, *ahead])
    length, k = round(EPISODE / bench.sample_time), len(bench.pressures)
    width = len(bench.outputs) * (3 + len(offsets)) + k

    class Robots(base):  # type: ignore[misc]
        """Copies of the model, each with a reference of its own, that begin together."""

        def __init__(self) -> None:
            seen = spaces.Box(-5.0, 5.0, (width,), np.float32)
            super().__init__(ROBOTS, seen, spaces.Box(-1.0, 1.0, (k,), np.float32))

        def reset(self) -> Array:
            models.begin()
            self.wanted = pool[rng.integers(POOL, size=ROBOTS)]
            self.commands, self.time = np.zeros((ROBOTS, k)), 0
            lags = rng.uniform(0.0, LAG, (ROBOTS, 1)) + 1e-9
            self.passed = 1.0 - np.exp(-bench.sample_time / lags)
            self.acting = self.commands.copy()
            self.outputs = models.step(self.commands)
            self.seen = self.before = self.outputs
            return self._observed()

        def _observed(self) -> Array:
            given = self.wanted[:, self.time + 1 + offsets]
            return scales.observed(given, self.seen, self.before, self.commands)

        def step_async(self, actions: Array) -> None:
            self.actions = actions

        def step_wait(self) -> tuple[Array, Array, Array, list[dict[str, Any]]]:
            self.commands = scales.commands(self.commands, self.actions)
            self.acting += self.passed * (self.commands - self.acting)
            self.outputs, self.time = models.step(self.acting), self.time + 1
            self.before = self.seen
            self.seen = self.outputs + bench.noise[1] * rng.standard_normal(self.outputs.shape)
            missed = np.abs(self.outputs - self.wanted[:, self.time]) / scales.span
            rewards = -missed.mean(axis=1) - EFFORT * (self.actions**2).mean(axis=1)
            infos: list[dict[str, Any]] = [{} for _ in range(ROBOTS)]
            over = self.time >= length
            if over:
                last = self._observed()
                infos = [{"terminal_observation": one, "TimeLimit.truncated": True} for one in last]
            observed = self.reset() if over else self._observed()
            return observed, rewards.astype(np.float32), np.full(ROBOTS, over), infos

        def close(self) -> None: ...

        def get_attr(self, name: str, indices: Any = None) -> list[Any]:
            return [None] * ROBOTS

        def set_attr(self, name: str, value: Any, indices: Any = None) -> None: ...

        def env_method(self, name: str, *given: Any, indices: Any = None, **how: Any) -> list[Any]:
            return [None] * ROBOTS

        def env_is_wrapped(self, wrapper: Any, indices: Any = None) -> list[bool]:
            return [False] * ROBOTS

    found = sb3.PPO("MlpPolicy", Robots(), seed=seed, device="cpu", **SETTINGS)
    ends = time.process_time() + seconds

    def goes_on(given: Mapping[str, Any], _: Any) -> bool:
        return time.process_time() < ends

    found.learn(10**9, callback=goes_on)
    return found.policy, scales


@dataclass
class Learned(Controller):
    """A policy in a loop."""

    policy: Any
    scales: Scales

    def __post_init__(self) -> None:
        self.samples_ahead = max(self.scales.ahead)

    def reset(self, sample_time: float) -> None:
        self._due: deque[Array] = deque(maxlen=self.samples_ahead + 1)
        self._before: Array | None = None
        self._commands = np.zeros(len(self.scales.bench.pressures))

    def step(self, reference: Array, measured: Array, scheduled: Array, ahead: Ahead) -> Array:
        if not self._due:  # the approach is straight
            self._due.extend(np.linspace(reference, ahead[0], self.samples_ahead + 1))
        else:
            self._due.append(ahead[0])
        given = np.array([self._due[k] for k in (0, *self.scales.ahead)])
        before = measured if self._before is None else self._before
        seen = self.scales.observed(given, measured, before, self._commands)
        action, _ = self.policy.predict(seen, deterministic=True)
        self._before = measured
        self._commands = self.scales.commands(self._commands, np.asarray(action, dtype=float))
        return self._commands
