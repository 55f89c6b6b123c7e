"""What a controller is: references and measurements in, pressures out, sample by sample."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from mckibben.blocks.base import Block
from mckibben.errors import ModelError

Array = NDArray[np.float64]


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

    def block(self, compensator: Block | None = None) -> Block:
        """Return the controller as a block, to be saved, streamed and exported.

        Parameters
        ----------
        compensator : Block, optional
            Whose channels name references and pressures, for feedback that stands alone.

        Raises
        ------
        ModelError
            If it is not one.
        """
        del compensator
        raise ModelError(
            f"{type(self).__name__} is no block that could be saved or exported. "
            "Remedy: use a compensator, PID feedback, or both together."
        )

    def applied(self, pressures: Array) -> None:
        """Learn what was applied in the end, after limits."""
        del pressures
