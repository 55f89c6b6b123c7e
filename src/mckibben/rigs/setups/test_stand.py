"""A muscle between a load cell and a screw: imposed length, measured force."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import numpy as np

from mckibben.arrays import Array
from mckibben.rigs.parameters import Muscle, parameter
from mckibben.rigs.physics.motion import MECHANISM, NO_MUSCLE
from mckibben.rigs.rig import Rig
from mckibben.rigs.system import Demands, System, Traces


class TestStand(Rig):
    """One muscle in an isometric and isobaric test stand."""

    __test__: ClassVar[bool] = False  # not a test, whatever its name looks like

    setup: Literal["test-stand"] = "test-stand"
    muscle: Muscle
    drive_speed: float = parameter("fastest that the screw can go", "mm/s", gt=0, le=1000)

    measurable: ClassVar[tuple[str, ...]] = ("pressure", "length", "force")

    @property
    def inputs(self) -> tuple[str, ...]:
        """Pressure, and the imposed length."""
        return ("pressure", "length")

    def build(self) -> System:
        """Return one muscle on one driven coordinate: the shortening of the muscle."""
        muscles = self.muscle.record()
        muscles["levers"][0, 0] = 1.0
        made = np.zeros(1, MECHANISM)
        made["n"] = 1
        made["guide_stiffness"] = 1.0
        made["driven"] = 1
        made["speed_limit"] = self.drive_speed
        made["stiffened_by"] = NO_MUSCLE
        return System(muscles, self.air.record(), made)

    def demands(self, inputs: Array) -> Demands:
        return Demands(inputs[:, :1], np.zeros((len(inputs), 1)), self.muscle.length - inputs[:, 1])

    def readings(self, traces: Traces, inputs: Array, zero: Array) -> Mapping[str, Array]:
        del inputs, zero
        return {
            "pressure": traces.pressure[:, 0],
            "length": self.muscle.length - traces.place[:, 0],
            "force": traces.tension[:, 0],
        }

    def known(self) -> Mapping[str, Any]:
        return {"rest_length": self.muscle.length, "diameter": self.muscle.diameter}
