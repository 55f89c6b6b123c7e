"""What inputs explain of outputs."""

from __future__ import annotations

import numpy as np
import pytest

from mckibben.diagnosis.coupling import coupling, unexplained
from mckibben.recording import Recording
from mckibben.signals import decaying_triangle


@pytest.mark.parametrize("late", [0, 40])
def test_an_output_that_follows_late_is_explained_and_noise_is_not(late: int) -> None:
    rng = np.random.default_rng(0)
    pressure = decaying_triangle(np.arange(0, 40, 0.02), 10.0, 5.0, 1.0, 4)
    follows = np.roll(pressure, late) ** 2 + rng.normal(0, 0.1, pressure.size)
    noise = rng.normal(0, 1, pressure.size)
    units = {"pressure": "bar", "displacement": "mm", "angle": "rad"}
    channels = {"pressure": pressure, "displacement": follows, "angle": noise}
    run = Recording(channels, 0.02, units)
    found = coupling([run], ["pressure"], ["displacement", "angle"])
    assert unexplained([run], found) == ["angle"]
