"""Fitted muscles as actuators of MuJoCo: tendons that pull with the force of a model, memory and all.

`with_muscles` gives each named tendon of a specification an actuator whose control is the muscle's
pressure in bar and whose force is the model's. What a muscle remembers (where friction has crept to,
what relaxes) stands in ``mjData.userdata``: `mj_resetData` resets it, copies and saved states carry it,
and simulations of one model do not disturb one another.

MuJoCo may ask for forces more often than it steps. Every answer starts from the memory before the
step, and becomes the memory only when time has moved on: asking twice changes nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from threading import Lock
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.saving import to_text
from mckibben.errors import DataError, ModelError
from mckibben.simulators.compiled import CompiledMuscle, callback, install
from mckibben.simulators.installed import mujoco
from mckibben.simulators.pulling import Pulling, pulling

NOTHING, FIRST, KEPT = 0.0, 1.0, 2.0
"""What a memory holds: nothing yet, the first sample that may still be another, or the past."""

HEAD = 2
"""Numbers before a muscle's memory: what it holds, and the time of the last answer [s]."""

MM = 1000.0
"""In a metre."""


@dataclass(frozen=True)
class Muscle:
    """A fitted muscle for a tendon.

    Parameters
    ----------
    model : Block
        That tells a force; see `mckibben.simulators.pulling.pulling`.
    zero : float
        Length of the tendon where the model's displacement, or its length, is 0 [m]. A model of
        displacement shortens from there; of a model of length it is what of the tendon is no muscle.
    pressures : (float, float), optional
        Lowest and highest pressure, to which the control is clipped [bar].
    lag : float
        Time constant from control to pressure [s]; 0 for none.
    pulls_only : bool
        Whether it hangs on a cable and cannot push.
    """

    model: Block
    zero: float = 0.0
    pressures: tuple[float, float] | None = None
    lag: float = 0.0
    pulls_only: bool = True


def with_muscles(
    spec: mujoco.MjSpec, muscles: Mapping[str, Muscle], *, compiled: bool = False
) -> mujoco.MjModel:
    """Return the model of a specification whose tendons have muscles.

    Parameters
    ----------
    spec : mujoco.MjSpec
        Each muscle becomes an actuator of its tendon's name; the memory is added to ``nuserdata``.
    muscles : mapping of str to Muscle
        By the names of tendons.
    compiled : bool
        Whether they run as exported C, at the specification's time step and no other; needs a C
        compiler. Muscles of a process are all of one kind.

    Returns
    -------
    mujoco.MjModel
        Which any function of MuJoCo steps, in this process.

    Raises
    ------
    DataError
        If there is no such tendon.
    ModelError
        If a model tells no force.
    """
    for name, muscle in muscles.items():
        number, size = _compiled(muscle, spec.option.timestep) if compiled else _interpreted(muscle)
        add_actuator(spec, name, muscle, number, size)
    before = mujoco.get_mjcb_act_bias()
    mujoco.set_mjcb_act_bias(None)  # MuJoCo tries a model out before Python may see it
    try:
        model = spec.compile()
    finally:
        mujoco.set_mjcb_act_bias(before)
    if compiled:
        install(callback())
    else:
        install(_bias)
    return model


def add_actuator(spec: mujoco.MjSpec, name: str, muscle: Muscle, number: int, size: int) -> None:
    """Add the actuator of a muscle, which knows its number and where its memory of some size is."""
    if spec.tendon(name) is None:
        known = ", ".join(sorted(tendon.name for tendon in spec.tendons)) or "none"
        raise DataError(f"there is no tendon {name!r}", remedy=f"name one of {known}")
    place = max(spec.nuserdata, 0)
    spec.nuserdata = place + HEAD + 2 * size
    limits: dict[str, Any] = {}
    if muscle.pressures is not None:
        limits = {"ctrllimited": True, "ctrlrange": list(muscle.pressures)}
    if muscle.lag > 0:
        kind = mujoco.mjtDyn.mjDYN_FILTEREXACT
        limits |= {"dyntype": kind, "dynprm": _padded(muscle.lag)}
    spec.add_actuator(
        name=name,
        target=name,
        trntype=mujoco.mjtTrn.mjTRN_TENDON,
        gaintype=mujoco.mjtGain.mjGAIN_FIXED,
        gainprm=_padded(0.0),
        biastype=mujoco.mjtBias.mjBIAS_USER,
        biasprm=_padded(number, place),
        **limits,
    )


def _padded(*numbers: float) -> list[float]:
    return [*map(float, numbers), *[0.0] * (mujoco.mjNBIAS - len(numbers))]


class _Attached:
    """A muscle at work: its block, bound to a time step."""

    def __init__(self, muscle: Muscle, pull: Pulling) -> None:
        self._muscle, self._pull = muscle, pull
        self._inputs, self._outputs = np.zeros((1, 2)), np.zeros((1, 1))
        self._state = np.zeros(pull.block.n_states)
        self._step = 0.0
        self._run: Callable[[], None]
        self._lock = Lock()

    def force(
        self, memory: Array, time: float, step: float, length: float, pressure: float
    ) -> float:
        """Return what the tendon is pulled with [N], negative as MuJoCo counts, and bring the memory."""
        pull, n = self._pull, self._state.size
        with self._lock:
            if step != self._step:
                self._run = pull.block.bind(step, self._state, self._inputs, self._outputs)
                self._step = step
            moved = MM * (length - self._muscle.zero)
            self._inputs[0, pull.along] = -moved if pull.shortening else moved
            self._inputs[0, pull.pressure] = pressure
            past, now = memory[HEAD : HEAD + n], memory[HEAD + n : HEAD + 2 * n]
            if memory[0] != NOTHING and time > memory[1]:
                past[:] = now
                memory[0] = KEPT
            elif memory[0] != KEPT:
                past[:] = pull.block.initial_state(self._inputs[0])
                memory[0] = FIRST
            memory[1] = time
            self._state[:] = past
            self._run()
            now[:] = self._state
            force = pull.share * float(self._outputs[0, 0])
        return -max(force, 0.0) if self._muscle.pulls_only else -force


_attached: list[_Attached] = []
_numbers: dict[tuple[object, ...], tuple[int, int]] = {}


def _alike(muscle: Muscle) -> tuple[object, ...]:
    """Return what muscles of one number share: what each remembers is in its simulation."""
    return to_text(muscle.model), muscle.zero, muscle.pulls_only


def _interpreted(muscle: Muscle) -> tuple[int, int]:
    """Return the number of a muscle in Python, and the size of its memory."""
    key = _alike(muscle)
    if key not in _numbers:
        pull = pulling(muscle.model)
        _attached.append(_Attached(muscle, pull))
        _numbers[key] = len(_attached), pull.block.n_states
    return _numbers[key]


def _compiled(muscle: Muscle, step: float) -> tuple[int, int]:
    """Return the number of a muscle in C, and the size of its memory."""
    key = (*_alike(muscle), step)
    if key not in _numbers:
        found = CompiledMuscle(pulling(muscle.model), step)
        _numbers[key] = found.told(zero=muscle.zero, pulls_only=muscle.pulls_only), found.size
    return _numbers[key]


def _bias(m: mujoco.MjModel, d: mujoco.MjData, actuator: int) -> float:
    number, place = m.actuator_biasprm[actuator, :2]
    if not 1 <= number <= len(_attached):
        return 0.0
    muscle = _attached[int(number) - 1]
    if m.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4:
        raise ModelError(
            "muscles that remember step once a sample, RK4 four times",
            remedy="choose the integrator Euler, implicit or implicitfast",
        )
    act = m.actuator_actadr[actuator]
    pressure = float(d.act[act] if act >= 0 else d.ctrl[actuator])
    if act < 0 and m.actuator_ctrllimited[actuator]:
        low, high = m.actuator_ctrlrange[actuator]
        pressure = min(max(pressure, low), high)
    return muscle.force(
        d.userdata[int(place) :], d.time, m.opt.timestep, d.actuator_length[actuator], pressure
    )
