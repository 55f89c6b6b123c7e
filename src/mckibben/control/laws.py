"""Control laws by name, each made from a compensator and feedback.

A law is a function of a compensator and of a function that returns tuned feedback. The first line of its
docstring is its title. Laws are registered in the group ``controllers``.
"""

from __future__ import annotations

from collections.abc import Callable

from mckibben import registry
from mckibben.blocks.base import Block
from mckibben.blocks.feedback import FeedforwardFeedback, PIDFeedback
from mckibben.control.connecting import Plant
from mckibben.control.controller import Controller, DisturbanceObserver
from mckibben.control.tuning import untuned_pid
from mckibben.errors import MckibbenError, ModelError

Tuned = Callable[[], PIDFeedback]


def control_law(name: str, compensator: Block, tuned: Tuned) -> Block | Controller:
    """Return the controller of a law; a block if it can be saved and exported.

    Parameters
    ----------
    name : str
        Of the law: ``feedforward``, ``feedforward-pid``, ``observer``, ``pid``.
    compensator : Block
        From displacements and scheduling inputs to pressures.
    tuned : callable
        Returns feedback; see `mckibben.control.tune_pid`.

    Raises
    ------
    ModelError
        If there is no law of that name.
    """
    controller: Block | Controller = registry.load("controllers", name)(compensator, tuned)
    return controller


def refusal(name: str, compensator: Block, plant: Plant) -> str:
    """Return why a law cannot be used with a compensator on a plant, or an empty string.

    Channels alone decide: nothing is run, and feedback is not tuned.
    """
    held = [channel.name for channel in compensator.inputs if channel.name in plant.inputs]
    try:
        control_law(name, compensator, lambda: untuned_pid(plant, held, compensator.inputs))
    except MckibbenError as error:
        return str(error)
    return ""


def feedforward(compensator: Block, tuned: Tuned) -> Block:
    """Compensator alone."""
    del tuned
    return compensator


def feedforward_pid(compensator: Block, tuned: Tuned) -> Block:
    """Compensator and PID."""
    return FeedforwardFeedback.of(compensator, tuned())


def observer(compensator: Block, tuned: Tuned) -> Controller:
    """Compensator and disturbance observer."""
    del tuned
    if compensator.samples_ahead:
        raise ModelError(
            "an observer cannot be used with a compensator that looks ahead",
            remedy="use feedforward or feedforward-pid with a compensator that looks ahead",
        )
    return DisturbanceObserver(compensator)


def pid(compensator: Block, tuned: Tuned) -> Block:
    """PID alone."""
    del compensator
    return tuned()
