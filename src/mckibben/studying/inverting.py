"""The inverse of a model, tried on the model itself."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.force.feedforward import compensator
from mckibben.comparison.choosing import acceptable
from mckibben.comparison.leaderboard import Leaderboard
from mckibben.control.uncompensated import RISE, curve
from mckibben.errors import MckibbenError, ModelError, ModelWarning
from mckibben.recording import Recording

CHECK_SAMPLES = 2000

MOST_RISE = 20_000
"""Samples of a slow rise, and as many without time."""

FOLLOWED = 1e-6
"""Largest error of an inverse that counts as one, relative to the reachable range."""

NEARLY = 0.01
"""The same on what a model makes of a recording, whose start may be out of reach."""


@dataclass(frozen=True)
class InverseCheck:
    """The inverse of a model, tried on the model itself.

    Of one muscle, on a reference it can reach: where nothing is known of that, on what the model makes
    of a recording. Of several, on a measured motion, which it may not reach.

    Parameters
    ----------
    model : str
        Short name of the model inverted.
    inverse : Block
        The compensator.
    reference, pressure, output : array, shape (n,), or (n, k) of several
        Wished-for output, input the inverse gives, and what the model makes of it.
    time : array, shape (n,)
        Time [s], or sample numbers.
    reachable : (float, float) or None
        Outputs reachable whatever happened before; None where nothing is known of that.
    error : float
        Largest difference between reference and output, relative to that range, or to the reference's.
    uncompensated : array, shape of ``output``, or None
        What the model does without the inverse, its inputs read off its own slow rise
        (`mckibben.control.uncompensated`); None where inputs and outputs do not pair.
    uncompensated_error : float or None
        As ``error``.
    own : bool
        Whether the reference is what the model makes of a recording.
    """

    model: str
    inverse: Block
    reference: Array
    pressure: Array
    output: Array
    time: Array
    reachable: tuple[float, float] | None
    error: float
    uncompensated: Array | None = None
    uncompensated_error: float | None = None
    own: bool = False

    @property
    def given(self) -> str:
        """What the inverse gives, in words."""
        return ", ".join(channel.name for channel in self.inverse.outputs)

    def to_dict(self) -> dict[str, Any]:
        """Return which model is inverted, and how well."""
        reachable = None if self.reachable is None else list(self.reachable)
        found = {"model": self.model, "error": self.error, "reachable": reachable}
        return found | {"uncompensated_error": self.uncompensated_error}


def invert_best(board: Leaderboard, recording: Recording) -> InverseCheck | None:
    """Invert the first model of a leaderboard that has an inverse, and check it.

    None where no model is recommended, for an inverse is as good as its model.
    """
    if board.best is None:
        return None
    judged = board.best.skill_least is not None
    for row in board.rows:
        unknown = (
            judged and row.skill_least is None
        )  # only the test speaks for it, which is no choice
        if row.block is None or unknown or not acceptable(row, board.constant):
            continue
        try:
            return check_inverse(row.model, row.block, recording)
        except ModelError:
            continue
    return None


def check_inverse(model: str, block: Block, recording: Recording) -> InverseCheck:
    """Send a reference with minor loops through the inverse and back through the model.

    Of a model of several inputs, the reference is the recording's own motion, which may be out of reach;
    of one that does not say what it can reach, it is what the model makes of the recording.

    Parameters
    ----------
    model : str
        Short name.
    block : Block
        The model.
    recording : Recording
        Gives the sample time and the pace of the reference.

    Raises
    ------
    ModelError
        If the model has no inverse, nothing can be reached whatever happened before, or the inverse
        does not follow the reference.
    """
    inverse = compensator(block)
    if len(block.inputs) > 1:
        return _check_on_motion(model, block, inverse, recording)
    lows, highs = block.reachable()
    low, high = float(lows[0]), float(highs[0])
    if np.isinf([low, high]).all():  # as far as its own inputs know
        names = [channel.name for channel in block.inputs]
        made = block.simulate(recording.select(names))
        found = _check_on_motion(
            model, block, inverse, made.select([*names, block.outputs[0].name])
        )
        _followed(model, found.error, NEARLY)
        return replace(found, own=True)
    if not (np.isfinite([low, high]).all() and low < high):
        raise ModelError(
            f"{model!r} has no output that it can reach whatever happened before. "
            "Remedy: identify it on a recording that covers the range of interest."
        )
    phase = np.linspace(0, 1, CHECK_SAMPLES)
    slow = 1 - np.abs(2 * ((3 * phase) % 1) - 1)
    wave = slow * (1 - 0.5 * phase) + 0.12 * np.sin(2 * np.pi * 11 * phase) * phase
    share = (wave - wave.min()) / np.ptp(wave)
    reference = low + (high - low) * (0.02 + 0.96 * share)
    step = recording.sample_time
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        pressure = inverse.simulate(reference, sample_time=step)
    output = block.simulate(pressure, sample_time=step)
    error = float(np.abs(output - reference).max() / (high - low))
    _followed(model, error, FOLLOWED)
    plain = _without(block, recording, reference[:, np.newaxis], step)
    plain = None if plain is None else plain[:, 0]
    return InverseCheck(
        model=model,
        inverse=inverse,
        reference=reference,
        pressure=pressure,
        output=output,
        time=np.arange(CHECK_SAMPLES, dtype=np.float64) * (1.0 if step is None else step),
        reachable=(low, high),
        error=error,
        uncompensated=plain,
        uncompensated_error=(
            None if plain is None else float(np.abs(plain - reference).max() / (high - low))
        ),
    )


def _followed(model: str, error: float, most: float) -> None:
    """Refuse an inverse that is off by so much of a reference's range."""
    if not error <= most:
        raise ModelError(
            f"the inverse of {model!r} misses a reachable reference by {error:.1e} of its range. "
            "Remedy: invert another model."
        )


def _check_on_motion(
    model: str, block: Block, inverse: Block, recording: Recording
) -> InverseCheck:
    """Send a recording's motion through an inverse and back through the model."""
    names = [channel.name for channel in block.outputs]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        wanted = recording.select([channel.name for channel in inverse.inputs])
        given = inverse.simulate(wanted)
        told = {c.name: recording[c.name] for c in block.inputs if c.name not in given}
        driven = given.with_channels(**told).select([c.name for c in block.inputs])
        output = block.simulate(driven).matrix(names)
    reference = recording.matrix(names)
    span = np.maximum(np.ptp(reference, axis=0), np.finfo(float).tiny)
    commanded = inverse.outputs == block.inputs[: len(inverse.outputs)]
    step = recording.sample_time
    plain = _without(block, recording, reference, step) if commanded else None
    return InverseCheck(
        model=model,
        inverse=inverse,
        reference=reference,
        pressure=given.matrix([channel.name for channel in inverse.outputs]),
        output=output,
        time=recording.time,
        reachable=None,
        error=float((np.abs(output - reference) / span).max()),
        uncompensated=plain,
        uncompensated_error=(
            None if plain is None else float((np.abs(plain - reference) / span).max())
        ),
    )


def _without(
    block: Block, recording: Recording, reference: Array, step: float | None
) -> Array | None:
    """Return what a model does where its inputs are read off its own slow rise, shape (n, outputs).

    Inputs rise from the lowest to the highest recorded, with what schedules as the recording begins.
    """
    n_driven = len(block.inputs) - len(block.scheduling)
    if n_driven != len(block.outputs) or any(c.name not in recording for c in block.inputs):
        return None
    recorded = recording.matrix(channel.name for channel in block.inputs)
    rise = np.tile(recorded[0], (MOST_RISE if step is None else _steps(step), 1))
    low, high = recorded[:, :n_driven].min(axis=0), recorded[:, :n_driven].max(axis=0)
    rise[:, :n_driven] = np.linspace(low, high, len(rise))
    given = np.tile(recorded[0], (len(reference), 1))
    if len(recorded) == len(reference):
        given[:] = recorded
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        try:
            risen = block.simulate(rise, sample_time=step).reshape(len(rise), -1)
            for k, channel in enumerate(block.outputs):
                places, commands = curve(rise[:, k], risen[:, k], channel.name)
                given[:, k] = np.interp(reference[:, k], places, commands)
            found = block.simulate(given, sample_time=step).reshape(len(given), -1)
        except MckibbenError:
            return None
    return found if np.isfinite(found).all() else None


def _steps(step: float) -> int:
    return min(max(round(RISE / step), 2), MOST_RISE)
