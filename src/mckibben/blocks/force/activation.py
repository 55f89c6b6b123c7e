"""What models of the pressure for a contraction share: a force that schedules them, a filtered rate."""

from __future__ import annotations

import math
from typing import ClassVar

from mckibben.blocks.base import Block, Ports
from mckibben.errors import ModelError


class Activation(Block):
    """From contraction, at a force that schedules it, to pressure; it depends on a filtered rate."""

    rate_dependent: ClassVar[bool] = True
    ports: ClassVar[Ports] = ("input",), ("force",), ("output",)

    rate_time_constant: float

    def rate_filter(self, step: float) -> tuple[float, float]:
        """Return what the filter of the rate keeps over a step, and its gain of the input's change."""
        tau = self.rate_time_constant
        smoothing = math.exp(-step / tau) if tau > 0 else 0.0
        return smoothing, (1 - smoothing) / step

    def inverse(self) -> Block:
        """Refuse: this model is itself the inverse of a muscle."""
        raise ModelError(
            f"{self.kind!r} has no inverse here: it already gives the pressure for a contraction. "
            "Remedy: use it as the compensator, or fit pressure to contraction by another model."
        )
