"""Tuning of PID feedback on a plant, as a fair baseline.

A step of every pressure from the middle of its range gives gain, time constant and dead time (at 28 and
63 % of the response); from them SIMC's rules (Skogestad, "Simple analytic rules for model reduction and
PID controller tuning", 2003) give the gains, with a closed-loop time constant of one's choosing. They
leave a gain margin of about three. A slow ramp over the whole range finds parts more than twice as steep
as the step, for which the gains are reduced.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.feedback import PIDFeedback
from mckibben.blocks.fields import COMMANDS, Channel
from mckibben.control.connecting import (
    MOVED,
    Plant,
    actuated,
    channels_of,
    match,
    rest_length_of,
    resting,
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
        If nothing moves with a muscle's own pressure, or the rig imposes its length.
    """
    scheduled = scheduled or {}
    measured = untuned_pid(plant, scheduled).driven
    untuned = untuned_pid(plant, scheduled, references)
    followed = [channel.name for channel in measured]
    driven = [channel.name for channel in untuned.given]
    starts = resting(plant, scheduled)
    rig = plant.changed({"sample_time": sample_time, **starts})
    limits = [rig.limits(name) for name in driven]
    middle = {
        name: 0.5 * (limit.low + limit.high) for name, limit in zip(driven, limits, strict=True)
    }
    n = round(hold / sample_time)
    gains = []
    with telling(progress, "tuning") as tell:
        for name, moved, limit in one_by_one(zip(driven, followed, limits, strict=True), tell):
            rig.reset(seed)
            place = rig.outputs.index(moved)
            rest, limit_range = {**middle, **scheduled}, limit.high - limit.low
            for share in STEPS:
                for _ in range(n):
                    before = rig.step(rest)[place]
                size = share * limit_range
                higher = {**rest, name: middle[name] + size}
                response = np.array([rig.step(higher)[place] for _ in range(n)]) - before
                if _moves(response):
                    break
            ramp = np.linspace(limit.low, limit.high, n)
            slow = np.array([rig.step({**rest, name: at})[place] for at in (*ramp, *ramp[::-1])])
            gains.append(_simc(response, size, (slow, ramp), sample_time, closed_loop_time, name))
    pairs = zip(measured, untuned.driven, strict=True)
    per = [match(own, [one], rest_length_of(plant)) for own, one in pairs]
    kp, ki = np.transpose(gains) * [1.0 if line is None else line[1] for line in per]
    return replace(untuned, kp=tuple(kp.tolist()), ki=tuple(ki.tolist()))


def untuned_pid(
    plant: Plant, scheduled: Collection[str] = (), references: Sequence[Channel] = ()
) -> PIDFeedback:
    """Return PID feedback for a plant's channels, without gains; parameters as in `tune_pid`.

    Raises
    ------
    ModelError
        If a pressure has no motion of its own.
    """
    driven = actuated(plant, scheduled)
    followed = [_moved_by(name, plant, driven) for name in driven]
    limits, none = [plant.limits(name) for name in driven], [0.0] * len(driven)
    lowest, highest = min(limit.low for limit in limits), max(limit.high for limit in limits)
    length = rest_length_of(plant)
    channels = [
        next((one for one in references if match(one, [own], length)), own)
        for own in channels_of(plant, followed)
    ]
    return PIDFeedback.of(
        tuple(channels),
        channels_of(plant, driven),
        none,
        none,
        limits=(float(lowest), float(highest)),
    )


def _moved_by(name: str, rig: Plant, driven: Sequence[str]) -> str:
    """Return the motion driven by an input of a plant: that of the same number, or the only one."""
    end = name[name.find("_") :] if "_" in name else ""
    found = [stem + end for stem in MOVED if stem + end in rig.outputs]
    if len(driven) == 1 and not found and isinstance(rig, Twin):
        found = [one for one in rig.outputs if not one.startswith((*COMMANDS, "force"))]
    if len(found) != 1:
        raise ModelError(
            "PID follows a displacement or an angle for every pressure or voltage, each "
            f"moved by its own; {rig.name} is driven by {', '.join(driven)} and gives "
            f"{', '.join(rig.outputs)}",
            remedy="use the compensator alone, or another rig",
        )
    return found[0]


def _steepest(response: Array, ramp: Array, size: float) -> float:
    """Return the largest gain over steps of a size, from the response to a ramp up and down."""
    lag = max(round(size / float(ramp[1] - ramp[0])), 1)
    up, down = np.split(response, 2)
    run = float(ramp[lag] - ramp[0])
    return float(max((one[lag:] - one[:-lag]).max() for one in (up, down[::-1]))) / run


def _settled(response: Array) -> Array:
    return response[-max(len(response) // 10, 1) :]


def _moves(response: Array) -> bool:
    """Return whether a signal has moved by more than its scatter."""
    settled = _settled(response)
    return abs(float(settled.mean())) > float(settled.std())


def _simc(
    response: Array,
    size: float,
    slowly: tuple[Array, Array],
    step: float,
    wanted: float | None,
    name: str,
) -> tuple[float, float]:
    final = float(_settled(response).mean())
    if not _moves(response):
        raise ModelError(
            "it has no effect",
            channel=name,
            remedy=f"check the plant, or its middle {name.partition('_')[0]}",
        )
    way = np.sign(final)  # a displacement that counts stretching falls as pressure rises
    final, response = way * final, way * response
    early = (np.argmax(response >= 0.283 * final) + 1) * step
    late = (np.argmax(response >= 0.632 * final) + 1) * step
    time = max(1.5 * (late - early), step)
    dead = max(late - time, 0.5 * step)
    closed = wanted or max(dead, 3 * step)
    slow, ramp = slowly
    gain = max(final / size, _steepest(way * slow, ramp, size) / STEEPER)
    kp = way * time / (gain * (closed + dead))
    return float(kp), float(kp / min(time, 4 * (closed + dead)))
