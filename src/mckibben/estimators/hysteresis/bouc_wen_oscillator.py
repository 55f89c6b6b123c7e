"""Identification of the Bouc-Wen oscillator."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

from mckibben.blocks.hysteresis.oscillators import BoucWenOscillator, Oscillator
from mckibben.estimators.hysteresis.oscillator import OscillatorEstimator
from mckibben.estimators.hysteresis.oscillator_slopes import follow_bouc_wen


@dataclass(kw_only=True, repr=False, eq=False)
class BoucWenOscillatorEstimator(OscillatorEstimator):
    """Bouc-Wen oscillator by Gauss-Newton on free runs, begun with a linear one's stiffness shared."""

    title = "Bouc–Wen oscillator"
    purpose = "rate"
    can = (
        "A mass, a damper and a spring with Bouc-Wen hysteresis inside the loop, from force "
        "to displacement: six numbers, from free runs or from periods of a steady motion."
    )
    cannot = (
        "One mass, linear but for the element, whose loops are symmetric; needs time; no inverse."
    )
    quick = True

    n_positive: ClassVar[int] = 4
    order: ClassVar[int] = 0
    follows: ClassVar[Callable[..., None]] = staticmethod(follow_bouc_wen)

    def starts(self, slope: float, bend: float, fields: dict[str, Any]) -> list[Oscillator]:
        """Return an element that hardens, and one that softens."""
        return [
            BoucWenOscillator(slope=slope, gamma=bend, delta=way * bend, **fields)
            for way in (-0.5, 0.5)
        ]
