"""Setting fields of a saved model that were not identified."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any

from mckibben.blocks.base import Block
from mckibben.blocks.parameters import with_parts
from mckibben.errors import ModelError, ModelWarning
from mckibben.numerals import numeral

BEYOND = 0.05
"""Share by which a value may exceed the range of the identification without a warning."""


def settable(model: Block) -> dict[str, Any]:
    """Return the settable fields of a model and its parts, with their values.

    >>> from mckibben.blocks.force.activation import ActivationPressure
    >>> settable(ActivationPressure.example())
    {'frequency': 1.0, 'rate_time_constant': 0.0}
    """
    return {name: getattr(part, name) for part in _parts(model) for name in part.free_fields}


def with_fields(model: Block, values: Mapping[str, Any]) -> Block:
    """Return a model with other values of settable fields, in any part.

    Warns where a value lies beyond those that the model was identified at.

    Raises
    ------
    ModelError
        On a field that no part lets be set, or a value that it may not have.
    """
    names = settable(model)
    for name in values:
        if name not in names:
            listed = f"set one of {', '.join(names)}" if names else "leave it out"
            raise ModelError(
                f"{model.title!r} does not let it be set: it is identified, or no such field",
                parameter=name,
                remedy=f"{listed}",
            )

    def change(part: Any) -> Any:
        new = {name: values[name] for name in getattr(part, "free_fields", ()) if name in values}
        return replace(part, **new) if new else part

    changed: Block = with_parts(model, change)
    for part in _parts(changed):
        for name, range_field in part.free_fields.items():
            ends = range_field and getattr(part, range_field)
            value = getattr(part, name)
            if name in values and ends and not _within(value, *ends):
                low, high = (numeral(end, 3) for end in ends)
                where = f"at {low}" if low == high else f"from {low} to {high}"
                warnings.warn(
                    f"{name.replace('_', ' ')} is set to {numeral(value, 3)}, and the model was "
                    f"identified {where}: it extrapolates",
                    ModelWarning,
                    stacklevel=2,
                )
    return changed


def _within(value: float, low: float, high: float) -> bool:
    return low - BEYOND * abs(low) <= value <= high + BEYOND * abs(high)


def _parts(value: Any) -> Iterator[Block]:
    """Yield a block and all blocks in its fields."""
    if isinstance(value, tuple):
        for item in value:
            yield from _parts(item)
    elif isinstance(value, Block) and is_dataclass(value):
        yield value
        for field in fields(value):
            yield from _parts(getattr(value, field.name))


def summary(model: Block) -> dict[str, Any]:
    """Return a summary of a model for JSON: inputs, outputs and kind."""
    from mckibben.blocks.force.feedforward import compensator

    try:
        compensator(model)
        inverse = "yes"
    except ModelError as error:
        inverse = f"no: {error}"
    return {
        "kind": model.kind,
        "inputs": [f"{channel.name} [{channel.unit}]" for channel in model.inputs],
        "outputs": [f"{channel.name} [{channel.unit}]" for channel in model.outputs],
        "n_parameters": model.n_parameters,
        "n_states": model.n_states,
        "rate_dependent": bool(model.rate_dependent),
        "inverse": inverse,
        "settable": settable(model),
    }
