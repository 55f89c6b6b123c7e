"""A model's run over a recording, and what results with a model have in common: such runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Unpack

from mckibben.arrays import Array
from mckibben.blocks.fields import Channel
from mckibben.files.memory import Data
from mckibben.keywords import SimulateKeywords
from mckibben.recording import Recording
from mckibben.registry import load
from mckibben.system.showing import Result


@dataclass(frozen=True, repr=False)
class Simulation(Result):
    """A model's run over a recording.

    Parameters
    ----------
    recording : Recording
        Inputs, what was measured, and ``OUTPUT_model``; of a band, ``OUTPUT_lower`` and ``_upper``.
    metrics : mapping of str to mapping of str to float
        Measured output -> its errors; of a band also ``coverage`` and ``band_width``.
    interval : float or None
        Level of the band.
    notes : tuple of str
    outside : tuple of (Channel, float, array, (float, float))
        Channels beyond what a band was calibrated on: the share of the samples that are, all samples,
        and the range of the calibration.
    """

    recording: Recording = field(repr=False)
    metrics: Mapping[str, Mapping[str, float]]
    interval: float | None
    notes: tuple[str, ...]
    outside: tuple[tuple[Channel, float, Array, tuple[float, float]], ...] = field(
        default=(), repr=False
    )

    face: ClassVar[str] = "simulation"

    def to_frame(self) -> Any:
        """Return the run as a data frame over time."""
        return self.recording.to_frame()

    def to_dict(self) -> dict[str, Any]:
        """Return the errors, for JSON."""
        return {"n_samples": len(self.recording), **super().to_dict()}


class Simulates:
    """What has a ``model``, and simulates it."""

    def simulate(self, data: Data, **options: Unpack[SimulateKeywords]) -> Simulation:
        """Simulate the model on a recording; see `mckibben.simulate`."""
        found: Simulation = load("operations", "simulate")(self, data, **options)
        return found
