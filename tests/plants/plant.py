"""What every virtual plant offers: recordings to fit, recordings to check, and its own true answer.

The plants are written from textbook physics alone and know no model of the package. They say in
``facts`` what is truly so, under the same keys:

==============================  ==================================================================
``identical_muscles``           bool
``friction_share``              share of the whole dry friction in every muscle, at mid-range
``friction``                    dry friction of every muscle at mid-range and low speed [N]
``friction_grows_with_pressure``  bool
``static_stiffness``            of the elastic parts at mid-range, at every muscle's end [N/mm]
``relaxation_times``            of the rubber [s]; empty where it does not relax
``dead_zone``                   pressure below which a muscle does not pull at mid-range [bar]
``line_lag``                    from the recorded pressure to the muscle, for small steps [s]
``pressure_noise``              standard deviation [bar]
``output_noise``                standard deviation, in units of the output
==============================  ==================================================================
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from mckibben import Recording
from mckibben.arrays import Array

Fact = float | bool | tuple[float, ...]
Respond = Callable[[Array, Array], Array]
"""From pressures (n, n_muscles) [bar] and loads (n, n_loads) to outputs (n, n_outputs), noise-free.

Both are joined by straight lines between samples. Every run begins with muscles that were empty,
were filled to the first pressure within 3 s, and then waited for 5 s. Loads act meanwhile.
"""


@dataclass(frozen=True)
class Bench:
    """Channels that are recorded, how often [s], and with how much noise (standard deviations)."""

    pressures: tuple[str, ...]
    loads: tuple[str, ...]
    outputs: tuple[str, ...]
    sample_time: float
    pressure_noise: float
    output_noise: float

    def record(
        self, name: str, respond: Respond, pressures: Array, loads: Array, rng: np.random.Generator
    ) -> Recording:
        """Let a plant move, and return what sensors see of it."""
        outputs = respond(pressures, loads)
        seen = pressures + self.pressure_noise * rng.standard_normal(pressures.shape)
        outputs = outputs + self.output_noise * rng.standard_normal(outputs.shape)
        names = self.pressures + self.loads + self.outputs
        samples = np.column_stack([seen, loads, outputs])
        channels = dict(zip(names, samples.T, strict=True))
        return Recording(channels, self.sample_time, meta={"name": name, "rig": "(virtual)"})


@dataclass(frozen=True)
class Plant:
    """One virtual plant: ``train`` to fit, ``test`` by kind of motion, ``respond`` as the truth."""

    name: str
    title: str
    sources: tuple[str, ...]
    bench: Bench
    train: tuple[Recording, ...]
    test: Mapping[str, tuple[Recording, ...]]
    respond: Respond
    facts: Mapping[str, Fact]
