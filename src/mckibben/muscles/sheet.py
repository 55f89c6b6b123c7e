"""A muscle's data sheet, and its scales by geometry."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from mckibben.arrays import Array

NEWTON_PER_BAR_MM2 = 0.1

USED = 0.75
"""Largest contraction of a muscle without load, relative to that at which its braid's pull is zero.
"""


class Sheet(BaseModel):
    """Numbers of a data sheet.

    Parameters
    ----------
    diameter_mm : float
        Of the braid at rest.
    rest_length_mm : float
        Between the fittings, without pressure and load.
    braid_angle_deg : float, optional
        Between threads and axis at rest. Default that of the largest force.
    max_force_N : float, optional
        Pull at rest length under the highest pressure.
    max_pressure_bar : float
        Highest pressure allowed.
    max_contraction : float, optional
        At the highest pressure without load, of the rest length. Default what is usual of the braid.
    like : str, optional
        A muscle of the library of the same make.
    without : list of str, optional
        Muscles of the library that are not asked.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    diameter_mm: float = Field(ge=1, le=200)
    rest_length_mm: float = Field(ge=10, le=5000)
    braid_angle_deg: float | None = Field(default=None, ge=10, lt=50)
    max_force_N: float | None = Field(default=None, gt=0, le=1e6)  # noqa: N815
    max_pressure_bar: float = Field(default=6.0, gt=0, le=50)
    max_contraction: float | None = Field(default=None, ge=0.02, le=0.6)
    like: str | None = None
    without: list[str] | None = None

    def model_post_init(self, _: Any) -> None:
        """Raise an error for a sheet that does not determine the braid."""
        if self.braid_angle_deg is None and self.max_force_N is None:
            raise ValueError("it has neither braid_angle_deg nor max_force_N")
        if self.braid_angle_deg is None and not 0.4 < self._pull < 60:
            raise ValueError("no braid of this diameter has such a max_force_N")

    @property
    def _section(self) -> float:
        """Force of a bar on the section [N/bar]."""
        return NEWTON_PER_BAR_MM2 * math.pi * self.diameter_mm**2 / 4

    @property
    def _pull(self) -> float:
        """Pull at rest over that on the section."""
        return (self.max_force_N or 0.0) / (self._section * self.max_pressure_bar)

    @property
    def braid(self) -> tuple[float, float]:
        """Constants a and b of the braid: its area is the section's by a (1 - contraction)^2 - b."""
        if self.braid_angle_deg is None:  # a - b is 2 / sin^2 - 3
            b = 0.5 * (self._pull + 3.0)
            return 3.0 * (b - 1.0), b
        angle = math.radians(self.braid_angle_deg)
        return 3.0 / math.tan(angle) ** 2, 1.0 / math.sin(angle) ** 2

    @property
    def area(self) -> float:
        """Effective area at rest [N/bar]."""
        a, b = self.braid
        return self._section * (a - b)

    @property
    def contraction(self) -> float:
        """Largest contraction, of the rest length."""
        a, b = self.braid
        return self.max_contraction or USED * (1.0 - math.sqrt(b / a))

    @property
    def stroke(self) -> float:
        """Largest contraction [mm]."""
        return self.contraction * self.rest_length_mm

    @property
    def force(self) -> float:
        """Pull at rest length under the highest pressure [N]."""
        return self.area * self.max_pressure_bar

    @property
    def shape(self) -> Array:
        """Logarithms of size, slenderness and braid: coordinates of similarity between muscles."""
        return np.log(
            [self.diameter_mm, self.rest_length_mm / self.diameter_mm, math.sqrt(self.braid[0])]
        )

    def narrowed(self, share: Array) -> Array:
        """Return the area over that at rest, by contraction as a share of the largest."""
        a, b = self.braid
        return np.maximum(((1.0 - self.contraction * share) ** 2 * a - b) / (a - b), 0.02)
