"""What tests of balances of forces share: balances to draw, motions, and runs without complaint."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import Any

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from mckibben.blocks.base import Block
from mckibben.blocks.compose import PerChannel, Series
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.dynamics.air import Air
from mckibben.blocks.fields import Channel, rows, vector
from mckibben.blocks.inverse import Inverse
from mckibben.blocks.laws import wander
from mckibben.blocks.memoryless import Affine, Contact
from tests.blocks.strategies import numbers

Array = NDArray[np.float64]

STEP = 0.05
"""Sample time [s]."""

SEEDS = st.integers(0, 1000)

HIGHEST, LOADED, FURTHEST = 4.0, 40.0, 30.0
"""Pressure [bar], load [N] and displacement [mm] to try, over which `balances` are convex."""


@st.composite
def balances(
    draw: st.DrawFn,
    /,
    n: int | None = None,
    n_loads: int | None = None,
    m: int | None = None,
    n_lags: int | None = None,
    heavy: bool = False,
    crowded: bool = False,
    driven: int | None = None,
) -> Balance:
    """Draw a balance whose energy is convex: stiffness of 14 N/mm and more outweighs what is lost.

    Of n coordinates, which, ``crowded``, n + 1 muscles move, from evenly spread directions; their
    pressures were ``driven`` in 0 directions more than coordinates, or in 1.
    """
    n = draw(st.integers(1, 2 if crowded else 3)) if n is None else n
    n_loads = draw(st.integers(0, 1)) if n_loads is None else n_loads
    m = draw(st.integers(0, 3)) if m is None else m
    n_lags = draw(st.integers(0, 2)) if n_lags is None else n_lags
    n_x, degree = draw(st.integers(0, 1)), draw(st.integers(1, 2))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    muscles = n + crowded

    def stiff(least: float) -> Array:
        mix = rng.normal(size=(n, n))
        return mix @ mix.T + least * np.eye(n)

    matrices = [stiff(14.0), *(0.3 * stiff(0.0) for _ in range(n_x * degree))]

    def drive() -> Array:
        ways = directions[:, :n] @ stiff(0.5) + rng.uniform(-0.1, 0.1, (muscles, n))
        common = rng.uniform(0.2, 0.5, (muscles, driven or 0))
        return np.column_stack([rng.uniform(1.5, 2.5, muscles), ways, common])

    constants = rng.uniform(-4.0, 4.0, (n, len(matrices), 1))
    springs = np.concatenate([constants, np.array(matrices).transpose(1, 0, 2)], axis=2)
    turned = 2.0 * np.pi * (np.arange(muscles) + rng.uniform(-0.1, 0.1, muscles)) / muscles
    directions = rng.uniform(0.5, 1.0) * np.stack([np.cos(turned), np.sin(turned)], axis=1)
    walls = rng.uniform(0.0, 0.1, muscles)
    ends = (
        np.array([(1.0, 5.0, 0.0), (-1.0, -5.0, 0.0)]),
        np.array([(1.0, 25.0, 9.0), (-1.0, 5.0, 9.0)]),
    )
    obstacles = np.concatenate(
        [rng.uniform(*ends, (n, 2, 3)), rng.uniform(0.0, 2.0, (n, 2, n_x))], axis=2
    )
    return Balance(
        springs=rows(springs.reshape(n, -1)),
        elasticity=rows(rng.uniform(0.0, 6.0, (muscles, 2))),
        areas=rows(rng.uniform((50.0, -25.0, -8.0), (80.0, -5.0, 0.0), (muscles, 3))),
        friction=rows(rng.uniform(0.0, 1.5, (muscles, m))),
        relaxation=rows(rng.uniform(0.0, 2.0, (muscles, n_lags))),
        loads=rows(np.eye(n) if n_loads == n else rng.uniform(0.5, 1.0, (n, n_loads))),
        damping=vector(rng.uniform(0.0, 0.2, muscles) if n_lags else np.zeros(muscles)),
        lines=vector(rng.uniform(0.0, 0.1, muscles)) if n_lags else (),
        walls=vector(walls),
        limits=vector(np.cumsum(rng.uniform(0.2, 1.2, m))),
        friction_growth=draw(numbers(0.0, 1.0)),
        highest_pressure=HIGHEST,
        lags=vector(rng.uniform(0.05, 5.0, n_lags)),
        hull=((-20.0, 50.0),) * muscles,
        scale=50.0,
        degree=degree,
        driven=channels("displacement", "mm", n),
        scheduled=(*channels("extensor", "bar", n_x), *channels("force", "N", n_loads)),
        given=channels("pressure", "bar", muscles),
        tare=draw(st.booleans()),
        settled=draw(st.booleans()),
        mass=vector(rng.uniform(0.0, 0.03, muscles)) if heavy else (),
        asymmetry=draw(st.none() | numbers(0.3, 2.0)),
        friction_slopes=vector(rng.uniform(0.0, 0.2, n_x)) if draw(st.booleans()) else (),
        obstacles=rows(obstacles.reshape(n, -1)) if draw(st.booleans()) else (),
        directions=rows(directions[:, :n]) if crowded else (),
        preload=draw(numbers(0.0, 2.0)) if crowded else 0.0,
        drive=() if driven is None else rows(drive()),
    )


def channels(stem: str, unit: str, n: int) -> tuple[Channel, ...]:
    return tuple(Channel(f"{stem}_{k}", unit) for k in range(1, n + 1))


def motion(block: Block, driven: tuple[float, float], seed: int, n_turns: int = 10) -> Array:
    """Return joint motion with minor loops of a balance, or, by its pressures, of its inverse."""
    balance = block.forward if isinstance(block, Inverse) else block
    assert isinstance(balance, Balance)
    n, n_x, n_loads = block.n_driven, balance.n_schedules, balance.n_loads
    low = [driven[0]] * n + [0.0] * n_x + [-LOADED] * n_loads
    high = [driven[1]] * n + [2.0] * n_x + [LOADED] * n_loads
    return wander(np.array(low), np.array(high), np.random.default_rng(seed), 8, n_turns)


def undone(block: Block, inputs: Array, start: str = "first_sample") -> Array:
    """Return what a block's inverse makes of its outputs, beside what schedules it."""
    given = np.column_stack([run(block, inputs, initial=start), inputs[:, block.n_driven :]])
    return run(block.inverse(), given, initial=start)


def run(block: Block, inputs: Array, sample_time: float = STEP, **start: Any) -> Array:
    """Simulate, and allow no complaint."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return block.simulate(inputs, sample_time=sample_time, **start)


ALONE = Balance(
    springs=((0.0, 14.0),),
    elasticity=((6.0, 4.0),),
    areas=((60.0, -25.0, -6.0),),
    friction=((3.0, 1.5),),
    relaxation=((1.0,),),
    loads=((1.0,),),
    damping=(0.1,),
    lines=(0.04,),
    walls=(0.05,),
    limits=(2.0, 8.0),
    friction_growth=0.95,
    highest_pressure=9.5,
    lags=(0.8,),
    hull=((-20.0, 50.0),),
    scale=50.0,
    degree=1,
    driven=channels("displacement", "mm", 1),
    scheduled=channels("force", "N", 1),
    given=channels("pressure", "bar", 1),
)
"""One muscle under a load."""

CROWDED = replace(
    ALONE,
    springs=((0.0, 14.0, 1.0), (0.0, 1.0, 16.0)),
    elasticity=((6.0, 4.0),) * 3,
    areas=((60.0, -25.0, -6.0),) * 3,
    friction=((3.0, 1.5),) * 3,
    relaxation=((1.0,),) * 3,
    loads=((1.0,), (0.5,)),
    damping=(0.1,) * 3,
    lines=(0.04,) * 3,
    walls=(0.05,) * 3,
    hull=((-20.0, 50.0),) * 3,
    driven=channels("displacement", "mm", 2),
    given=channels("pressure", "bar", 3),
    directions=((0.8, 0.0), (-0.4, 0.7), (-0.4, -0.7)),
    preload=2.0,
)
"""Three muscles that move two coordinates."""


def in_series(balance: Balance, dead_time: float) -> Series:
    """Return a balance behind valves with dead times and dead zones, and before sensors of angles."""
    given, driven = balance.given, balance.driven
    names = [(Channel(f"{c.name}_set", "V"), Channel(f"{c.name}_measured", "bar")) for c in given]
    lags = (0.02, 0.04, dead_time, None, None, (-9.0, 19.0))
    valves = [Air(1.0, 0.0, 0.0, *lags, input=own, output=there) for own, there in names]
    zones = [Contact(0.1, there, c) for (_, there), c in zip(names, given, strict=True)]
    sensors = [Affine(2.0, 1.0, c, Channel(f"angle_{k}", "deg")) for k, c in enumerate(driven)]
    before = (PerChannel(tuple(valves)), PerChannel(tuple(zones)))
    return Series((*before, Inverse(balance), PerChannel(tuple(sensors))))
