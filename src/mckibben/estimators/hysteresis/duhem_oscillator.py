"""Identification of the oscillator with an element of unknown shape."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np
from annotated_types import Interval

from mckibben.arrays import Array
from mckibben.blocks.fields import vector
from mckibben.blocks.hysteresis.oscillators import DuhemOscillator, Oscillator
from mckibben.estimators.hysteresis.oscillator import OscillatorEstimator
from mckibben.estimators.hysteresis.oscillator_slopes import follow_duhem

BEYOND = 1.1
"""The outermost knots, by the largest force of the element."""

TIGHT = 0.8
"""Share of the range of knots that the forces have to fill."""


@dataclass(kw_only=True, repr=False, eq=False)
class DuhemOscillatorEstimator(OscillatorEstimator):
    """Oscillator with free slopes, by Gauss-Newton on free runs.

    Parameters
    ----------
    n_pieces : int
        Of either curve on either side of no force, where loading turns into unloading, so that a corner
        is there; spread evenly over the element's forces.
    """

    title = "Duhem oscillator"
    purpose = "rate"
    can = (
        "A mass, a damper and a spring with hysteresis of unknown shape inside the loop: "
        "slopes of one element, free in either direction."
    )
    cannot = (
        "The element remembers one number, so nothing of minor loops once they are left; "
        "slopes beyond the forces seen are held; no inverse."
    )

    n_pieces: Annotated[int, Interval(ge=1, le=20)] = 2

    n_positive: ClassVar[int] = 3
    order: ClassVar[int] = 1
    follows: ClassVar[Callable[..., None]] = staticmethod(follow_duhem)

    def starts(self, slope: float, bend: float, fields: dict[str, Any]) -> list[Oscillator]:
        """Return an element of two pieces a curve, whose slope goes to 0 where its force is largest."""
        most, rising = slope / bend, (2.0 * slope, slope, 0.0)
        return [
            DuhemOscillator(rising=rising, falling=rising[::-1], knots=(-most, 0.0, most), **fields)
        ]

    def refined(self, model: Oscillator, forces: Array) -> Oscillator | None:
        """Return the model with up to twice the pieces, spread over the forces that its element has."""
        assert isinstance(model, DuhemOscillator)
        n, most = len(model.knots) // 2, float(np.abs(forces).max())
        if n == self.n_pieces and TIGHT * model.knots[-1] < most < model.knots[-1]:
            return None
        most *= BEYOND
        knots = most * np.linspace(-1.0, 1.0, 1 + 2 * min(2 * n, self.n_pieces))
        rising, falling = (
            vector(np.interp(knots, model.knots, values))
            for values in (model.rising, model.falling)
        )
        return replace(model, knots=vector(knots), rising=rising, falling=falling)
