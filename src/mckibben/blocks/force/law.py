"""What static force laws share: force by length, at a pressure that is measured."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block, Ports
from mckibben.blocks.fields import Channel, Initial
from mckibben.errors import ModelError


class ForceLaw(Block):
    """A static force law: driven by length [mm], scheduled by pressure [bar], giving force [N]."""

    initial: ClassVar[Initial] = "first_sample"

    ports: ClassVar[Ports] = ("input",), ("pressure",), ("output",)

    input: Channel
    pressure: Channel
    output: Channel

    terms_kernel: ClassVar[Callable[[float, Array], tuple[float, float]]]
    """Force per pressure [N/bar], and force without any [N], from a length and `coefficients`."""

    def terms(self, length: Array) -> tuple[Array, Array]:
        """Return force per pressure [N/bar], and force without any [N], each of the shape given.

        Raises
        ------
        ModelError
            If the law is not linear in pressure.
        """
        self.check_linear()
        numbers, terms = self.coefficients(None), type(self).terms_kernel
        found = np.array([terms(each, numbers) for each in np.ravel(length).tolist()]).reshape(
            -1, 2
        )
        return found[:, 0].reshape(np.shape(length)), found[:, 1].reshape(np.shape(length))

    def check_linear(self) -> None:
        """Refuse a law that is not linear in pressure; by default it is."""

    def inverse(self) -> Block:
        """Refuse: what undoes a force law gives pressure, not length."""
        raise ModelError(
            f"{self.kind!r} has no inverse by length, since more than one may give a force. Remedy: "
            "for the pressure that gives a force at a length, use ForceFeedforward(law)."
        )
