"""A fitted model described: its equations and numbers, how sure they are, and how it answers."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

import numpy as np

from mckibben.blocks.base import Block
from mckibben.blocks.equations import written
from mckibben.blocks.inverse import commands
from mckibben.blocks.notation import Written
from mckibben.errors import DataError, ModelWarning
from mckibben.recording import Recording
from mckibben.validation.criteria import Criteria, criteria
from mckibben.validation.parameters import Parameter, Sureness, parameters, residuals, sureness
from mckibben.validation.responses import (
    DescribingFunction,
    FrequencyResponse,
    describing_functions,
    frequency_responses,
)

MOST_PARAMETERS = 300
"""Above which none means anything alone."""


@dataclass(frozen=True, eq=False)
class ModelDescription:
    """What a model is, and how sure.

    Parameters
    ----------
    written : Written
        Its equations with its numbers, in LaTeX.
    parameters : tuple of Parameter
        In the order of ``block.pack()``.
    criteria : Criteria
        AIC, BIC and FPE, or why they are not given.
    n_effective : float
        Independent samples that the recordings are worth, for the mean of a residual.
    condition : float
        Of the sensitivities to the parameters that are known.
    frequency_responses : tuple of FrequencyResponse
        Of linear models.
    describing_functions : tuple of DescribingFunction
        Of all others.
    notes : tuple of str
        What makes no sense of this model, or was cut short.
    recordings : tuple of str
        Names of those that all this rests on.
    fitted : bool
        Whether the model was fitted to them.
    """

    written: Written
    parameters: tuple[Parameter, ...]
    criteria: Criteria
    n_effective: float
    condition: float
    frequency_responses: tuple[FrequencyResponse, ...]
    describing_functions: tuple[DescribingFunction, ...]
    notes: tuple[str, ...]
    recordings: tuple[str, ...]
    fitted: bool

    @property
    def unsure(self) -> str:
        """Why most of its parameters have no standard error; empty where most have."""
        said = [one.said for one in self.parameters]
        return max(said, key=said.count) if 2 * len(list(filter(None, said))) > len(said) else ""

    def to_dict(self) -> dict[str, Any]:
        """Return it as a JSON-ready dict; what is not known is None."""
        found: dict[str, Any] = _plain(self)
        return found


def describe(
    block: Block,
    recordings: Sequence[Recording],
    output: str | None = None,
    *,
    fitted: bool = True,
) -> ModelDescription:
    """Describe a fitted model on recordings, usually those it was fitted to.

    Standard errors are those of a model that was fitted to the squared error of its free run; they hold
    for residuals that remember, if the model is right but for those.

    Parameters
    ----------
    block : Block
        The model.
    recordings : sequence of Recording
        With its inputs and outputs.
    output : str, optional
        The only output to show responses of; default all.
    fitted : bool
        Whether the model was fitted to these recordings. If not, standard errors are those that a fit
        to them would have, and there are no criteria.

    Returns
    -------
    ModelDescription

    Raises
    ------
    DataError
        If there are no recordings, or a channel is absent.
    """
    if not recordings:
        raise DataError("there are no recordings to describe a model on", remedy="give one or more")
    names = [channel.name for channel in block.outputs]
    if output is not None and output not in names:
        raise DataError(
            f"the model gives {', '.join(names)}", channel=output, remedy="name one of those"
        )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        left = residuals(block, recordings)
        reason = _senseless(block)
        sure = sureness(block, recordings, left) if not reason else _unsure(block, reason)
        responses = frequency_responses(block, recordings, sure.covariance, sure.half_width, output)
        loops = () if responses else describing_functions(block, recordings, output)
        found = criteria(block, recordings, left, sure.n_effective, fitted)
    notes = [
        f"The loops of {one.output.name} are not compared: {one.said}." for one in loops if one.said
    ]
    return ModelDescription(
        written(block),
        parameters(block, sure),
        found,
        sure.n_effective,
        sure.condition,
        responses,
        loops,
        tuple(notes),
        tuple(recording.name for recording in recordings),
        fitted,
    )


def _senseless(block: Block) -> str:
    """Return why standard errors of a model would mean nothing; empty where they do mean something."""
    if block.n_parameters == 0:
        return "the model has no parameters"
    if block.n_parameters > MOST_PARAMETERS:
        return f"of {block.n_parameters} parameters none means anything alone"
    if commands(block):
        return "an inverse has the numbers of the model that it undoes, which were fitted there"
    return ""


def _unsure(block: Block, reason: str) -> Sureness:
    n = block.n_parameters
    return Sureness(np.full((n, n), np.nan), (reason,) * n, np.nan, np.nan, ())


def _plain(value: Any) -> Any:
    """Return dataclasses and arrays as JSON holds them."""
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: _plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value
