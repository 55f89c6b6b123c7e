"""Closing a loop: any controller on anything that steps like a rig."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.blocks.base import Block, Stream
from mckibben.blocks.fields import Channel
from mckibben.control.connecting import Offer, Plant, match, offer_of, reference_for, rest_settings
from mckibben.control.controller import BlockController, Controller, samples_ahead
from mckibben.control.pressure_loop import PressureLoop
from mckibben.errors import ModelError, require
from mckibben.recording import COMMAND, REFERENCE, Recording, sample_time_of
from mckibben.signals.checking import generator
from mckibben.system.progress import telling
from mckibben.system.showing import DrawsItself

Range = tuple[float, float]
"""Lowest and highest value."""

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

LEAST_CLIPPING = 1e-9
"""Smallest difference between wanted and applied command that counts as clipping [bar or V]."""

STEPS_BETWEEN_REPORTS = 200
"""Control steps from one report of the progress to the next."""


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
    reference = reference_for(
        plant, reference, controller if isinstance(controller, Block) else None
    )
    if isinstance(controller, Block):
        controller = BlockController(controller)
    preview = controller.preview if preview is None else preview
    # the reference of the next step is given without any preview
    preview_steps = max(samples_ahead(preview, step) - 1, 0) + controller.samples_ahead
    rng = generator(seed)
    offer = offer_of(plant, reference)
    controller.connect(offer)
    starts = rest_settings(plant, {name: float(reference[name][0]) for name in offer.held})
    settings: dict[str, float] = {"sample_time": step, **starts}
    plant = plant.changed(settings)

    n_approach = round(approach / step)
    scored = slice(n_approach + round(settle / step), n_approach + len(reference))
    if scored.start >= scored.stop:
        raise ModelError(
            "nothing is left to score",
            parameter="settle",
            remedy="give a longer reference, or less settle",
        )
    commands = _Commands.of(plant, offer, step, pressure_loop=pressure_loop, slew=slew)
    controller.reset(step)
    at_rest = plant.reset(seed)
    sensor = _Sensor(_columns(plant, offer.followed), at_rest, delay, noise, rng)
    schedule = _schedule_of_run(reference, offer, n_approach, at_rest[sensor.followed_columns])

    with telling(progress, "tracking") as tell:
        log = _run_loop(
            controller,
            plant,
            offer,
            schedule,
            at_rest,
            sensor,
            commands,
            preview_steps=preview_steps,
            step=step,
            tell=tell,
        )
    followed = [channel.name for channel in offer.followed]
    due = schedule.due
    errors = log.measured[:, sensor.followed_columns] - due
    reachable = reachable_ranges(controller.forward_model, offer.followed, offer.rest_length)
    recording = _recorded(log, schedule, offer, plant, step, n_approach)
    return _scored(recording, errors, due, log, followed, reachable, scored)


@dataclass(frozen=True)
class _Schedule:
    """What is asked for in the n steps of a run, the approach included.

    Parameters
    ----------
    followed : array, shape (n, k)
        References of `Offer.followed`, each to be reached at the next step.
    scheduled : array, shape (n, l)
        Values of `Offer.scheduled`.
    held : array, shape (n, h)
        Values of `Offer.held`.
    """

    followed: Array
    scheduled: Array
    held: Array

    def __len__(self) -> int:
        return len(self.followed)

    @property
    def due(self) -> Array:
        """What the plant should measure in every step: the reference of the step before."""
        return np.concatenate([self.followed[:1], self.followed[:-1]])


def _schedule_of_run(
    reference: Recording, offer: Offer, n_approach: int, followed_at_rest: Array
) -> _Schedule:
    """Return the schedule of a run: a straight approach from rest, then the reference."""
    followed = reference.matrix([channel.name for channel in offer.followed])
    share = np.linspace(0.0, 1.0, n_approach, endpoint=False)[:, np.newaxis]
    approach = followed_at_rest + share * (followed[0] - followed_at_rest)

    names = [channel.name for channel in offer.scheduled]
    scheduled = reference.matrix(names) if names else np.empty((len(reference), 0))
    scheduled = np.concatenate([np.tile(scheduled[:1], (n_approach, 1)), scheduled])
    held = scheduled[:, [names.index(name) for name in offer.held]]
    return _Schedule(np.concatenate([approach, followed]), scheduled, held)


def _columns(plant: Plant, channels: Sequence[Channel]) -> list[int]:
    """Return the columns of channels among all that a plant measures, without those it does not."""
    outputs = list(plant.outputs)
    return [outputs.index(channel.name) for channel in channels if channel.name in outputs]


class _Sensor:
    """Measurements as the controller receives them: delayed, and with noise on what is followed."""

    def __init__(
        self,
        followed_columns: list[int],
        at_rest: Array,
        delay: int,
        noise: float,
        rng: np.random.Generator,
    ) -> None:
        self.followed_columns = followed_columns
        self._noise, self._rng = noise, rng
        self._delay_line = deque([at_rest] * (delay + 1), maxlen=delay + 1)

    def delayed_and_noisy(self, measured: Array) -> Array:
        """Return what is received in the step in which ``measured`` is measured, a new array."""
        self._delay_line.append(measured)
        received = self._delay_line[0].copy()
        received[self.followed_columns] += self._noise * self._rng.standard_normal(
            len(self.followed_columns)
        )
        return received


@dataclass
class _Commands:
    """Limits of the commands [bar or V], and the inner loop of pressure, if there is one.

    Parameters
    ----------
    low, high : array, shape (n,)
    largest_change : float or None
        In a step; None without a limit.
    pressure_loop : PressureLoop or None
    pressure_columns : list of int
        Pressures among the measurements.
    """

    low: Array
    high: Array
    largest_change: float | None
    pressure_loop: PressureLoop | None
    pressure_columns: list[int]
    _previous: Array | None = None

    @classmethod
    def of(
        cls, plant: Plant, offer: Offer, step: float, *, pressure_loop: bool, slew: float | None
    ) -> Self:
        """Return the limits of a plant; an inner loop needs every driven pressure measured."""
        limits = [plant.limits(channel.name) for channel in offer.driven]
        low, high = (np.array([getattr(limit, end) for limit in limits]) for end in ("low", "high"))
        columns = _columns(plant, offer.driven)
        inner = pressure_loop and len(columns) == len(offer.driven)
        return cls(
            low,
            high,
            None if slew is None else slew * step,
            PressureLoop(low, high, step) if inner else None,
            columns,
        )

    def within_limits(self, wanted: Array) -> Array:
        """Return wanted commands within the limits of value and change; once a step."""
        allowed = np.clip(wanted, self.low, self.high)
        if self.largest_change is not None and self._previous is not None:
            lowest = self._previous - self.largest_change
            highest = self._previous + self.largest_change
            allowed = np.clip(allowed, lowest, highest)
        self._previous = allowed
        return allowed

    def corrected(self, allowed: Array, measured: Array) -> Array:
        """Return what is sent to the plant: corrected by measured pressures with an inner loop."""
        if self.pressure_loop is None:
            return allowed
        return self.pressure_loop.step(allowed, measured[self.pressure_columns])


@dataclass(frozen=True)
class _Log:
    """What happened in the n steps of a run.

    Parameters
    ----------
    measured : array, shape (n, k)
        All that the plant measures, without delay and noise.
    commands : array, shape (n, m)
        As sent to the plant.
    clipped : array of bool, shape (n,)
        Where a command was at a limit, or the compensator clipped what was due.
    step_times : array, shape (n,)
        Time that the controller took [s].
    """

    measured: Array
    commands: Array
    clipped: NDArray[np.bool_]
    step_times: Array

    @classmethod
    def empty(cls, n: int, n_measured: int, n_commands: int) -> Self:
        """Return a log to be filled."""
        clipped = np.zeros(n, dtype=bool)
        return cls(np.empty((n, n_measured)), np.empty((n, n_commands)), clipped, np.empty(n))


def _run_loop(
    controller: Controller,
    plant: Plant,
    offer: Offer,
    schedule: _Schedule,
    measured: Array,
    sensor: _Sensor,
    commands: _Commands,
    *,
    preview_steps: int,
    step: float,
    tell: Callable[[float], None] | None,
) -> _Log:
    """Run a controller on a plant, both reset, step by step; ``measured`` is the first measurement."""
    n, driven = len(schedule), [channel.name for channel in offer.driven]
    log = _Log.empty(n, len(measured), len(driven))
    for t in range(n):
        log.measured[t] = measured
        received = sensor.delayed_and_noisy(measured)
        ahead = min(t + preview_steps, n - 1)
        previewed = schedule.followed[ahead], schedule.scheduled[ahead]

        started = time.perf_counter()
        wanted = controller.step(schedule.followed[t], received, schedule.scheduled[t], previewed)
        log.step_times[t] = time.perf_counter() - started
        if wanted.shape != commands.low.shape or not np.isfinite(wanted).all():
            raise ModelError(
                f"the controller gave {wanted} for {len(driven)} muscles at {t * step:g} s",
                remedy="use a compensator made for this plant",
            )

        allowed = commands.within_limits(wanted)
        log.clipped[t] |= bool((np.abs(allowed - wanted) > LEAST_CLIPPING).any())
        if t + 1 < n and controller.stream is not None:
            # the compensator clipped what is due at the next step
            log.clipped[t + 1] = controller.stream.status & Stream.CLIPPED
        controller.applied(allowed)
        log.commands[t] = commands.corrected(allowed, measured)

        action = dict(zip(driven, log.commands[t].tolist(), strict=True))
        action |= dict(zip(offer.held, schedule.held[t].tolist(), strict=True))
        measured = plant.step(action)
        if tell is not None and t % STEPS_BETWEEN_REPORTS == 0:
            tell(t / n)
    return log


def _recorded(
    log: _Log, schedule: _Schedule, offer: Offer, plant: Plant, step: float, n_approach: int
) -> Recording:
    """Return what was held, asked for, sent and measured; time is 0 at the end of the approach."""
    references = {REFERENCE + c.name: c.unit for c in offer.followed}
    sent = {COMMAND + c.name: c.unit for c in offer.driven}
    units = {c.name: c.unit for c in offer.measured} | references | sent
    channels = dict(zip((*references, *sent), (*schedule.due.T, *log.commands.T), strict=True))
    channels |= dict(zip(plant.outputs, log.measured.T, strict=True))
    channels = dict(zip(offer.held, schedule.held.T, strict=True)) | channels
    return Recording(channels, step, units, -n_approach * step, {"plant": plant.name})


def _scored(
    recording: Recording,
    errors: Array,
    due: Array,
    log: _Log,
    followed: Sequence[str],
    reachable: Mapping[str, Range],
    scored: slice,
) -> Tracked:
    """Return the errors of a run, shape (n, k), in the scored steps, and where it was out of reach."""
    out_of_reach = {}
    for name, ends in reachable.items():
        column = followed.index(name)
        # a creeping model can briefly exceed its guaranteed range, so only clipped samples count
        out = (outside_range(due[:, column], *ends) & log.clipped)[scored]
        part = score_out_of_reach(errors[scored, column], out, *ends)
        if part is not None:
            out_of_reach[name] = part
    scored_errors = errors[scored]
    return Tracked(
        recording,
        dict(zip(followed, np.sqrt(np.mean(scored_errors**2, axis=0)).tolist(), strict=True)),
        dict(zip(followed, np.abs(scored_errors).max(axis=0).tolist(), strict=True)),
        int(log.clipped[scored].sum()),
        (float(np.median(log.step_times)), float(np.quantile(log.step_times, 0.999))),
        out_of_reach,
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


def reachable_ranges(
    model: Block | None, followed: Sequence[Channel], rest_length: float | None
) -> dict[str, Range]:
    """Return the lowest and highest value that a model can reach, by channel, where known."""
    ranges: dict[str, Range] = {}
    if model is None:
        return ranges
    for channel in followed:
        line = match(channel, model.outputs, rest_length)
        if line is not None:
            place, gain, offset = line
            low, high = sorted(float(gain * end[place] + offset) for end in model.reachable())
            if np.isfinite([low, high]).all():
                ranges[channel.name] = low, high
    return ranges


def outside_range(reference: Array, low: float, high: float) -> NDArray[np.bool_]:
    """Return which samples of a reference, shape (n,), are out of a range by more than rounding."""
    margin = ROUNDING * (high - low)
    return np.asarray((reference < low - margin) | (reference > high + margin))


def score_out_of_reach(
    errors: Array, out: NDArray[np.bool_], low: float, high: float
) -> Beyond | None:
    """Return the score of the samples that are out of reach, both shape (n,); None without any."""
    if not out.any():
        return None
    others = errors[~out]
    elsewhere = float(np.sqrt(np.mean(others**2))) if others.size else float("nan")
    return Beyond(int(out.sum()), low, high, elsewhere)
