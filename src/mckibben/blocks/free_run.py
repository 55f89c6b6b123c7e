"""Free-running outputs of a model on recordings, with a consistent start state."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.compose import Series
from mckibben.blocks.dynamics.starts import fitted_places, fitted_state
from mckibben.errors import ModelError, ModelWarning
from mckibben.recording import Recording

Mask = NDArray[np.bool_]

PERIODIC = "periodic"
"""Key in the ``meta`` of a recording that is one period of a periodic motion."""

AWAY = 1e3
"""Error, in ranges of the measured output, above which a model has diverged."""

SETTLING = 256
"""Number of samples for which the first input is held after the preceding peak, so that rates
decay.
"""


def run_free(
    block: Block,
    recording: Recording,
    output: str | Sequence[str],
    known: Sequence[Recording] = (),
    known_rows: Sequence[Mask] | None = None,
) -> Array:
    """Return modelled outputs over a recording, shape (n,) of one that is named, (n, k) of several.

    Memory starts from the end of the known recording that this one continues; else from the
    `measured_start`, which of several driving inputs is the model's own rule. A linear model whose
    start is fitted starts from what explains best its samples that are known, where the recording is or
    begins as a known one. After that nothing measured but the inputs is used.

    Parameters
    ----------
    known : sequence of Recording
        What the model was identified from.
    known_rows : sequence of bool arrays, optional
        For every one of them, the samples whose outputs are known; default all.

    Raises
    ------
    ModelError
        If the output is not finite.
    """
    outputs = (output,) if isinstance(output, str) else output
    if recording.meta.get(PERIODIC):
        repeated = _repeated(block, recording, outputs)
        return repeated[:, 0] if isinstance(output, str) else repeated
    before = predecessor(recording, known)
    rows = [np.ones(len(r), dtype=bool) for r in known] if known_rows is None else known_rows
    if before is not None:
        start = block.final_state(before, initial=known_start(block, before, outputs).tolist())
    else:
        beginning = (
            (r, mask) for r, mask in zip(known, rows, strict=True) if _begins(recording, r)
        )
        own, mask = next(beginning, (None, None))
        start = (
            measured_start(block, recording, outputs)
            if own is None
            else known_start(block, own, outputs, mask)
        )
    found = block.simulate(recording, initial=start.tolist()).matrix(outputs)
    return found[:, 0] if isinstance(output, str) else found


def predecessor(recording: Recording, others: Sequence[Recording]) -> Recording | None:
    """Return the recording that this one continues, or None."""
    return next((other for other in others if recording.continues(other)), None)


def refuse_runaway(block: Block, recording: Recording, modelled: Array, measured: Array) -> None:
    """Raise a `ModelError` if a model's outputs (n, k) diverge from the measured ones."""
    if not (np.abs(modelled - measured) <= AWAY * np.ptp(measured, axis=0)).all():
        far, wide = float(np.abs(modelled).max()), float(np.ptp(measured, axis=0).max())
        raise ModelError(
            f"the output of {block.kind!r} runs away on {recording.name}: to {far:.4g}, "
            f"where what is measured spans {wide:.4g}",
            remedy="see whether units are those that it was identified in; if so, this "
            "model does not suit these data: identify it again",
        )


def _repeated(block: Block, recording: Recording, outputs: Sequence[str]) -> Array:
    """Return the periodic response to a repeated period: at least the second."""
    if hasattr(block, "steady_state"):
        return block.steady_state(recording).matrix(outputs)
    names = [channel.name for channel in block.inputs]
    twice = np.tile(recording.matrix(names), (2, 1))
    found = block.simulate(twice, sample_time=recording.sample_time)[len(recording) :]
    given = [channel.name for channel in block.outputs]
    return np.asarray(found[:, [given.index(name) for name in outputs]])


def known_start(
    block: Block, recording: Recording, outputs: Sequence[str], rows: Mask | None = None
) -> Array:
    """Return the least-squares state if the start is fitted; otherwise `measured_start`."""
    if block.start == "fitted" or fitted_places(block):
        inputs = recording.matrix(channel.name for channel in block.inputs)
        return fitted_state(block, inputs, recording[outputs[0]], recording.sample_time, rows)
    return measured_start(block, recording, outputs)


def _begins(recording: Recording, known: Recording) -> bool:
    """Return whether a known recording is this one, or its beginning."""
    n = len(known)
    return known is recording or (
        known.start_time == recording.start_time
        and n <= len(recording)
        and list(known.channels) == list(recording.channels)
        and all(np.array_equal(recording[name][:n], known[name]) for name in known.channels)
    )


def measured_start(block: Block, recording: Recording, names: str | Sequence[str]) -> Array:
    """Return the state before the first sample that best explains the first measured output.

    The candidates are the block's own rule, for what has come to the first sample just now; and memories
    of a single excursion, long ago: the input came down from a peak between the first sample and the
    highest of the block's range or the recording. The lowest peak that explains the output is taken, so
    a model that has only risen starts from its own rule.
    """
    inputs = recording.matrix(channel.name for channel in block.inputs)
    first = inputs[0]
    driving = len(block.inputs) - len(block.scheduling)
    if block.n_states == 0 or driving > 1:
        return block.initial_state(first)
    highest = inputs[:, 0].max()
    limits = getattr(_first_part(block), "input_range", None)
    if limits is not None:
        highest = max(highest, limits[1])
    outputs = np.array([recording[channel.name][0] for channel in block.outputs])
    known = block.state_at(first, outputs)
    if known is not None:
        return known
    name = names if isinstance(names, str) else names[0]
    measured = float(recording[name][0])
    place = [channel.name for channel in block.outputs].index(name)

    def after(peak: float, settling: int = SETTLING) -> tuple[float, Array]:
        history = np.repeat(first[np.newaxis], settling + 1, axis=0)
        history[0, 0] = peak
        state = block.initial_state(history[0], "first_sample" if peak > first[0] else None)
        outputs = np.empty((len(history), len(block.outputs)))
        block.bind(recording.sample_time or 1.0, state, history, outputs)()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", ModelWarning)
                block.report(state)
        except ModelWarning:  # a start that the model itself warns of is none
            return np.inf, state
        return abs(float(outputs[-1, place]) - measured), state

    best_error, best_state = after(first[0], 0)[0], block.initial_state(first)
    low, high = float(first[0]), float(highest)
    for _ in range(3):
        peaks = np.linspace(low, high, 17)
        tried = [after(peak) for peak in peaks]
        errors = [error for error, _ in tried]
        best = int(np.argmin(errors))
        if errors[best] < best_error * (1 - 1e-9):
            best_error, best_state = tried[best]
        low, high = float(peaks[max(best - 1, 0)]), float(peaks[min(best + 1, 16)])
    return best_state


def _first_part(block: Block) -> Block:
    return _first_part(block.parts[0]) if isinstance(block, Series) else block
