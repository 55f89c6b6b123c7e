"""Baseline without compensation: a static map of the plant.

The map is measured in one slow cycle of pressure, from the lowest to the highest and back; it is
monotone and memoryless, in the middle of the loop. Several muscles are driven together, and each has its
own curve. With more muscles than motions, each is driven alone, and the map is linear.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.control.connecting import Plant, offer_of, reference_for
from mckibben.control.controller import Ahead, Controller
from mckibben.control.loop import Tracked, track
from mckibben.errors import MckibbenError, ModelError
from mckibben.recording import Recording, sample_time_of

UNCOMPENSATED = "no compensation"
"""Label of that loop in tables and figures."""

CYCLE_TIME = 60.0
"""Duration of the slow cycle of pressure [s]: long compared with air dynamics."""

KNOTS = 65
"""Number of knots of a curve."""

SIZE_WEIGHT = 1e-3
"""Weight of the command's size against the motion error: of equivalent commands the smallest is
chosen.
"""


@dataclass
class Rule(Controller):
    """Commands as a static function of the reference."""

    commands: Callable[[Array], Array]

    def reset(self, sample_time: float) -> None:
        """Do nothing, as there is no state."""

    def step(self, reference: Array, measured: Array, scheduled: Array, ahead: Ahead) -> Array:
        return self.commands(reference)


def linear_rule(rest: Array, slopes: Array, low: Array, high: Array) -> Callable[[Array], Array]:
    """Return a piecewise-linear rule, with the smallest of all equivalent commands.

    At the lowest commands what is followed is at ``rest``, shape (m,), and its slopes have shape (m, n).
    """
    from scipy.optimize import lsq_linear  # slow to load

    size_weights = SIZE_WEIGHT * float(np.abs(slopes).max()) * np.eye(low.size)

    def commands(reference: Array) -> Array:
        targets = np.concatenate([reference - rest, np.zeros(low.size)])
        limits = (0.0, high - low)
        return low + lsq_linear(np.vstack([slopes, size_weights]), targets, limits, method="bvls").x

    return commands


def slow_cycle(
    plant: Plant,
    reference: Recording,
    *,
    only: str | None = None,
    pressure_loop: bool = True,
    seed: int = 0,
) -> Recording:
    """Return the plant's response to a slow cycle of all commands together, or of one.

    Parameters
    ----------
    plant : Plant
    reference : Recording
        What is to be followed: its sample time, and what it holds at first, are those of the cycle.
    only : str, optional
        The one that is driven, while the others stay lowest.
    pressure_loop : bool
        As of `track`.
    seed : int
        Of the noise.

    Returns
    -------
    Recording
        Commands, what is held, and what is followed, as measured a step after.

    Raises
    ------
    DataError, ModelError
        As of `track`.
    """
    offer = offer_of(plant, reference)
    followed, driven = ([c.name for c in channels] for channels in (offer.followed, offer.driven))
    low, high = _limits(plant, driven)
    if only is not None:
        high = np.where([name == only for name in driven], high, low)
    steps = round(CYCLE_TIME / sample_time_of(reference, "be a reference"))
    first = {name: np.full(steps + 2, reference[name][0]) for name in (*followed, *offer.held)}
    shares = np.maximum(0.0, 1.0 - np.abs(2.0 * np.arange(steps + 2) / steps - 1.0))
    cycle = low + shares[:, np.newaxis] * (high - low)
    rows = iter(cycle)
    rest = Recording(first, reference.sample_time, {n: reference.units[n] for n in first})
    ramp = Rule(lambda _: next(rows))
    response = track(
        ramp, plant, rest, approach=0.0, pressure_loop=pressure_loop, seed=seed
    ).recording
    channels = {name: first[name][:-1] for name in offer.held}
    channels |= dict(zip(driven, cycle[:-1].T, strict=True))
    channels |= {name: response[name][1:] for name in followed}
    return Recording(channels, reference.sample_time)


def _limits(plant: Plant, driven: list[str]) -> tuple[Array, Array]:
    ends = [plant.limits(name) for name in driven]
    return np.array([end.low for end in ends]), np.array([end.high for end in ends])


def uncompensated(
    plant: Plant,
    reference: Recording,
    cycle: Recording,
    *,
    pressure_loop: bool = True,
    seed: int = 0,
) -> Controller:
    """Return the controller without compensation, from a plant's slow cycle.

    Parameters
    ----------
    plant : Plant
    reference : Recording
        What is to be followed.
    cycle : Recording
        From `slow_cycle`.
    pressure_loop, seed
        As of `slow_cycle`.

    Raises
    ------
    ModelError
        If something does not move.
    """
    offer = offer_of(plant, reference)
    followed, driven = ([c.name for c in channels] for channels in (offer.followed, offer.driven))
    if len(followed) != len(driven):
        lines = []
        for name in driven:
            single_cycle = slow_cycle(
                plant, reference, only=name, pressure_loop=pressure_loop, seed=seed
            )
            driven_by = single_cycle[name] - single_cycle[name][0]
            lines.append(
                np.polynomial.polynomial.polyfit(driven_by, single_cycle.matrix(followed), 1)
            )
        rests, slopes = np.transpose(lines, (1, 2, 0))
        return Rule(linear_rule(rests.mean(axis=1), slopes, *_limits(plant, driven)))
    curves = [curve(cycle[u], cycle[y], y) for u, y in zip(driven, followed, strict=True)]
    return Rule(
        lambda y: np.array([np.interp(x, *knots) for x, knots in zip(y, curves, strict=True)])
    )


def curve(command: Array, output: Array, name: str) -> tuple[Array, Array]:
    """Return the monotonic curve of a slow cycle: output, increasing, and command.

    Raises
    ------
    ModelError
        If nothing moves.
    """
    from scipy.optimize import isotonic_regression  # slow to load

    order = np.argsort(command, kind="stable")
    command, output = command[order], output[order]
    falls = np.polynomial.polynomial.polyfit(command, output, 1)[1] < 0.0
    smooth = np.asarray(isotonic_regression(output, increasing=not falls).x)
    if falls:
        smooth, command = smooth[::-1], command[::-1]
    outputs, group = np.unique(smooth, return_inverse=True)
    if outputs.size < 2:
        raise ModelError(
            f"{name} does not move with the command", remedy="check the plant and its limits"
        )
    commands = np.bincount(group, command) / np.bincount(
        group
    )  # of a stretch that is flat, its middle
    knots = np.linspace(outputs[0], outputs[-1], KNOTS)
    return knots, np.interp(knots, outputs, commands)


@dataclass(frozen=True)
class Before:
    """Result of the uncompensated loop.

    Parameters
    ----------
    tracked : Tracked or None
        Result with commands from the plant's own slow cycle; None if it could not be run.
    notes : tuple of str
        Why it could not be run.
    """

    tracked: Tracked | None
    notes: tuple[str, ...] = ()

    def beside(self, recording: Recording) -> Recording:
        """Return a loop's recording with the uncompensated outputs, as ``uncompensated_...``."""
        if self.tracked is None:
            return recording
        units, uncompensated = recording.units, self.tracked.recording
        return recording.with_channels(
            {f"uncompensated_{name}": units[name] for name in self.tracked.rmse},
            **{f"uncompensated_{name}": uncompensated[name] for name in self.tracked.rmse},
        )


def before(compensator: Block, plant: Plant, reference: Recording, **settings: Any) -> Before:
    """Run the loop without compensation on a plant, with the reference of a compensator.

    Settings are those of `track`; a preview is ignored, as no dead time is compensated.
    """
    settings.pop("preview", None)
    reference = reference_for(plant, reference, compensator)
    cycle_settings = {
        name: settings[name] for name in ("pressure_loop", "seed") if name in settings
    }
    try:
        cycle = slow_cycle(plant, reference, **cycle_settings)
        controller = uncompensated(plant, reference, cycle, **cycle_settings)
        return Before(track(controller, plant, reference, **settings))
    except MckibbenError as error:
        return Before(None, (f"there is no run without compensation: {error}",))
