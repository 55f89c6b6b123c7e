"""Closing a loop: any controller on anything that steps like a rig."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.blocks.base import Block, Stream
from mckibben.blocks.fields import Channel
from mckibben.control.connecting import Plant, asked, match, offered, resting
from mckibben.control.controller import BlockController, Controller, samples_ahead
from mckibben.errors import ModelError, require
from mckibben.recording import COMMAND, REFERENCE, Recording, sample_time_of
from mckibben.signals.checking import generator
from mckibben.system.progress import telling
from mckibben.system.showing import DrawsItself

ROUNDING = 1e-9
"""Share of the reachable range within which a reference counts as at its end."""


class Beyond(NamedTuple):
    """Samples of a reference that are out of reach.

    Parameters
    ----------
    samples : int
    low, high : float
        What the model can reach whatever happened before [mm or N].
    rmse_elsewhere : float
        RMSE over all other samples [mm or N]; not a number where there are none.
    """

    samples: int
    low: float
    high: float
    rmse_elsewhere: float


@dataclass(frozen=True)
class Tracked(DrawsItself):
    """Result of a closed loop.

    Parameters
    ----------
    recording : Recording
        References (``reference_...``), all that was measured, and commands.
    rmse, largest : mapping of str to float
        Of everything followed, after the approach [mm or N].
    clipped : int
        Steps in which pressure or its rate was at a limit, or the reference out of reach.
    step_time : (float, float)
        Median and 99.9th percentile of the controller's own time a step [s].
    beyond : mapping of str to Beyond
        Where the reference is out of reach of what the compensator undoes, by what is followed.
    """

    face: ClassVar[str] = "tracked"

    recording: Recording
    rmse: Mapping[str, float]
    largest: Mapping[str, float]
    clipped: int
    step_time: tuple[float, float]
    beyond: Mapping[str, Beyond] = field(default_factory=dict)


MOST_STEPS = 10**7
"""Largest number of steps of the approach, and of the time not scored."""

MOST_DELAY = 10**4
"""Largest delay [steps]."""

MOST_NOISE = 1e6
"""Largest measurement noise [mm or N]."""


def track(
    controller: Block | Controller,
    plant: Plant,
    reference: Recording,
    *,
    approach: float = 20.0,
    settle: float = 0.0,
    pressure_loop: bool = True,
    noise: float = 0.0,
    delay: int = 0,
    slew: float | None = None,
    preview: float | None = None,
    seed: int = 0,
    progress: bool | Callable[[float], None] | None = None,
) -> Tracked:
    """Track references of motion or force with a controller on a plant.

    Parameters
    ----------
    controller : Block or Controller
        A block is wrapped in a `BlockController`.
    plant : Plant
        A rig; it is run at the reference's sample time, which is the control rate.
    reference : Recording
        Desired motions [mm or rad], or without any the desired force [N], and scheduling or held
        channels, such as ``pressure_extensor`` or the length in a test stand. Channels driven by
        the block, such as recorded pressures, are ignored. With the rest length of the plant, or of
        the reference, a displacement, contraction or length is any of these.
    approach : float
        Time to go from rest to the first reference [s], not scored.
    settle : float
        Time after that which is not scored either [s].
    pressure_loop : bool
        Whether an inner loop corrects pressures by measured ones, as regulators with a sensor do.
    noise : float
        Standard deviation of the noise added to the followed measurements [mm or N].
    delay : int
        Delay of measurements [control steps].
    slew : float, optional
        Fastest change of a pressure [bar/s].
    preview : float, optional
        Preview of the reference for compensators [s], in whole steps, at least one; its end is
        extended. Default: the dead time of the inverted model. Predictive compensators receive
        their horizon in addition.
    seed : int
        Seed of all noise.
    progress : bool or callable, optional
        Whether to show a bar; or a callback for the share of the time passed.

    Raises
    ------
    DataError
        If the reference has no time, or no channel that the plant measures; or if channels or units
        of controller and loop do not match.
    ModelError
        On settings out of range.
    """
    step = sample_time_of(reference, "be a reference")
    _check(approach, settle, noise, delay, slew, step)
    reference = asked(plant, reference, controller if isinstance(controller, Block) else None)
    if isinstance(controller, Block):
        controller = BlockController(controller)
    preview = controller.preview if preview is None else preview
    further = max(samples_ahead(preview, step) - 1, 0)  # than the next step's, given anyway
    further += controller.samples_ahead
    rng = generator(seed)
    offer = offered(plant, reference)
    controller.connect(offer)
    held = offer.held
    followed, beside, driven = (
        [channel.name for channel in some]
        for some in (offer.followed, offer.scheduled, offer.driven)
    )
    starts = resting(plant, {name: float(reference[name][0]) for name in held})
    settings: dict[str, float] = {"sample_time": step, **starts}
    changed = plant.changed(settings)
    lead = round(approach / step)
    path = reference.matrix(followed)
    n = lead + len(path)
    scored = slice(lead + round(settle / step), n)
    if scored.start >= n:
        raise ModelError(
            "nothing is left to score",
            parameter="settle",
            remedy="give a longer reference, or less settle",
        )
    scheduled = reference.matrix(beside) if beside else np.empty((len(reference), 0))
    scheduled = np.concatenate([np.tile(scheduled[:1], (lead, 1)), scheduled])
    imposed = scheduled[:, [beside.index(name) for name in held]]

    places = {name: place for place, name in enumerate(changed.outputs)}
    at_y = [places[name] for name in followed]
    at_p = [places[name] for name in driven if name in places]
    inner = pressure_loop and len(at_p) == len(driven)
    limits = [changed.limits(name) for name in driven]
    low, high = (np.array([getattr(limit, end) for limit in limits]) for end in ("low", "high"))
    loop = PressureLoop(low, high, step)
    controller.reset(step)
    measured = changed.reset(seed)
    share = np.linspace(0.0, 1.0, lead, endpoint=False)[:, np.newaxis]
    begun = measured[at_y]  # a length at rest is not 0
    path = np.concatenate([begun + share * (path[0] - begun), path])
    late = [measured] * (delay + 1)
    seen, commands = np.empty((n, len(measured))), np.empty((n, len(driven)))
    clipped, unreached, times = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool), np.empty(n)
    last: Array | None = None
    with telling(progress, "tracking") as tell:
        for t in range(n):
            seen[t] = measured
            late = [*late[1:], measured]
            felt = late[0].copy()
            felt[at_y] += noise * rng.standard_normal(len(at_y))
            started = time.perf_counter()
            then = min(t + further, n - 1)
            wanted = controller.step(path[t], felt, scheduled[t], (path[then], scheduled[then]))
            times[t] = time.perf_counter() - started
            if wanted.shape != low.shape or not np.isfinite(wanted).all():
                raise ModelError(
                    f"the controller gave {wanted} for {len(driven)} muscles at {t * step:g} s",
                    remedy="use a compensator made for this plant",
                )
            allowed = np.clip(wanted, low, high)
            if slew is not None and last is not None:
                allowed = np.clip(allowed, last - slew * step, last + slew * step)
            clipped[t] = bool((np.abs(allowed - wanted) > 1e-9).any())
            # what is asked for at a step is due at the next
            if t + 1 < n and controller.stream is not None:
                unreached[t + 1] = controller.stream.status & Stream.CLIPPED
            last = allowed
            controller.applied(allowed)
            command = loop.step(allowed, measured[at_p]) if inner else allowed
            commands[t] = command
            action = dict(zip(driven, command.tolist(), strict=True))
            action |= dict(zip(held, imposed[t].tolist(), strict=True))
            measured = changed.step(action)
            if tell is not None and t % 200 == 0:
                tell(t / n)
    # what was asked for at a step is due at the next
    due = np.concatenate([path[:1], path[:-1]])
    errors = seen[:, at_y] - due
    reached = ends(controller.forward_model, offer.followed, offer.rest_length)
    clipped |= unreached
    # what creeps or relaxes also goes, for a while, where it is not sure to come
    out = {
        name: outside(due[:, followed.index(name)], *reached[name]) & clipped for name in reached
    }
    part = errors[scored]
    parts = dict(zip(followed, part.T, strict=True))
    far = {name: beyond(parts[name], out[name][scored], *reached[name]) for name in reached}
    references = {REFERENCE + c.name: c.unit for c in offer.followed}
    sent = {COMMAND + c.name: c.unit for c in offer.driven}
    units = {c.name: c.unit for c in offer.measured} | references | sent
    channels = dict(zip((*references, *sent), (*due.T, *commands.T), strict=True))
    channels |= dict(zip(changed.outputs, seen.T, strict=True))
    channels = dict(zip(held, imposed.T, strict=True)) | channels
    return Tracked(
        Recording(channels, step, units, -lead * step, {"plant": changed.name}),
        dict(zip(followed, np.sqrt(np.mean(part**2, axis=0)).tolist(), strict=True)),
        dict(zip(followed, np.abs(part).max(axis=0).tolist(), strict=True)),
        int(clipped[scored].sum()),
        (float(np.median(times)), float(np.quantile(times, 0.999))),
        {name: found for name, found in far.items() if found is not None},
    )


def _check(
    approach: float, settle: float, noise: float, delay: int, slew: float | None, step: float
) -> None:
    """Raise an error for settings out of range."""
    longest = MOST_STEPS * step
    ranges = {
        "approach": (approach, longest, "s"),
        "settle": (settle, longest, "s"),
        "noise": (noise, MOST_NOISE, "mm or N"),
        "delay": (delay, MOST_DELAY, "steps"),
    }
    for name, (value, most, unit) in ranges.items():
        require(0 <= value <= most, name, value, f"0 to {most:g} {unit}")
    require(slew is None or 0 < slew < np.inf, "slew", slew, "a positive number, in bar/s")


def ends(
    model: Block | None, followed: Sequence[Channel], rest_length: float | None
) -> dict[str, tuple[float, float]]:
    """Return the lowest and highest value that a model can reach, if known."""
    found: dict[str, tuple[float, float]] = {}
    if model is None:
        return found
    for channel in followed:
        line = match(channel, model.outputs, rest_length)
        if line is not None:
            place, gain, offset = line
            low, high = sorted(float(gain * end[place] + offset) for end in model.reachable())
            if np.isfinite([low, high]).all():
                found[channel.name] = low, high
    return found


def outside(reference: Array, low: float, high: float) -> NDArray[np.bool_]:
    """Return which samples of a reference, shape (n,), are out of the range by more than rounding."""
    margin = ROUNDING * (high - low)
    return np.asarray((reference < low - margin) | (reference > high + margin))


def beyond(errors: Array, out: NDArray[np.bool_], low: float, high: float) -> Beyond | None:
    """Return the part of a reference that is out of reach, by `outside`, or None."""
    if not out.any():
        return None
    others = errors[~out]
    elsewhere = float(np.sqrt(np.mean(others**2))) if others.size else float("nan")
    return Beyond(int(out.sum()), low, high, elsewhere)


STEADY = 0.2
"""Largest share of a step's error that is integrated: with more, the delay of a step causes
oscillation.
"""

FORGOTTEN = 0.02
"""Share of its weight that a step loses with the next."""

SLIGHT = 0.01
"""Share of the range: steps towards a command tell about the lag if they are longer."""


@dataclass
class PressureLoop:
    """PI feedback of pressure, added to the commanded pressure, as in regulators with a sensor.

    Compensators are identified on measured pressures, which lag behind commands as valves fill and vent.
    How far a pressure goes towards its command in a step depends on the valve, the volume and the step,
    so that share is estimated in the loop, and the gain follows: the whole way in a step where it is
    known, and none where there is no lag to be made up for.

    Parameters
    ----------
    low, high : array
        Limits of the command [bar].
    sample_time : float
        [s].
    most : float
        Largest proportional gain.
    integral : float
        [1/s]; less in long steps.
    """

    low: Array
    high: Array
    sample_time: float
    most: float = 3.0
    integral: float = 2.0

    def __post_init__(self) -> None:
        self._least = SLIGHT * (self.high - self.low)
        # over steps: what was left to go, squared, and times the way gone; equal without a lag
        self._left, self._gone = self._least**2, self._least**2
        self._sum = np.zeros_like(self.low)
        self._before: tuple[Array, Array, Array] | None = None

    def step(self, wanted: Array, measured: Array) -> Array:
        """Return the command."""
        if self._before is not None:
            self._learn(measured, *self._before)
        share = np.clip(self._gone / self._left, 1.0 / (1.0 + self.most), 1.0)
        command = wanted + (1.0 / share - 1.0) * (wanted - measured) + self._sum
        command = np.clip(command, self.low, self.high)
        self._before = wanted.copy(), measured.copy(), command
        return command

    def _learn(self, measured: Array, due: Array, start: Array, command: Array) -> None:
        """Integrate the error, and update the share of the way to a command that a step goes."""
        inside = (command > self.low) & (command < self.high)
        self._sum += min(self.integral * self.sample_time, STEADY) * (due - measured) * inside
        left = command - start
        fades = np.where(np.abs(left) > self._least, FORGOTTEN, 0.0)
        self._left = self._left + fades * (left**2 - self._left)
        self._gone = self._gone + fades * (left * (measured - start) - self._gone)
