"""What a controller is: references and measurements in, pressures out, sample by sample."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.core.block import Block
from mckibben.blocks.feedback.pid import MEASURED


class Controller(ABC):
    """Asked once a control step for the pressures of n muscles."""

    @abstractmethod
    def reset(self, sample_time: float) -> None:
        """Forget the past, and get ready for steps of so many seconds."""

    @abstractmethod
    def step(self, reference: Array, displacement: Array, scheduled: Array) -> Array:
        """Return the pressures to apply until the next step [bar], shape (n,).

        Parameters
        ----------
        reference : array, shape (n,)
            Where the muscles should be at the next step [mm].
        displacement : array, shape (n,)
            Where they were just measured to be [mm].
        scheduled : array, shape (s,)
            What schedules the model: an extensor's pressure, a load.
        """

    def reads(self, readings: Mapping[str, float]) -> None:
        """Learn all that was just measured, by channel, before `step`."""
        del readings

    def applied(self, pressures: Array) -> None:
        """Learn what was applied in the end, after limits."""
        del pressures


@dataclass
class BlockController(Controller):
    """A block in a loop: a compensator alone, feedback, or both, as it is saved and exported.

    Parameters
    ----------
    block : Block
        From references, what is measured of them (inputs named ``..._measured``) if it asks for that,
        and what schedules it, to pressures. What it does not ask for is passed over.
    """

    block: Block

    def reset(self, sample_time: float) -> None:
        self._stream = self.block.stream(sample_time)
        self._taken = len(self.block.inputs)
        self._feels = any(channel.name.endswith(MEASURED) for channel in self.block.inputs)

    def step(self, reference: Array, displacement: Array, scheduled: Array) -> Array:
        measured = (displacement,) if self._feels else ()
        given = np.concatenate([reference, *measured, scheduled])
        return self._stream.step(given[: self._taken]).copy()
