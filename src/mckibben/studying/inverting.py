"""Check of a model's inverse on the model itself."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
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
"""Largest error of a valid inverse, relative to the reachable range."""

REACH = 0.01
"""Smallest reachable range of an inverse, relative to the recorded range of the output."""

NEARLY = 0.01
"""The same for a model's output on a recording, whose start may be out of reach."""


@dataclass(frozen=True)
class InverseCheck:
    """Result of an inverse on its own model.

    Of one muscle, on a reference it can reach: where nothing is known of that, on what the model makes
    of a recording. Of several, on a measured motion, which it may not reach.

    Parameters
    ----------
    model : str
        Short name of the model inverted.
    inverse : Block
        The compensator.
    reference, pressure, output : array, shape (n, k)
        Desired outputs, inputs that the inverse gives, and the model's outputs for these.
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
        """Label of the inverse's outputs."""
        return ", ".join(channel.name for channel in self.inverse.outputs)

    def to_dict(self) -> dict[str, Any]:
        """Return the inverted model, and the errors."""
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
        unvalidated = judged and row.skill_least is None  # the test must not decide
        if row.block is None or unvalidated or not acceptable(row, board.constant):
            continue
        try:
            return check_inverse(row.model, row.block, recording)
        except ModelError:
            continue
    return None


def check_inverse(model: str, block: Block, recording: Recording) -> InverseCheck:
    """Pass a reference through the inverse and back through the model.

    The reference has minor loops over all that can be reached; where a model does not say what that is,
    it is the output that the model gives for the recording, and of several inputs, the recorded motion.

    Parameters
    ----------
    model : str
        Short name.
    block : Block
        The model.
    recording : Recording
        Gives the sample time, loads, and the pace of the reference.

    Raises
    ------
    ModelError
        If the model has no inverse, nothing can be reached whatever happened before, or the inverse
        does not follow the reference.
    """
    inverse = compensator(block)
    step, most, reachable, own = recording.sample_time, float("inf"), None, False
    desired = recording
    if len(block.inputs) == 1:
        (output,) = block.outputs
        low, high = (float(end[0]) for end in block.reachable())
        own, most = bool(np.isinf([low, high]).all()), NEARLY
        if own:
            desired = recording.with_channels(
                **{output.name: block.simulate(recording)[output.name]}
            )
        elif high - low > REACH * np.ptp(recording[output.name]) and np.isfinite(high - low):
            reachable, most = (low, high), FOLLOWED
            desired = Recording(
                {output.name: minor_loops(low, high)}, step, units={output.name: output.unit}
            )
        else:
            raise ModelError(
                f"{model!r} has no output that it can reach whatever happened before",
                remedy="identify it on a recording that covers the range of interest",
            )
    reference = desired.matrix(channel.name for channel in block.outputs)
    span = np.ptp(reference, axis=0) if reachable is None else np.array([high - low])
    span = np.maximum(span, np.finfo(float).tiny)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        found = inverse.simulate(desired.select([channel.name for channel in inverse.inputs]))
        driven = desired.with_channels(found.units, **found.channels)
        output_of = block.simulate(driven).matrix(channel.name for channel in block.outputs)
    error = float((np.abs(output_of - reference) / span).max())
    if not error <= most:
        raise ModelError(
            f"the inverse of {model!r} misses a reachable reference by {error:.1e} of its range",
            remedy="invert another model",
        )
    commanded = inverse.outputs == block.inputs[: len(inverse.outputs)]
    plain = _without(block, recording, reference, step) if commanded else None
    return InverseCheck(
        model=model,
        inverse=inverse,
        reference=reference,
        pressure=found.matrix(channel.name for channel in inverse.outputs),
        output=output_of,
        time=desired.time,
        reachable=reachable,
        error=error,
        uncompensated=plain,
        uncompensated_error=(
            None if plain is None else float((np.abs(plain - reference) / span).max())
        ),
        own=own,
    )


def minor_loops(low: float, high: float) -> Array:
    """Return a reference over a range, with minor loops on slow triangles, shape (CHECK_SAMPLES,)."""
    phase = np.linspace(0, 1, CHECK_SAMPLES)
    slow = 1 - np.abs(2 * ((3 * phase) % 1) - 1)
    wave = slow * (1 - 0.5 * phase) + 0.12 * np.sin(2 * np.pi * 11 * phase) * phase
    share = (wave - wave.min()) / np.ptp(wave)
    return np.asarray(low + (high - low) * (0.02 + 0.96 * share))


def _without(
    block: Block, recording: Recording, reference: Array, step: float | None
) -> Array | None:
    """Return a model's outputs for inputs from its own slow rise, shape (n, outputs).

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
