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
        unknown = sorted(set(inputs.channels) - {*self.ranges, *self.outputs})
        first = next(iter(self.ranges))
        if unknown or first not in inputs:
            problem = f"has no channel {', '.join(unknown)}" if unknown else f"needs {first!r}"
            raise DataError(
                f"the rig {self.rig!r} {problem}",
                file=inputs.source,
                remedy=f"give {', '.join(self.ranges)} and no others",
            )
        commands = np.column_stack(
            [
                inputs[name] if name in inputs else np.full(len(inputs), rest_level)
                for name, rest_level in zip(self.ranges, self.rest, strict=True)
            ]
        )
        applied = self.limited(commands)
        counts = np.count_nonzero(applied != commands, axis=0)
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
        return applied, saturated

    def of_action(self, action: ArrayLike | Mapping[str, float]) -> Array:
        """Return an action as one command per input, shape (inputs,), not yet limited.

        Raises
        ------
        DataError
            On wrong channels, a wrong number of commands, or one that is not finite.
        """
        names = ", ".join(self.ranges)
        if isinstance(action, Mapping):
            if unknown := sorted(set(action) - set(self.ranges)):
                problem = f"the rig {self.rig!r} has no such input"
                raise DataError(problem, channel=unknown[0], remedy=f"give {names}")
            levels = dict(zip(self.ranges, self.rest, strict=True))
            action = list((levels | dict(action)).values())
        commands = np.asarray(action, dtype=float)
        if commands.shape != (len(self.ranges),) or not np.isfinite(commands).all():
            problem = f"the rig {self.rig!r} cannot take the commands {commands.tolist()}"
            wrong = None
            if commands.shape == (len(self.ranges),):
                wrong = [*self.ranges][int(np.argmin(np.isfinite(commands)))]
            remedy = f"give a finite number each for {names}"
            raise DataError(problem, channel=wrong, remedy=remedy)
        return commands

    def limited(self, commands: Array) -> Array:
        """Return commands limited to the hardware's range."""
        return np.clip(commands, self.low, self.high)
