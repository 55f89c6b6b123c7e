"""A study put together by hand, so that the report is tested without fitting anything."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from mckibben.blocks.base import Block
from mckibben.blocks.compose import Series
from mckibben.blocks.fields import Channel
from mckibben.blocks.hysteresis.gpi import GPI
from mckibben.blocks.hysteresis.pi import PI, RateDependentPI
from mckibben.blocks.memoryless import PiecewiseLinear
from mckibben.comparison.leaderboard import Leaderboard, Row
from mckibben.diagnosis import characterize
from mckibben.diagnosis.branch_gaps import Memory
from mckibben.metrics import score
from mckibben.recording import Recording
from mckibben.signals import triangle
from mckibben.studying.inverting import Compensation, check_inverse
from mckibben.studying.recorded_inputs import RecordedInputs
from mckibben.studying.study import Study

Array = NDArray[np.float64]

TIME = np.arange(0, 20, 0.05)
QUICKLY = {"balance": {"n_stops": 2, "n_lags": 0, "steps": 2, "elasticity": 3, "terms": ()}}
"""Settings with which a balance is fitted in a second."""


def measured(
    n: int = 3000,
    *,
    seed: int = 0,
    sample_time: float | None = 0.01,
    channels: tuple[str, str] = ("pressure", "displacement"),
    **meta: str,
) -> Recording:
    """Return a recording of a made-up muscle: growing triangles with noise, six cycles."""
    rng = np.random.default_rng(seed)
    phase = np.linspace(0, 6, n)
    u = (1 - np.abs(2 * (phase % 1) - 1)) * (2 + 3 * np.floor(phase + 1e-9).clip(0, 5) / 5)
    y = GPI.example().simulate(u) + 0.05 * rng.standard_normal(n)
    units = {} if channels == ("pressure", "displacement") else dict.fromkeys(channels, "V")
    return Recording(
        dict(zip(channels, (u, y), strict=True)), sample_time, units, meta={"name": "muscle"} | meta
    )


def _moved(wave: Array, seed: int) -> Array:
    """Return what a muscle makes of a wave, with noise."""
    noise = np.random.default_rng(seed).standard_normal(wave.size)
    moved: Array = PI.example().simulate(wave) + 0.02 * noise
    return moved


def two_muscles(peak: float, seed: int = 0) -> Recording:
    """Return a recording of two muscles that move one another."""
    waves = [triangle(TIME + k, 4.0, peak) for k in (1, 2)]
    one, two = (_moved(wave, seed + k) for k, wave in enumerate(waves))
    outputs = {"displacement_1": one - 0.2 * two, "displacement_2": two - 0.2 * one}
    inputs = {f"pressure_{k}": wave for k, wave in enumerate(waves, 1)}
    return Recording(inputs | outputs, 0.05, meta={"name": f"run {seed}"})


def hung(load: float, seed: int = 0) -> Recording:
    """Return a recording of a muscle under a dead load that stretches it."""
    wave = triangle(TIME + seed, 7.0, 4.0)
    channels = {"pressure": wave, "displacement": _moved(wave, seed) - 0.2 * load}
    force = np.full(TIME.size, load)
    return Recording(channels | {"force": force}, 0.05, meta={"name": f"under {load:g} N"})


def models() -> dict[str, Block]:
    """Return models of every kind that the report treats apart, best first."""
    gpi, pi = GPI.example(), PI.example()
    curve = PiecewiseLinear.example()
    return {
        "gpi": gpi,
        "mpi": Series((pi, curve)),
        "rdpi": RateDependentPI.example(),
        "pi": replace(pi, weights=tuple(0.9 * w for w in pi.weights)),
    }


def study(
    train: tuple[Recording, ...] | None = None,
    test: tuple[Recording, ...] | None = None,
    *,
    blocks: Mapping[str, Block] | None = None,
    inverse: bool = True,
    notes: tuple[str, ...] = (),
    reason: str = "the data have no time. Remedy: give --rate.",
) -> Study:
    """Return a study; without recordings, one of which the last quarter is held out."""
    if train is None:
        whole = measured()
        train, test = (whole.slice(0, 3 * len(whole) // 4),), (whole,)
    test = test if test is not None else (measured(seed=1, name="another day"),)
    blocks = models() if blocks is None else blocks
    input_name, output_name = list(train[0].channels)[:2]
    predictions = {
        name: tuple(
            block.simulate(r[input_name], sample_time=r.sample_time or 1.0)[:, np.newaxis]
            for r in (*train, *test)
        )
        for name, block in blocks.items()
    }
    rows = []
    for place, (name, block) in enumerate(blocks.items()):
        n_train = len(train)
        fitted = score(train[0][output_name], predictions[name][0][:, 0])
        tested = score(test[0][output_name], predictions[name][n_train][:, 0])
        rows.append(
            Row(
                model=name,
                n_parameters=block.n_parameters,
                fit_seconds=0.4 + place,
                step_ns=12.5,
                train=fitted,
                test=tested,
                validation_rmse=1.1 * fitted.rmse,
                rmse_interval=(0.9 * tested.rmse, 1.15 * tested.rmse),
                difference_interval=(-0.01 + 0.1 * place, 0.2 + place),
                memory=Memory(0.95 - 0.3 * place, 40, 1.0),
                block=block,
            )
        )
    rows.append(Row(model="eupi", reason=reason))
    board = Leaderboard(
        inputs=(input_name,),
        outputs=(output_name,),
        unit=train[0].units[output_name],
        rows=tuple(rows),
        split="last 25 % of muscle to test, all before it to fit",
        seed=0,
        n_train=sum(map(len, train)),
        n_test=sum(map(len, test)),
    )
    return Study(
        train=train,
        test=test,
        characterization=characterize([*train, *test], input_name, output_name),
        leaderboard=board,
        predictions=predictions,
        inverse=compensated(rows[0], train[0]) if inverse and blocks else None,
        notes=notes,
    )


@cache
def plain_study() -> Study:
    """Return the study by default, once for all that look at it."""
    return study()


def compensated(row: Row, recording: Recording) -> Compensation:
    """Return what is expected of the compensator of a row."""
    assert row.block is not None
    space = RecordedInputs.of([recording], [channel.name for channel in row.block.inputs])
    check = check_inverse(row.block, space, model=row.model)
    error, ends = row.test_error, row.rmse_interval
    return Compensation(row.model, check.inverse, "mm", error, ends, 10 * error, check, ())


def renamed(block: Block, names: tuple[str, str]) -> Block:
    """Return a model with other channels."""
    channels = (Channel(name, "V") for name in names)
    return replace(block, **dict(zip(("input", "output"), channels, strict=True)))  # type: ignore[type-var]
