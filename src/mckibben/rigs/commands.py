"""What may be asked of a rig: commands checked, and limited as the hardware would."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mckibben.errors import DataError, DataWarning
from mckibben.recording import Recording, standard_unit

if TYPE_CHECKING:
    from mckibben.rigs.rig import Rig

Array = NDArray[np.float64]


def commands_of(rig: Rig, inputs: Recording) -> tuple[Array, dict[str, int]]:
    """Return what the hardware makes of a recording of commands, shape (n, inputs).

    Inputs that are absent stay at rest, and channels that the rig measures are passed over. The second
    value counts the samples of each input that were limited, of which a warning tells.

    Raises
    ------
    DataError
        On missing or unknown channels, or a recording without time.
    """
    if inputs.sample_time is None:
        raise DataError(
            "a recording without time cannot drive a rig",
            file=inputs.source,
            remedy="read it with --rate, or give Recording(..., sample_time=...)",
        )
    remedy = f"give {', '.join(rig.inputs)} and no others"
    strangers = sorted(set(inputs.channels) - {*rig.inputs, *rig.outputs})
    if strangers:
        listed = ", ".join(map(repr, strangers))
        raise DataError(
            f"the rig {rig.name!r} has no channel {listed}", file=inputs.source, remedy=remedy
        )
    if rig.inputs[0] not in inputs:
        raise DataError(
            f"the rig {rig.name!r} needs the channel {rig.inputs[0]!r}",
            file=inputs.source,
            remedy=remedy,
        )
    rest = rig.resting[0]
    asked = np.column_stack(
        [
            inputs[name] if name in inputs else np.full(len(inputs), rest[i])
            for i, name in enumerate(rig.inputs)
        ]
    )
    given = limited(rig, asked)
    counts = np.count_nonzero(given != asked, axis=0)
    saturated = {name: int(n) for name, n in zip(rig.inputs, counts, strict=True) if n}
    for name, count in saturated.items():
        limits = rig.limits(name)
        warnings.warn(
            DataWarning(
                f"{name} was limited to {limits.low:g} to {limits.high:g} {standard_unit(name)} "
                f"in {count} of {len(inputs)} samples, as {rig.name} would"
            ),
            stacklevel=3,
        )
    return given, saturated


def command_of(rig: Rig, action: ArrayLike | Mapping[str, float]) -> Array:
    """Return an action as one command an input, shape (inputs,), not yet limited.

    Raises
    ------
    DataError
        On wrong channels, a wrong number of commands, or one that is not finite.
    """
    if isinstance(action, Mapping):
        strangers = sorted(set(action) - set(rig.inputs))
        if strangers:
            raise DataError(
                f"the rig {rig.name!r} has no input {', '.join(map(repr, strangers))}",
                remedy=f"give {', '.join(rig.inputs)}",
            )
        rest = dict(zip(rig.inputs, rig.resting[0], strict=True))
        action = [action.get(name, rest[name]) for name in rig.inputs]
    asked = np.asarray(action, dtype=float)
    if asked.shape != (len(rig.inputs),):
        raise DataError(
            f"an action of shape {asked.shape} does not fit {len(rig.inputs)} input(s)",
            remedy=f"give one number each for {', '.join(rig.inputs)}",
        )
    for name, value in zip(rig.inputs, asked, strict=True):
        if not np.isfinite(value):
            limits = rig.limits(name)
            raise DataError(
                f"the command is {value}",
                channel=name,
                remedy=f"give a number from {limits.low:g} to {limits.high:g} {standard_unit(name)}",
            )
    return asked


def limited(rig: Rig, asked: Array) -> Array:
    """Return commands within what the hardware lets through."""
    ranges = [rig.limits(name) for name in rig.inputs]
    return np.clip(asked, [limits.low for limits in ranges], [limits.high for limits in ranges])
