"""Commands of rigs, checked, and limited as by the hardware."""

from __future__ import annotations

import warnings
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from mckibben.arrays import Array
from mckibben.errors import DataError, DataWarning
from mckibben.recording import Recording, sample_time_of, standard_unit
from mckibben.rigs.parameters import Range


class Commands:
    """Inputs of a rig, and their limits.

    Parameters
    ----------
    rig : str
        Its name.
    ranges : mapping of str to Range
        What the hardware lets through, by input.
    rest : array, shape (inputs,)
        Commands at rest.
    outputs : sequence of str
        Channels that it measures, which recordings of commands may have too.
    """

    def __init__(
        self, rig: str, ranges: Mapping[str, Range], rest: Array, outputs: tuple[str, ...]
    ) -> None:
        self.rig, self.ranges, self.rest, self.outputs = rig, ranges, rest, outputs
        self.low = np.array([limits.low for limits in ranges.values()])
        self.high = np.array([limits.high for limits in ranges.values()])

    def of_recording(self, inputs: Recording) -> tuple[Array, dict[str, int]]:
        """Return a recording of commands with the hardware's limits applied, shape (n, inputs).

        Inputs that are absent stay at rest, and channels that the rig measures are passed over. The
        second value counts the samples of each input that were limited, of which a warning tells.

        Raises
        ------
        DataError
            On missing or unknown channels, or a recording without time.
        """
        sample_time_of(inputs, "drive a rig")
        first = next(iter(self.ranges))
        remedy = f"give {', '.join(self.ranges)} and no others"
        strangers = sorted(set(inputs.channels) - {*self.ranges, *self.outputs})
        if strangers:
            listed = ", ".join(map(repr, strangers))
            raise DataError(
                f"the rig {self.rig!r} has no channel {listed}", file=inputs.source, remedy=remedy
            )
        if first not in inputs:
            raise DataError(
                f"the rig {self.rig!r} needs the channel {first!r}",
                file=inputs.source,
                remedy=remedy,
            )
        asked = np.column_stack(
            [
                inputs[name] if name in inputs else np.full(len(inputs), self.rest[i])
                for i, name in enumerate(self.ranges)
            ]
        )
        given = self.limited(asked)
        counts = np.count_nonzero(given != asked, axis=0)
        saturated = {name: int(n) for name, n in zip(self.ranges, counts, strict=True) if n}
        for name, count in saturated.items():
            limits = self.ranges[name]
            warnings.warn(
                DataWarning(
                    f"{name} was limited to {limits.low:g} to {limits.high:g} {standard_unit(name)} "
                    f"in {count} of {len(inputs)} samples, as {self.rig} would"
                ),
                stacklevel=3,
            )
        return given, saturated

    def of_action(self, action: ArrayLike | Mapping[str, float]) -> Array:
        """Return an action as one command per input, shape (inputs,), not yet limited.

        Raises
        ------
        DataError
            On wrong channels, a wrong number of commands, or one that is not finite.
        """
        if isinstance(action, Mapping):
            strangers = sorted(set(action) - set(self.ranges))
            if strangers:
                raise DataError(
                    f"the rig {self.rig!r} has no input {', '.join(map(repr, strangers))}",
                    remedy=f"give {', '.join(self.ranges)}",
                )
            rest = dict(zip(self.ranges, self.rest, strict=True))
            action = [action.get(name, rest[name]) for name in self.ranges]
        asked = np.asarray(action, dtype=float)
        if asked.shape != (len(self.ranges),):
            raise DataError(
                f"an action of shape {asked.shape} does not fit {len(self.ranges)} input(s)",
                remedy=f"give one number each for {', '.join(self.ranges)}",
            )
        for name, value in zip(self.ranges, asked, strict=True):
            if not np.isfinite(value):
                limits = self.ranges[name]
                raise DataError(
                    f"the command is {value}",
                    channel=name,
                    remedy=f"give a number from {limits.low:g} to {limits.high:g} {standard_unit(name)}",
                )
        return asked

    def limited(self, asked: Array) -> Array:
        """Return commands limited to the hardware's range."""
        return np.clip(asked, self.low, self.high)
