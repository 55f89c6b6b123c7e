"""Oscillators identified: their numbers come back, derivatives are exact, and steady states count."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from mckibben import DataError, ModelError, Recording
from mckibben.blocks.fields import vector
from mckibben.blocks.hysteresis.oscillators import BoucWenOscillator, DuhemOscillator
from mckibben.estimators.hysteresis.oscillators import (
    OscillatorEstimator,
    follow_bouc_wen,
    follow_duhem,
)
from tests.recordings import MEASURED

Array = NDArray[np.float64]

BENCHMARK = MEASURED / "bouc_wen_benchmark"

SYSTEMS = {
    "quick": (BoucWenOscillator(0.05, 0.003, 30.0, 10.0, 2.0, 1.0), 5e-4, (5.0, 400.0), 20.0),
    "slipping": (BoucWenOscillator(1.0, 0.02, 20.0, 2.0, 1.0, 0.5), 0.002, (1.0, 60.0), 10.0),
}
"""Oscillator, sample time, band [Hz] and size [N] of the force that shakes it."""

NOISE = 0.01
"""Relative to the displacement."""


def multisine(n: int, step: float, band: tuple[float, float], size: float, seed: int) -> Array:
    """Return a period of sines of random phases and one amplitude."""
    frequencies = np.fft.rfftfreq(n, step)
    inside = (frequencies >= band[0]) & (frequencies <= band[1])
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, inside.sum())
    lines = np.zeros(frequencies.size, dtype=complex)
    lines[inside] = np.exp(1j * phases)
    found: Array = np.fft.irfft(lines, n)
    return found * size / found.std()


def shaken(name: str, periodic: bool, n: int = 2048) -> tuple[list[Recording], Recording]:
    """Return two recordings with noise and a third without."""
    model, step, band, size = SYSTEMS[name]
    forces = [Recording({"force": multisine(n, step, band, size, seed)}, step) for seed in range(3)]
    runs = [(model.steady_state if periodic else model.simulate)(force) for force in forces]
    rng = np.random.default_rng(1)
    spread = runs[0]["displacement"].std()
    noisy = [
        run.with_channels(displacement=run["displacement"] + NOISE * spread * rng.normal(size=n))
        for run in runs[:2]
    ]
    return noisy, runs[2]


def missed(model: Any, test: Recording, periodic: bool) -> float:
    """Return the error on a recording, relative to the displacement."""
    given = (model.steady_state if periodic else model.simulate)(test.select(["force"]))
    error = given["displacement"] - test["displacement"]
    return float(np.sqrt(np.mean(error**2)) / test["displacement"].std())


@pytest.mark.parametrize(("name", "periodic"), [("quick", True), ("slipping", False)])
def test_numbers_come_back_from_noisy_recordings(name: str, periodic: bool) -> None:
    noisy, test = shaken(name, periodic)
    found = OscillatorEstimator(periodic=periodic).fit(noisy)
    errors = np.abs(found.model_.pack() - SYSTEMS[name][0].pack())
    assert (errors < 4.5 * np.array(found.diagnostics_.standard_errors)).all()
    assert missed(found.model_, test, periodic) < 0.1 * NOISE


def test_an_element_of_unknown_shape_is_found() -> None:
    noisy, test = shaken("slipping", periodic=True)
    found = OscillatorEstimator(element="duhem", periodic=True).fit(noisy)
    assert missed(found.model_, test, True) < 0.2 * NOISE


ELEMENTS = [
    (follow_bouc_wen, BoucWenOscillator.example()),
    (follow_duhem, DuhemOscillator.example()),
    (follow_duhem, replace(DuhemOscillator.example(), knots=(-0.4, 0.0, 0.4))),
]
"""The last with forces beyond its knots."""


@pytest.mark.parametrize(("follow", "model"), ELEMENTS)
@pytest.mark.kernel
def test_runs_with_derivatives_are_those_of_the_block_and_exact(follow: Any, model: Any) -> None:
    step, n = 0.01, 60
    inputs = np.append(0.0, 1.5 * np.sin(0.3 * np.arange(1, n + 1)))

    def run(model: Any, slopes: bool = False) -> tuple[Array, Array]:
        p = model.n_parameters
        numbers = np.array([model.inertia, model.damping, model.stiffness, *model.element])
        given, table = np.empty((n, 2)), np.empty((n if slopes else 0, p))
        follow(numbers, step, np.zeros(3), np.zeros((3, p)), inputs, 1, 0, given, table)
        return given[:, 0], table

    outputs, slopes = run(model, True)
    block = replace(model, substeps=1).simulate(inputs[1:], sample_time=step, initial="virgin")
    np.testing.assert_allclose(outputs, block, rtol=1e-12, atol=1e-14)
    slopes[:, 0] *= 1e-3
    values = model.pack()
    for place, value in enumerate(values.tolist()):
        ends = []
        for way in (-1e-5, 1e-5):
            moved = values.copy()
            moved[place] = value * (1 + way) + way * (value == 0)
            ends.append((run(model.unpack(vector(moved)))[0], moved[place]))
        (low, before), (high, after) = ends
        expected = (high - low) / (after - before)
        np.testing.assert_allclose(
            slopes[:, place], expected, atol=1e-4 * max(np.abs(expected).max(), 1e-9)
        )


def test_what_cannot_be_learned_from_is_refused() -> None:
    noisy, _ = shaken("quick", periodic=True)
    with pytest.raises(ModelError, match="initial: it is 'fitted'"):
        OscillatorEstimator(initial="fitted").fit(noisy)  # type: ignore[arg-type]
    turned = [run.with_channels(displacement=-run["displacement"]) for run in noisy]
    with pytest.raises(DataError, match="displacement"):
        OscillatorEstimator(periodic=True).fit(turned)


@pytest.mark.long
@pytest.mark.skipif(not BENCHMARK.is_dir(), reason="the benchmark's files are not here")
@pytest.mark.parametrize(("element", "most"), [("bouc-wen", 1.1e-4), ("duhem", 7.2e-3)])
def test_the_benchmark_is_met(element: Any, most: float) -> None:
    """Test errors [mm]: below what the noise leaves of six numbers; and below any black box's yet."""
    from scipy.io import loadmat

    def samples(name: str) -> Array:
        content = loadmat(BENCHMARK / f"{name}_multisine.mat")
        (found,) = (value.ravel() for key, value in content.items() if not key.startswith("__"))
        return found

    force, y = samples("uest").reshape(4, -1), 1e3 * samples("yest").reshape(4, -1)
    runs = [
        Recording({"force": u, "displacement": moved}, 1 / 750)
        for u, moved in zip(force, y, strict=True)
    ]
    model: Any = OscillatorEstimator(element=element, periodic=True).fit(runs).model_
    given = model.steady_state(Recording({"force": samples("uval")}, 1 / 750))["displacement"]
    assert np.sqrt(np.mean((given - 1e3 * samples("yval")) ** 2)) < most
