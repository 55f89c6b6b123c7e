"""Contract tests of rigs, for authors of new ones."""

from __future__ import annotations

import tempfile
import warnings
from pathlib import Path

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import ContractError, DataError, DataWarning
from mckibben.recording import Recording
from mckibben.rigs.files import load_rig, save_rig
from mckibben.rigs.rig import Rig, quantity
from mckibben.signals import irregular_triangle

DURATION = 30.0
"""Of the trial runs [s]."""

STEPS = 50
"""Samples stepped one by one."""


def check_rig(rig: Rig, *, seed: int = 0) -> None:
    """Test a rig against all laws of rigs.

    A saved copy is equal; runs are repeatable for a seed, and another seed changes the noise alone;
    stepping gives what running with held commands gives, to the last bit; halving the step of the
    integration changes what is measured by less than the sensors' noise and resolution; commands
    beyond the range are limited, and the recording says so; commands that are not numbers are refused.

    Parameters
    ----------
    rig : Rig
        What to check.
    seed : int, default 0
        Of the trial inputs and the noise.

    Raises
    ------
    ContractError
        Naming the first law that is broken.

    Examples
    --------
    >>> from mckibben.rigs import check_rig, load_rig
    >>> check_rig(load_rig("mas20-hanging"))
    """
    inputs = _lively(rig, seed)
    for law in (_saves, _repeats, _steps, _converges, _saturates, _refuses):
        law(rig, inputs, seed)


def _demand(rig: Rig, holds: bool, law: str) -> None:
    if not holds:
        raise ContractError(
            f"the rig {rig.name!r} breaks the contract: {law}",
            remedy="correct its parameters or set-up",
        )


def _lively(rig: Rig, seed: int) -> Recording:
    """Return inputs that vary over most of their ranges."""
    time = np.arange(0.0, DURATION, max(rig.sample_time, 0.01))
    channels = {}
    for i, name in enumerate(rig.inputs):
        limits = rig.limits(name)
        reach = limits.high - limits.low
        channels[name] = irregular_triangle(
            time, 9, limits.low + 0.9 * reach, limits.low + 0.05 * reach, seed=seed + i
        )
    return Recording(channels, max(rig.sample_time, 0.01))


def _matrix(rig: Rig, recording: Recording) -> Array:
    return recording.matrix(rig.outputs)


def _saves(rig: Rig, inputs: Recording, seed: int) -> None:
    del inputs, seed
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "rig.toml"
        save_rig(rig, path)
        _demand(rig, load_rig(path) == rig, "a saved copy is equal")


def _repeats(rig: Rig, inputs: Recording, seed: int) -> None:
    first, again = rig.run(inputs, seed), rig.run(inputs, seed)
    _demand(rig, first == again, "running again with the same seed returns the same outputs")
    _demand(rig, bool(np.isfinite(_matrix(rig, first)).all()), "measurements are finite")
    noisy = any(rig.sensor[quantity(name)].noise for name in rig.outputs)
    other = rig.run(inputs, seed + 1)
    _demand(rig, not noisy or first != other, "another seed gives other noise")
    _demand(
        rig,
        rig.run(inputs, seed, ideal=True).channels.keys() >= set(rig.outputs),
        "ideal sensors measure every output",
    )


def _steps(rig: Rig, inputs: Recording, seed: int) -> None:
    own = Recording({name: inputs[name][:STEPS] for name in rig.inputs}, rig.sample_time)
    run = _matrix(rig, rig.run(own, seed, held=True))
    stepped = [rig.reset(seed)]
    stepped += [rig.step(row) for row in own.matrix(rig.inputs)[:-1]]
    _demand(
        rig, np.array_equal(run, stepped), "stepping gives what running with held commands gives"
    )


def _converges(rig: Rig, inputs: Recording, seed: int) -> None:
    del seed
    coarse = rig.run(inputs, ideal=True)
    fine = rig.changed({"integration_step": rig.integration_step / 2}).run(inputs, ideal=True)
    for name in rig.outputs:
        sensor = rig.sensor[quantity(name)]
        change = float(np.sqrt(np.mean((coarse[name] - fine[name]) ** 2)))
        _demand(
            rig,
            change <= max(sensor.noise, sensor.resolution, 1e-12),
            f"halving the integration step changes {name} by less than its sensor shows "
            f"({change:.3g} RMS)",
        )


def _saturates(rig: Rig, inputs: Recording, seed: int) -> None:
    wild = {name: np.where(np.arange(len(inputs)) % 400 < 200, -1e9, 1e9) for name in rig.inputs}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)
        recording = rig.run(Recording(wild, inputs.sample_time), seed, ideal=True)
    _demand(
        rig,
        dict(recording.meta.get("saturated", {})) == dict.fromkeys(rig.inputs, len(inputs)),
        "a recording states how many commands were limited",
    )
    _demand(
        rig,
        bool(np.isfinite(_matrix(rig, recording)).all()),
        "outputs stay finite under extreme commands",
    )


def _refuses(rig: Rig, inputs: Recording, seed: int) -> None:
    del inputs
    rig.reset(seed)
    for wrong in (np.full(len(rig.inputs), np.nan), np.zeros(len(rig.inputs) + 1)):
        try:
            rig.step(wrong)
        except DataError:
            continue
        _demand(rig, False, "commands that are no numbers, or too many, are refused")
