"""Every block on an emulated Cortex-M4F: instructions, memory, and the difference from Python.

    python benchmarks/microcontroller.py > docs/deploy/microcontroller.md

Wants gcc-arm-none-eabi, libnewlib-arm-none-eabi and qemu-system-arm; takes about two minutes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from mckibben import Block, Channel, Series
from mckibben.blocks.compose import PerChannel
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.coupled.coupling import Coupling
from mckibben.blocks.coupled.fuzzy_network import FuzzyNetwork
from mckibben.blocks.hysteresis.gpi import GPI
from mckibben.blocks.laws import examples
from mckibben.exporting.c.emulation import Emulation, emulate

SAMPLE_TIME = 0.01

HEAD = """# Blocks on a microcontroller

Cost of one step in single precision on an Arm Cortex-M4F (`gcc -O2`) emulated by QEMU. Instruction
counts are exact and repeatable; the number of cycles on a chip is somewhat larger. Each model is its
documentation example unless stated otherwise, run on about 200 samples with minor loops and holds.

- *Median* and *max* are the instructions of a step, *first* those of the first one, which also
  initializes the memory.
- *RAM* is the memory of one model in bytes. *Stack* is the maximum, including the C library. *Flash* is
  code and constants, without functions of the C library such as `exp`.
- *Error* is the largest difference from Python in double precision, relative to the output range.

This page is written by `python benchmarks/microcontroller.py`.

| model | median | max | first | RAM | stack | flash | error |
|---|---:|---:|---:|---:|---:|---:|---:|"""


def channels(stem: str, unit: str) -> tuple[Channel, ...]:
    return tuple(Channel(f"{stem}_{k}", unit) for k in (1, 2, 3))


def muscles(n_operators: int) -> list[GPI]:
    """Return the hysteresis of three muscles, on ten operators each."""
    thresholds = tuple(0.1 * k for k in range(n_operators))
    weights = tuple(12.0 / (1 + k) for k in range(n_operators))
    pairs = zip(channels("pressure", "bar"), channels("displacement_free", "mm"), strict=True)
    example = GPI.example()
    return [
        replace(example, thresholds=thresholds, weights=weights, input=pressure, output=free)
        for pressure, free in pairs
    ]


def network(backward: bool) -> FuzzyNetwork:
    """Return a network of 81 rules for three muscles and an extensor; backward, its learned inverse."""
    wide = (0.0, 20.0, 40.0)
    ends = channels("displacement_coupled", "mm"), channels("displacement", "mm")
    driven, given = ends[::-1] if backward else ends
    consequents = []
    for rule in range(81):
        for j in range(3):
            row = [0.03, 0.03, 0.03, 0.1]
            row[j] = 1.0 + 0.001 * rule
            consequents += row
    return FuzzyNetwork(
        (wide,) * 3 + ((0.0, 1.25, 2.5),),
        ((12.0,) * 3,) * 3 + ((0.8,) * 3,),
        tuple(consequents),
        driven,
        given,
        (Channel("pressure_extensor", "bar"),),
        False,
        ((-40.0, 80.0),) * 3,
    )


def compositions() -> Iterator[tuple[str, Block]]:
    """Give the papers' compositions."""
    first = muscles(10)
    yield "GPI, 10 operators", first[0]
    yield "GPI inverse, 10 operators", first[0].inverse()
    free, coupled = channels("displacement_free", "mm"), channels("displacement_coupled", "mm")
    gains = ((1.0, 0.1, 0.05), (0.08, 1.0, 0.1), (0.02, 0.12, 1.0))
    ahead = (PerChannel(tuple(first)), Coupling(gains, free, coupled))
    sdchm = Series((*ahead, network(backward=False)))
    undone = [part.inverse() for part in reversed(ahead)]
    yield "SDCHM: three muscles, 81 rules", sdchm
    yield "SDIHC, learned inverse of the network", Series((network(backward=True), *undone))
    yield "SDIHC, network solved by Newton's method", sdchm.inverse()


def balance() -> Balance:
    """Return a balance of three muscles beside an extensor, as a fit gives it."""
    springs = []
    for k in range(3):
        row = [-2.0] * 3
        row[k] = 15.0
        springs.append((0.0, *row, -2.0, *(0.1 * v for v in row), 0.1, *(0.01 * v for v in row)))
    return Balance(
        springs=tuple(springs),
        elasticity=((6.0, 4.0, 2.0, 1.0, 0.5),) * 3,
        areas=((60.0, -25.0, -6.0),) * 3,
        friction=((1.0, 1.0, 0.8, 0.6, 0.4, 0.3),) * 3,
        relaxation=((1.0, 0.6),) * 3,
        loads=((),) * 3,
        damping=(0.1,) * 3,
        walls=(0.05,) * 3,
        limits=(0.2, 0.6, 2.0, 6.0, 18.0, 50.0),
        friction_growth=0.95,
        highest_pressure=9.5,
        lags=(0.8, 12.0),
        hull=((-20.0, 50.0),) * 3,
        scale=50.0,
        degree=2,
        driven=channels("displacement", "mm"),
        scheduled=(Channel("pressure_extensor", "bar"),),
        given=channels("pressure", "bar"),
    )


def models() -> Iterator[tuple[str, Block]]:
    """Give all that is measured."""
    yield from compositions()
    muscles_of = "balance: three muscles, extensor, six stops, two lags"
    yield f"{muscles_of}; to pressures", balance()
    yield f"{muscles_of}; to displacements", balance().inverse()
    for title, block in examples().items():
        yield f"`{title}`", block


def row(name: str, found: Emulation) -> str:
    steps = found.instructions[1:]
    counts = [np.median(steps), steps.max(), found.instructions[0]]
    sizes = [found.ram, found.stack, found.flash]
    numbers = " | ".join(
        f"{round(float(number)):,}".replace(",", "\N{NO-BREAK SPACE}")
        for number in [*counts, *sizes]
    )
    return f"| {name} | {numbers} | {found.difference:.1e} |"


def main() -> None:
    print(HEAD)
    for name, block in models():
        print(row(name, emulate(block, sample_time=SAMPLE_TIME)), flush=True)


if __name__ == "__main__":
    main()
