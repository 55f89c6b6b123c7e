"""Gymnasium environments: tracking with a virtual rig, or with a model of one's own muscle.

Importing this module registers ``mckibben/RIG-vVERSION`` for every published rig that measures
displacement (Towers et al., "Gymnasium: A Standard Interface for Reinforcement Learning
Environments").

>>> import gymnasium
>>> import mckibben.environments
>>> env = gymnasium.make("mckibben/mas20-hanging-v2")
>>> observation, info = env.reset(seed=1)
>>> observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.errors import DataError, require
from mckibben.recording import Recording
from mckibben.system.extras import demand

demand("gymnasium", "gym", "environments")
_require = partial(require, kind=DataError)

import gymnasium  # noqa: E402

if TYPE_CHECKING:
    from mckibben.blocks.base import Block
    from mckibben.control import Twin
    from mckibben.rigs import Rig

Vector = NDArray[np.float32]

MAX_FREQUENCY = 0.3
"""Highest frequency of the commands behind a reference [Hz]."""

MIN_FREQUENCY = 0.03
"""Lowest frequency of the commands behind a reference [Hz]; an episode has several reversals."""

OBSERVATION_LIMIT = 5.0
"""Bound to which observations are clipped, well outside their usual range."""


class Tracking(gymnasium.Env[Vector, Vector]):
    """Track a reference with the displacement of a rig or a model.

    The reference is the response of the same rig to hidden random commands, so it can be followed.

    Action, shape (commands,), within -1 and 1: each pressure or voltage, from the lowest to the
    highest that the hardware allows, held for a control step.

    Observation, all near -1 to 1: displacement(s) over stroke; pressure(s), if measured, over the
    highest command; the reference(s) over stroke, now and ``preview`` steps ahead; the last action.

    Reward: minus the mean absolute error over stroke, minus ``effort`` times the mean square of the
    change of action.

    Info: ``error``, ``reference``, ``displacement`` [mm] and ``pressure`` [bar], measured if
    possible, otherwise commanded.

    Episodes never terminate; they are truncated after ``duration``.

    Parameters
    ----------
    rig : str, path or Rig
        Name, file or object; must measure displacement.
    control_time : float, optional
        Time that an action is held [s]; default 0.02 s, or the rig's sample time if that is longer.
    duration : float
        Duration of an episode [s], at least two control steps.
    preview : int
        Number of future reference samples in the observation, 0 to 1000.
    effort : float
        Weight of changes of action, not negative.
    load : float
        Constant tensile force [N], for a rig with such an input.
    settings : mapping, optional
        Parameters of the rig or twin to change; see `mckibben.Rig.changed` and `Twin.changed`.
    plant : Twin, Block or path, optional
        A fitted model instead of a rig: the model, its file, or a `mckibben.control.Twin`, which holds
        inputs other than pressures constant.

    Raises
    ------
    DataError
        If an option is outside its range, or the rig does not measure displacement.
    """

    def __init__(
        self,
        rig: str | Path | Rig = "mas20-hanging",
        *,
        control_time: float | None = None,
        duration: float = 20.0,
        preview: int = 0,
        effort: float = 0.01,
        load: float = 0.0,
        settings: Mapping[str, Any] | None = None,
        plant: Twin | Block | str | Path | None = None,
    ) -> None:
        from mckibben.rigs import load_rig

        system: Rig | Twin
        held: Mapping[str, float] = {}
        if plant is None:
            system = load_rig(rig) if isinstance(rig, str | Path) else rig
            if control_time is None:
                control_time = max(0.02, system.sample_time)
        else:
            _require(not load, "load", load, "0 with a plant, and held={'force': ...} to the plant")
            system = _twin(plant)
            held = system.held
            control_time = system.sample_time if control_time is None else control_time
            if control_time is None:
                raise DataError(
                    "the plant is a model of any sample time",
                    parameter="control_time",
                    remedy="give the time between commands, in seconds",
                )
        _require(0 < control_time <= 1, "control_time", control_time, "0 to 1 s")
        _require(2 * control_time <= duration <= 1e4, "duration", duration, "2 steps to 10000 s")
        _require(preview in range(1001), "preview", preview, "a whole number from 0 to 1000")
        _require(0 <= effort < np.inf, "effort", effort, "0 or more")

        self._control_time = control_time
        self._plant: Rig | Twin = system.changed({**(settings or {}), "sample_time": control_time})
        outputs = self._plant.outputs
        self._displacements = [
            i for i, name in enumerate(outputs) if name.startswith("displacement")
        ]
        self._pressures = [i for i, name in enumerate(outputs) if name.startswith("pressure")]
        if not self._displacements:
            raise DataError(
                f"the rig {system.name!r} does not measure it",
                channel="displacement",
                remedy="choose another rig",
            )
        self._commands = [
            name
            for name in self._plant.inputs
            if name.startswith(("pressure", "voltage")) and name not in held
        ]
        limits = [self._plant.limits(name) for name in self._commands]
        self._low = np.array([limit.low for limit in limits])
        self._high = np.array([limit.high for limit in limits])
        if load:
            force = self._plant.limits("force") if "force" in self._plant.inputs else None
            _require(
                force is not None and force.low <= load <= force.high,
                "load",
                load,
                "0, or a force that the rig can take",
            )
        self._load = load
        self._steps = round(duration / control_time)
        self._preview, self._effort = preview, effort

        n_commands, n_displacements = len(self._commands), len(self._displacements)
        n_observed = n_displacements * (2 + preview) + len(self._pressures) + n_commands
        limit = OBSERVATION_LIMIT
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (n_commands,), np.float32)
        self.observation_space = gymnasium.spaces.Box(-limit, limit, (n_observed,), np.float32)
        self._stroke = self._measured_stroke()
        self._max_pressure = max(
            self._plant.limits(name).high * getattr(self._plant, "bar_per_volt", 1.0)
            if name == "voltage"
            else self._plant.limits(name).high
            for name in self._commands
        )
        self._reference = np.zeros((self._steps + preview + 1, n_displacements))
        self._measured: list[Array] = []

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Vector, dict[str, Any]]:
        """Start an episode: a new reference, and a plant at rest."""
        super().reset(seed=seed)
        del options
        self._reference = self._hidden_run()
        measured = self._plant.reset(seed=int(self.np_random.integers(2**31)))
        self._action = np.zeros(len(self._commands))
        self._applied = self._low.copy()
        self._measured = [measured]
        return self._observation(measured), self._info(measured)

    def step(self, action: Vector) -> tuple[Vector, float, bool, bool, dict[str, Any]]:
        """Hold an action for a control step."""
        clipped = np.clip(np.asarray(action, dtype=float), -1.0, 1.0)
        self._applied = self._low + 0.5 * (clipped + 1) * (self._high - self._low)
        commands = dict(zip(self._commands, self._applied.tolist(), strict=True))
        if self._load:
            commands["force"] = self._load
        measured = self._plant.step(commands)
        self._measured.append(measured)
        change, self._action = clipped - self._action, clipped
        info = self._info(measured)
        reward = -float(np.mean(np.abs(info["error"]))) / self._stroke
        reward -= self._effort * float(np.mean(change**2))
        truncated = len(self._measured) > self._steps
        return self._observation(measured), reward, False, truncated, info

    def _observation(self, measured: Array) -> Vector:
        k = len(self._measured) - 1
        parts = (
            measured[self._displacements] / self._stroke,
            measured[self._pressures] / self._max_pressure,
            self._reference[k : k + 1 + self._preview].ravel() / self._stroke,
            self._action,
        )
        limit = OBSERVATION_LIMIT
        return np.clip(np.concatenate(parts), -limit, limit).astype(np.float32)

    def _info(self, measured: Array) -> dict[str, Any]:
        reference = self._reference[len(self._measured) - 1]
        return {
            "error": measured[self._displacements] - reference,
            "reference": reference.copy(),
            "displacement": measured[self._displacements],
            "pressure": measured[self._pressures] if self._pressures else self._applied.copy(),
        }

    def _hidden_run(self) -> Array:
        """Return a rig's response to random commands [mm], shape (samples, displacements)."""
        from mckibben.signals import random_wave

        n = len(self._reference)
        time = np.arange(max(n, 2)) * self._control_time
        waves = {}
        for name, low, high in zip(self._commands, self._low, self._high, strict=True):
            bottom, top = np.sort(self.np_random.uniform(0.0, 1.0, 2))
            bottom, top = 0.3 * bottom, 0.6 + 0.35 * top
            seed = int(self.np_random.integers(2**31))
            share = random_wave(time, MAX_FREQUENCY, top, bottom, MIN_FREQUENCY, seed=seed)
            waves[name] = low + (high - low) * share
        return self._ideal_run(waves)[:n]

    def _measured_stroke(self) -> float:
        """Return the largest range of displacement when all commands rise slowly together [mm]."""
        time = np.arange(0.0, 10.0, self._control_time)
        rise = np.minimum(time / 8.0, 1.0)
        waves = {
            name: low + rise * (high - low)
            for name, low, high in zip(self._commands, self._low, self._high, strict=True)
            if name != "pressure_extensor"
        }
        return float(np.ptp(self._ideal_run(waves), axis=0).max())

    def _ideal_run(self, waves: Mapping[str, Array]) -> Array:
        """Return the displacements under these commands, without noise [mm]."""
        from mckibben.rigs import Rig

        channels = dict(waves)
        if self._load:
            n = len(next(iter(waves.values())))
            channels["force"] = np.full(n, self._load)
        commands = Recording(channels, self._control_time)
        response = (
            self._plant.run(commands, ideal=True)
            if isinstance(self._plant, Rig)
            else self._plant.run(commands)
        )
        return response.matrix([self._plant.outputs[i] for i in self._displacements])


def register() -> None:
    """Register an environment for every published rig that measures displacement."""
    for file in files("mckibben").joinpath("rigs", "published").iterdir():
        if file.name.endswith(".toml"):
            fields = tomllib.loads(file.read_text(encoding="utf-8"))
            if "displacement" in fields["sensor"]:
                gymnasium.register(
                    id=f"mckibben/{fields['name']}-v{fields['version']}",
                    entry_point="mckibben.environments:Tracking",
                    kwargs={"rig": fields["name"]},
                )


def _twin(plant: object) -> Twin:
    """Return a twin, or the twin of a model or of its file."""
    from mckibben.blocks.base import Block
    from mckibben.blocks.saving import load
    from mckibben.control import Twin

    match plant:
        case Twin():
            return plant
        case Block():
            return Twin(plant)
        case str() | Path():
            return Twin(load(plant), name=Path(plant).stem)
    raise DataError(
        f"it is {plant!r}", parameter="plant", remedy="give a model, its file, or a Twin"
    )


register()
