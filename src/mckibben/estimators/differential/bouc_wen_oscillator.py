"""Identification of the Bouc-Wen oscillator."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

from mckibben.blocks.differential.bouc_wen_oscillator import BoucWenOscillator
from mckibben.blocks.differential.oscillator import Oscillator
from mckibben.estimators.differential.oscillator import Linear, OscillatorEstimator
from mckibben.estimators.differential.oscillator_slopes import follow_bouc_wen


@dataclass(kw_only=True, repr=False, eq=False)
class BoucWenOscillatorEstimator(OscillatorEstimator):
    """Bouc-Wen oscillator by Gauss-Newton on free runs, from a linear one whose stiffness is shared."""

    n_positive: ClassVar[int] = 4
    follows: ClassVar[Callable[..., None]] = staticmethod(follow_bouc_wen)

    def starts(self, linear: Linear, most: float, fields: dict[str, Any]) -> list[Oscillator]:
        """Return elements of two stiffnesses, that harden or soften over the motion recorded."""
        return [
            BoucWenOscillator(
                linear.mass,
                0.5 * linear.damping,
                (1.0 - share) * linear.stiffness,
                share * linear.stiffness,
                0.5 / most,
                bend / most,
                **fields,
            )
            for share in (0.3, 0.6)
            for bend in (-0.5, 0.5)
        ]
