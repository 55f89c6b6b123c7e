"""Tuning of PID feedback on a plant, as a fair baseline.

A step of every pressure from the middle of its range gives gain, time constant and dead time (at 28 and
63 % of the response); from them SIMC's rules (Skogestad, "Simple analytic rules for model reduction and
PID controller tuning", 2003) give the gains, with a closed-loop time constant of one's choosing. They
leave a gain margin of about three. A slow ramp over the whole range finds parts more than twice as steep
as the step, for which the gains are reduced.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.feedback import PIDFeedback
from mckibben.blocks.fields import COMMANDS, Channel
from mckibben.control.connecting import (
    MOVED,
    Plant,
    channels_of,
    driven_inputs,
    match,
    rest_length_of,
    rest_settings,
)
from mckibben.control.twin import Twin
from mckibben.errors import ModelError
from mckibben.system.progress import Tell, one_by_one, telling

STEPS = (0.1, 0.2, 0.4)
"""Steps of pressure, relative to its range; larger ones are used only if smaller ones cause no
motion.
"""
STEEPER = 2.0
"""Largest ratio of slopes, elsewhere to at the step; above it gains are set for the steepest part.
"""


def tune_pid(
    plant: Plant,
    *,
    sample_time: float,
    closed_loop_time: float | None = None,
    hold: float = 15.0,
    scheduled: dict[str, float] | None = None,
    references: Sequence[Channel] = (),
    seed: int = 0,
    progress: bool | Tell | None = None,
) -> PIDFeedback:
    """Return PID feedback tuned on a plant.

    Parameters
    ----------
    plant : Plant
        A rig with as many pressures as motions.
    sample_time : float
        Of the control to come [s].
    closed_loop_time : float, optional
        Desired time constant [s]; default the dead time, or three samples if that is longer.
    hold : float
        Time to settle before and after the step [s].
    scheduled : mapping, optional
        Other inputs, held.
    references : sequence of Channel
        Channels and units of the references; default those that the plant measures.
    seed : int
        Of the noise.
    progress : bool or callable, optional
        Whether to show a bar; or a callback for the share of muscles done, and a text.

    Raises
    ------
    ModelError
        If neither a motion nor, where the length is imposed, the force answers a muscle's own pressure.
    """
    scheduled = scheduled or {}
    measured = untuned_pid(plant, scheduled).driven
    untuned = untuned_pid(plant, scheduled, references)
    followed = [channel.name for channel in measured]
    driven = [channel.name for channel in untuned.given]
    starts = rest_settings(plant, scheduled)
    rig = plant.changed({"sample_time": sample_time, **starts})
    limits = {name: rig.limits(name) for name in driven}
    middle = {name: 0.5 * (limit.low + limit.high) for name, limit in limits.items()}
    n = round(hold / sample_time)
    rest = {**middle, **scheduled}
    gains = []
    with telling(progress, "tuning") as tell:
        for name, motion in one_by_one(zip(driven, followed, strict=True), tell):
            rig.reset(seed)
            response, size = _step_response(rig, name, motion, rest, n)
            slow_cycle = _slow_cycle(rig, name, motion, rest, n)
            gains.append(_simc(response, size, slow_cycle, sample_time, closed_loop_time, name))
    pairs = zip(measured, untuned.driven, strict=True)
    lines = [match(channel, [reference], rest_length_of(plant)) for channel, reference in pairs]
    kp, ki = np.transpose(gains) * [1.0 if line is None else line[1] for line in lines]
    return replace(untuned, kp=tuple(kp.tolist()), ki=tuple(ki.tolist()))


def _step_response(
    rig: Plant, name: str, motion: str, rest: Mapping[str, float], n: int
) -> tuple[Array, float]:
    """Return the response of a motion, shape (n,), to the smallest step of an input that moves it.

    Also the size of that step, or of the largest one where none does.
    """
    column, limit = rig.outputs.index(motion), rig.limits(name)
    for share in STEPS:
        for _ in range(n):
            before = rig.step(rest)[column]
        size = share * (limit.high - limit.low)
        higher = {**rest, name: rest[name] + size}
        response = np.array([rig.step(higher)[column] for _ in range(n)]) - before
        if _moves(response):
            break
    return response, size


def _slow_cycle(
    rig: Plant, name: str, motion: str, rest: Mapping[str, float], n: int
) -> tuple[Array, Array]:
    """Return the response, shape (2 n,), to a ramp of an input up and down, and the ramp, (n,)."""
    column, limit = rig.outputs.index(motion), rig.limits(name)
    ramp = np.linspace(limit.low, limit.high, n)
    commands = (*ramp, *ramp[::-1])
    return np.array([rig.step({**rest, name: command})[column] for command in commands]), ramp


def untuned_pid(
    plant: Plant, scheduled: Collection[str] = (), references: Sequence[Channel] = ()
) -> PIDFeedback:
    """Return PID feedback for a plant's channels, without gains; parameters as in `tune_pid`.

    Raises
    ------
    ModelError
        If a pressure has neither a motion nor a force of its own.
    """
    driven = driven_inputs(plant, scheduled)
    followed = [_moved_by(name, plant, driven) for name in driven]
    limits, zeros = [plant.limits(name) for name in driven], [0.0] * len(driven)
    lowest, highest = min(limit.low for limit in limits), max(limit.high for limit in limits)
    length = rest_length_of(plant)
    channels = [
        next(
            (reference for reference in references if match(reference, [channel], length)), channel
        )
        for channel in channels_of(plant, followed)
    ]
    return PIDFeedback.of(
        tuple(channels),
        channels_of(plant, driven),
        zeros,
        zeros,
        limits=(float(lowest), float(highest)),
    )


def _moved_by(name: str, rig: Plant, driven: Sequence[str]) -> str:
    """Return what an input of a plant drives: the motion of the same number, or the only one.

    Where nothing moves, that is the force.
    """
    suffix = name[name.find("_") :] if "_" in name else ""
    motions = [stem + suffix for stem in MOVED if stem + suffix in rig.outputs]
    if len(driven) == 1 and not motions and isinstance(rig, Twin):
        motions = [output for output in rig.outputs if not output.startswith((*COMMANDS, "force"))]
    if not motions and not any(output.startswith(MOVED) for output in rig.outputs):
        motions = [output for output in rig.outputs if output == f"force{suffix}"]
    if len(motions) != 1:
        raise ModelError(
            "PID follows a displacement, an angle or a force for every pressure or voltage, each "
            f"moved by its own; {rig.name} is driven by {', '.join(driven)} and gives "
            f"{', '.join(rig.outputs)}",
            remedy="use the compensator alone, or another rig",
        )
    return motions[0]


def _steepest(response: Array, ramp: Array, size: float) -> float:
    """Return the largest gain over steps of a size, from the response to a ramp up and down."""
    lag = max(round(size / float(ramp[1] - ramp[0])), 1)
    up, down = np.split(response, 2)
    run = float(ramp[lag] - ramp[0])
    return float(max((branch[lag:] - branch[:-lag]).max() for branch in (up, down[::-1]))) / run


def _settled(response: Array) -> Array:
    return response[-max(len(response) // 10, 1) :]


def _moves(response: Array) -> bool:
    """Return whether a signal has moved by more than its scatter."""
    settled = _settled(response)
    return abs(float(settled.mean())) > float(settled.std())


def _simc(
    response: Array,
    size: float,
    slow_cycle: tuple[Array, Array],
    step: float,
    closed_loop_time: float | None,
    name: str,
) -> tuple[float, float]:
    final = float(_settled(response).mean())
    if not _moves(response):
        raise ModelError(
            "it has no effect",
            channel=name,
            remedy=f"check the plant, or its middle {name.partition('_')[0]}",
        )
    direction = np.sign(final)  # a displacement that counts stretching falls as pressure rises
    final, response = direction * final, direction * response
    time_28 = (np.argmax(response >= 0.283 * final) + 1) * step
    time_63 = (np.argmax(response >= 0.632 * final) + 1) * step
    time = max(1.5 * (time_63 - time_28), step)
    dead_time = max(time_63 - time, 0.5 * step)
    closed_time = closed_loop_time or max(dead_time, 3 * step)
    slow, ramp = slow_cycle
    gain = max(final / size, _steepest(direction * slow, ramp, size) / STEEPER)
    kp = direction * time / (gain * (closed_time + dead_time))
    return float(kp), float(kp / min(time, 4 * (closed_time + dead_time)))
