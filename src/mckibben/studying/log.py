"""A robot's own log: what was wished for, what was commanded, what came of it, by names of channels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.bands import inside
from mckibben.blocks.base import Block
from mckibben.blocks.feedback import MEASURED, FeedforwardFeedback
from mckibben.blocks.predictive import Predictive
from mckibben.control.twin import COMMAND
from mckibben.errors import DataError, ModelError
from mckibben.recording import Recording

REFERENCE = "reference_"
"""What names of channels begin with that are wished for."""

FEWEST = 60
"""Scored samples of a log."""


@dataclass(frozen=True)
class Loop:
    """What ran, as far as it is known.

    Parameters
    ----------
    model : Block
        From pressures to what is followed.
    compensator : Block or None
        From what is wished for to pressures; None where the model has no inverse.
    inputs : tuple of str
        What drives the model.
    outputs : tuple of str
        What is followed: the model's outputs that the logs hold references of.
    exact : bool
        Whether the compensator is the inverse of this very model, and stays it: it neither learns nor
        plans.
    """

    model: Block
    compensator: Block | None
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    exact: bool

    @property
    def learns(self) -> bool:
        """Whether the compensator takes what is measured."""
        return self.compensator is not None and feels(self.compensator)

    @property
    def known(self) -> bool:
        """Whether what the compensator gives can be computed: all of its references are logged."""
        return self.compensator is not None and len(self.outputs) == len(self.model.outputs)


def loop_of(model: Block | None, compensator: Block | None, logs: Sequence[Recording]) -> Loop:
    """Return what ran in the loops of some logs.

    Raises
    ------
    DataError
        On no logs, logs without time, or without what the model and the loop name.
    ModelError
        Without a model, or with a compensator that gives something else than it takes.
    """
    if not logs:
        raise DataError(
            "no recording holds a reference, so there is no loop to look back on",
            remedy="map its column, as in --column reference_displacement=COLUMN",
        )
    if isinstance(compensator, FeedforwardFeedback):
        compensator = compensator.compensator
    own, undone = model is None, None
    if compensator is not None:
        compensator = inside(compensator)
        undone = compensator.forward_model
    model = undone if model is None else inside(model)
    if model is None:
        raise ModelError(
            "it is not known which model was in the loop. Remedy: give the model too, with --model."
        )
    if compensator is None:
        try:
            compensator = model.inverse()
            own = True
        except ModelError:
            compensator = None
    inputs = tuple(c.name for c in model.inputs if c.name not in model.scheduling)
    if compensator is not None and {c.name for c in compensator.outputs} != set(inputs):
        given = ", ".join(c.name for c in compensator.outputs)
        raise ModelError(
            f"the compensator gives {given}, but the model takes {', '.join(inputs)}. "
            "Remedy: give a compensator and the model that it undoes."
        )
    names = [channel.name for channel in model.outputs]
    outputs = tuple(n for n in names if all(REFERENCE + n in log for log in logs))
    if not outputs:
        raise DataError(
            f"there is no {REFERENCE}{names[0]} beside the {names[0]} that the model gives",
            file=logs[0].source,
            remedy=f"map its column, as in --column {REFERENCE}{names[0]}=COLUMN",
        )
    for log in logs:
        _refuse(log, model, inputs)
    exact = (own or undone == model) and not isinstance(compensator, Predictive)
    learns = compensator is not None and feels(compensator)
    return Loop(model, compensator, inputs, outputs, exact and not learns)


def feels(compensator: Block) -> bool:
    """Tell whether a compensator takes what is measured, and learns."""
    return any(channel.name.endswith(MEASURED) for channel in compensator.inputs)


def _refuse(log: Recording, model: Block, inputs: Sequence[str]) -> None:
    if log.sample_time is None:
        raise DataError(
            "the log has no time", file=log.source, remedy="add a time column or --rate"
        )
    for name in inputs:
        if name not in log and COMMAND + name not in log:
            raise DataError(
                f"there is neither {name!r} nor {COMMAND + name!r}",
                file=log.source,
                remedy=f"map the column, as in --column {name}=COLUMN",
            )
    for channel in (*model.outputs, *model.inputs):
        if channel.name not in inputs:
            log[channel.name]  # which says what is missing
    if scored(log).sum() < FEWEST:
        raise DataError(
            f"{int(scored(log).sum())} samples are too few to tell causes apart",
            file=log.source,
            remedy=f"log at least {FEWEST}, better ten cycles with 50 or more each",
        )


def has_reference(recording: Recording) -> bool:
    """Tell whether a recording is a loop's log."""
    return any(name.startswith(REFERENCE) for name in recording.channels)


def scored(log: Recording) -> Array:
    """Return which samples count, bool (n,): all from time zero on; `track` begins before it."""
    return np.asarray(log.time >= -1e-9 * (log.sample_time or 1.0))
