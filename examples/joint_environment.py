"""Many copies of a muscled joint in MuJoCo, stepped together, to learn a controller on.

    from joint_environment import JointTracking

    env = JointTracking("joint.xml", 128)  # of `mckibben export mjcf ... --example joint`
    observations, info = env.reset(seed=1)
    observations, rewards, terminated, truncated, info = env.step(env.action_space.sample())

The interface is that of `gymnasium.vector.VectorEnv` (Towers et al., "Gymnasium: A Standard Interface
for Reinforcement Learning Environments").
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.errors import DataError, require

Observations = NDArray[np.float32]

SHARE = 0.7
"""Of the angles that the muscles reach, what references span."""

SLOWEST, FASTEST, WAVES = 0.05, 1.0, 6
"""Frequencies of the waves that a reference is a sum of [Hz], and how many."""

SETTLING = 3.0
"""Time in which the muscles bring the joint to the ends of its range [s]."""


class JointTracking(gymnasium.vector.VectorEnv[Observations, Observations, NDArray[Any]]):
    """Make the angle of a joint between muscles follow a random reference, in many copies at once.

    Action, shape (num_envs, muscles), within -1 and 1: each pressure, from the lowest to the highest,
    held for a control step.

    Observation, shape (num_envs, 3 + preview + muscles): angle and its velocity times the control time,
    the reference now and ``preview`` control steps ahead, all over half the range of references; the
    last action.

    Reward: minus the absolute error over half the range of references.

    Info: ``error`` [rad], shape (num_envs,).

    Episodes are truncated together after ``duration``; then call `reset`.

    Parameters
    ----------
    file : str or Path
        MJCF with muscles as its actuators.
    num_envs : int
        Copies.
    joint : str
        Hinge that follows the reference.
    control_time : float
        Time that an action is held [s], rounded to the time steps of the model.
    duration : float
        Of an episode [s].
    preview : int
        Reference samples ahead that the observation shows.
    threads : int
        That simulate; 0 for one a processor.

    Raises
    ------
    DataError
        If the file cannot be read or has no such joint, or on options that are not positive.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  # as Gymnasium has it
        "autoreset_mode": gymnasium.vector.AutoresetMode.DISABLED
    }

    def __init__(
        self,
        file: str | Path,
        num_envs: int = 64,
        *,
        joint: str = "joint",
        control_time: float = 0.02,
        duration: float = 10.0,
        preview: int = 5,
        threads: int = 0,
    ) -> None:
        require(num_envs > 0, "num_envs", num_envs, "1 or more", kind=DataError)
        require(preview >= 0, "preview", preview, "0 or more", kind=DataError)
        require(control_time > 0, "control_time", control_time, "above 0 s", kind=DataError)
        require(duration > control_time, "duration", duration, "a control step", kind=DataError)
        try:
            self.model = mujoco.MjModel.from_xml_path(str(file))
        except ValueError as problem:
            raise DataError(str(problem), file=Path(file), remedy="export it again") from problem
        place = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_JOINT, joint)
        if place < 0:
            names = ", ".join(self.model.joint(k).name for k in range(self.model.njnt))
            raise DataError(f"there is no joint {joint!r}", file=Path(file), remedy=f"use {names}")
        self.num_envs, self._preview = num_envs, preview
        self._substeps = max(1, round(control_time / self.model.opt.timestep))
        self.control_time = self._substeps * self.model.opt.timestep
        self._steps = round(duration / self.control_time)
        self._low, self._high = self.model.actuator_ctrlrange.T
        muscles = self.model.nu
        self._batch = Batch(self.model, nsim=num_envs, nthread=threads)
        self._at = (int(self.model.jnt_qposadr[place]), int(self.model.jnt_dofadr[place]))
        self._angles = self._batch.bind("qpos")[:, self._at[0]]
        self._speeds = self._batch.bind("qvel")[:, self._at[1]]
        self._controls = self._batch.bind("ctrl")
        self.middle, self.half_range = self._reached()
        boxes = gymnasium.spaces.Box
        seen = 3 + preview + muscles
        self.single_action_space = boxes(-1.0, 1.0, (muscles,), np.float32)
        self.single_observation_space = boxes(-np.inf, np.inf, (seen,), np.float32)
        self.action_space = boxes(-1.0, 1.0, (num_envs, muscles), np.float32)
        self.observation_space = boxes(-np.inf, np.inf, (num_envs, seen), np.float32)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Start an episode: the joint at rest without pressure, and new references."""
        del options
        if seed is not None or getattr(self, "_random", None) is None:
            self._random = np.random.default_rng(seed)  # type: ignore[arg-type]  # or a list
        self._batch.reset()
        self._action = np.full((self.num_envs, self.model.nu), -1.0)
        time = np.arange(self._steps + self._preview + 1) * self.control_time
        shape = (self.num_envs, WAVES, 1)
        rates = np.exp(self._random.uniform(np.log(SLOWEST), np.log(FASTEST), shape))
        phases = self._random.uniform(0.0, 2 * np.pi, shape)
        waves = (np.sin(2 * np.pi * rates * time + phases) / np.sqrt(rates)).sum(axis=1)
        self._references = waves / np.abs(waves).max(axis=1, keepdims=True)
        self._now = 0
        return self._observed(), {"error": self._error() * self.half_range}

    def step(
        self, actions: Observations
    ) -> tuple[Observations, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Hold an action in every copy for a control step."""
        self._action = np.clip(np.asarray(actions, dtype=np.float64), -1.0, 1.0)
        self._controls[:] = self._low + 0.5 * (self._action + 1.0) * (self._high - self._low)
        self._batch.step(nstep=self._substeps)
        self._now += 1
        error = self._error()
        over = np.full(self.num_envs, self._now >= self._steps)
        never = np.zeros(self.num_envs, dtype=bool)
        return self._observed(), -np.abs(error), never, over, {"error": error * self.half_range}

    def _scaled(self) -> Array:
        return (self._angles - self.middle) / self.half_range

    def _error(self) -> Array:
        return self._scaled() - self._references[:, self._now]

    def _observed(self) -> Observations:
        speeds = self._speeds * self.control_time / self.half_range
        ahead = self._references[:, self._now : self._now + self._preview + 1]
        seen = (self._scaled()[:, None], speeds[:, None], ahead, self._action)
        return np.concatenate(seen, axis=1).astype(np.float32)

    def _reached(self) -> tuple[float, float]:
        """Return the middle of what single muscles reach, and half of what references span [rad]."""
        ends = []
        for muscle in range(self.model.nu):
            data = mujoco.MjData(self.model)
            data.ctrl[:] = self._low
            data.ctrl[muscle] = self._high[muscle]
            mujoco.mj_step(self.model, data, nstep=round(SETTLING / self.model.opt.timestep))
            ends.append(float(data.qpos[self._at[0]]))
        low, high = min(ends), max(ends)
        return 0.5 * (low + high), 0.5 * SHARE * (high - low)
