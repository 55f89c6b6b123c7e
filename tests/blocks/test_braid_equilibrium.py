"""How a braided muscle's rest moves with pressure and parameters, against finite differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mckibben.blocks.force.braid_equilibrium import BraidEquilibrium


def test_slopes_are_those_of_finite_differences_up_to_both_limits() -> None:
    # soft enough to hang, without pressure, at a limit that depends on its load
    muscle = replace(BraidEquilibrium.example(), load=10.0, hardening=900.0, offset=1.0)
    pressure = np.concatenate([[-3.0, -2.0], np.linspace(0.0, 3.0, 40), [1e5]])
    displacement = muscle.simulate(pressure)
    by_pressure, by_parameters = muscle.slopes(displacement)
    step = 1e-6
    around = [muscle.simulate(pressure + way * step) for way in (1, -1)]
    expected = (around[0] - around[1]) / (2 * step)
    np.testing.assert_allclose(by_pressure, expected, atol=1e-4 * np.ptp(expected))
    names = ("load", "stiffness", "hardening", "braid_angle")
    for name, found in zip(names, by_parameters.T, strict=True):
        value = getattr(muscle, name)
        high, low = (
            replace(muscle, **{name: value * (1 + way * step)}).simulate(pressure)
            for way in (1, -1)
        )
        expected = (high - low) / (2 * step * value)
        np.testing.assert_allclose(found, expected, atol=1e-4 * np.ptp(expected))
        if name != "braid_angle":
            assert found[0] != 0.0
    assert by_parameters[-1, 3] != 0.0
