"""Calibrating a fitted model: its band, from recordings that it was not fitted to."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np

from mckibben.bands.finding import Found, Unit, find_band
from mckibben.bands.held import Held
from mckibben.blocks.bands import Banded, inside
from mckibben.blocks.base import Block
from mckibben.blocks.free_run import refuse_runaway, run_free
from mckibben.blocks.inverse import commands
from mckibben.comparison.shared_rows import check_shared
from mckibben.errors import DataError, ModelError, ModelWarning
from mckibben.recording import Recording, listed
from mckibben.system.progress import Tell, one_by_one, telling

FEWEST = 20
"""Samples of a run that anything is told by."""

EVEN = 1e-3
"""Relative difference of sample times that are the same."""


def calibrate(
    model: Block,
    recordings: Recording | Sequence[Recording],
    *,
    exchangeable: Unit = "auto",
    fitted: Sequence[Recording] = (),
    progress: bool | Tell | None = None,
) -> Banded:
    """Return a model with bands that hold on new runs, if these are like the recordings.

    The model runs free over each recording, and what it misses bounds what it misses next (conformal
    prediction): of a new run that is exchangeable with these, the band at a level holds about so many of
    its samples on average, if its memory begins as theirs do: at rest, or as explains what is measured
    first. It is shifted and scaled by the state of motion: how far from the last
    reversals, how fast, how far along its range, under which load. ``banded.at(0.9)`` chooses the
    level; n runs allow n / (n + 1).

    Parameters
    ----------
    model : Block
        A forward model, perhaps with a band, which is then found anew.
    recordings : Recording or sequence of Recording
        With the model's inputs and outputs, of one sample time, and not those that it was fitted to.
    exchangeable : {"auto", "run", "block"}
        What is exchangeable: runs, or blocks of runs that are long against the memory of the error.
        By default runs from 20 on, else blocks, and a warning says so.
    fitted : sequence of Recording, optional
        Those that it was fitted to, to make sure that none is among the recordings.
    progress : bool or callable, optional
        Whether to show a bar; or who is told the share done, and words.

    Returns
    -------
    Banded

    Raises
    ------
    DataError
        On recordings too short, of several sample times, without a channel, or that share stretches
        with those fitted.
    ModelError
        On a model of inputs, or one that does not run on these recordings.

    Examples
    --------
    >>> import mckibben
    >>> import numpy as np
    >>> from mckibben.signals import random_wave
    >>> model = mckibben.PI.example()
    >>> runs = []
    >>> for seed in range(40):
    ...     u = random_wave(0.1 * np.arange(100), 0.5, 5.0, seed=seed)
    ...     y = model.simulate(u) + 0.1 * np.random.default_rng(seed).standard_normal(100)
    ...     runs.append(mckibben.Recording({"pressure": u, "displacement": y}, 0.1))
    >>> list(mckibben.calibrate(model, runs).at(0.8).simulate(runs[0]).channels)
    ['pressure', 'displacement', 'displacement_lower', 'displacement_upper']
    """
    runs = listed(recordings)
    with telling(progress, "calibrating") as tell:
        banded, found = calibration(
            model, runs, exchangeable=exchangeable, fitted=listed(fitted), tell=tell
        )
    for note in found.notes:
        warnings.warn(note, ModelWarning, stacklevel=2)
    return banded


def calibration(
    model: Block,
    recordings: Sequence[Recording],
    *,
    exchangeable: Unit = "auto",
    fitted: Sequence[Recording] = (),
    tell: Tell | None = None,
) -> tuple[Banded, Found]:
    """Return a model with its band, and what is to be said of it; see `calibrate`."""
    model = inside(model)
    if commands(model):
        raise ModelError(
            f"{model.title!r} gives inputs, and bands are of outputs. Remedy: calibrate the model that "
            "was inverted."
        )
    if not recordings:
        raise DataError("there is nothing to calibrate on", remedy="give at least one recording")
    inputs = [channel.name for channel in model.inputs]
    outputs = [channel.name for channel in model.outputs]
    _check_time(recordings)
    for recording in recordings:
        for channel in model.outputs:
            if (
                recording[channel.name] is not None
                and recording.units[channel.name] != channel.unit
            ):
                raise DataError(
                    f"the model gives {channel.unit or 'no unit'}, the recording has "
                    f"{recording.units[channel.name] or 'no unit'}",
                    file=recording.source,
                    channel=channel.name,
                    remedy="convert the recording, or name its unit when reading it",
                )
        if len(recording) < FEWEST:
            raise DataError(
                f"{len(recording)} samples are too few to tell what a model misses",
                file=recording.source,
                remedy=f"calibrate on recordings of {FEWEST} samples or more",
            )
    for name in outputs:
        if all(np.ptp(recording[name]) == 0 for recording in recordings):
            raise DataError(
                "the output is constant, as of a sensor that is stuck",
                file=recordings[0].source,
                channel=name,
                remedy="record while it moves, or name another column with --column",
            )
    check_shared({"fit": fitted, "calibrate": recordings}, inputs, outputs)
    held = [held_of(model, recording, outputs) for recording in one_by_one(recordings, tell)]
    found = find_band(model, held, exchangeable)
    return Banded(model, found.band), found


def _check_time(recordings: Sequence[Recording]) -> None:
    """Refuse recordings of several sample times, in which blocks would differ in length."""
    steps = sorted({recording.sample_time or 0.0 for recording in recordings})
    if steps[-1] - steps[0] > EVEN * steps[-1]:
        raise DataError(
            f"sample times differ, from {steps[0]:g} to {steps[-1]:g} s",
            file=recordings[0].source,
            remedy="resample all to one (--resample)",
        )


def held_of(model: Block, recording: Recording, outputs: Sequence[str]) -> Held:
    """Return a model's free run over a recording; the first sample, which starts it, does not count."""
    counts = np.ones(len(recording), dtype=bool)
    counts[0] = False
    modelled, measured = run_free(model, recording, outputs), recording.matrix(outputs)
    refuse_runaway(model, recording, modelled, measured)
    return Held(
        inputs=recording.matrix(channel.name for channel in model.inputs),
        modelled=modelled,
        measured=measured,
        counts=counts,
        sample_time=recording.sample_time,
    )
