"""What one absurd sample does to a stream of every block: right then, and a second later.

    python benchmarks/glitches.py

Single samples of 1e6, 1e30, NaN and infinity come on each input at several times of a motion over the
identified range. Printed is the largest difference from the run without them, relative to the range of
each output: in the second after the sample, and from then on; without the bounds of inputs too, as
where only NaN and infinity are held. Exported C has the numbers of the stream.
"""

from __future__ import annotations

import sys
import warnings

import numpy as np

from mckibben import Block
from mckibben.arrays import Array
from mckibben.blocks.adaptive import Adaptive
from mckibben.blocks.base import Stream
from mckibben.blocks.laws import examples, trial_limits, wander
from mckibben.blocks.ranges import LARGEST

SAMPLE_TIME, SECOND, SAMPLES = 0.01, 100, 600
GLITCHES, TIMES = (1e6, 1e30, np.nan, np.inf), (37, 211, 398)


def motion(block: Block) -> Array:
    """Return a motion over the range of a block, with its measurements near the references."""
    rng = np.random.default_rng(3)
    inputs = np.resize(wander(*trial_limits(block), rng, 100, 10), (SAMPLES, len(block.inputs)))
    if isinstance(block, Adaptive):
        m = len(block.measured)
        inputs[1:, -m:], inputs[0, -m:] = inputs[:-1, :m], inputs[0, :m]
    return inputs


def run(block: Block, inputs: Array, *, bounded: bool = True) -> Array:
    """Return the outputs of a stream."""
    stream = Stream(block, SAMPLE_TIME)
    if not bounded:
        stream._bounds = [(-LARGEST, LARGEST)] * len(block.inputs)
    return np.array([stream.step(row).copy() for row in inputs])


def worst(block: Block, *, bounded: bool = True) -> tuple[float, float]:
    """Return the largest relative difference within a second of a glitch, and after that."""
    inputs = motion(block)
    clean = run(block, inputs)
    span = np.maximum(np.ptp(clean, axis=0), 1e-9 * np.abs(clean).max(axis=0) + 1e-300)
    soon = late = 0.0
    for column in range(inputs.shape[1]):
        for time in TIMES:
            for value in GLITCHES:
                given = inputs.copy()
                given[time, column] = value
                off = np.abs(run(block, given, bounded=bounded) - clean) / span
                soon = max(soon, float(off[time : time + SECOND].max()))
                late = max(late, float(off[time + SECOND :].max()))
    return soon, late


def main() -> int:
    """Print a row a block."""
    warnings.simplefilter("ignore")
    print("| block | within 1 s | after 1 s | after 1 s, only finite inputs asked for |")
    print("|---|---:|---:|---:|")
    for title, block in examples().items():
        (soon, late), (_, unbounded) = worst(block), worst(block, bounded=False)
        rate = "" if block.rate_dependent else " *"
        print(f"| {title}{rate} | {soon:.2g} | {late:.2g} | {unbounded:.2g} |", flush=True)
    print("* independent of the rate")
    return 0


if __name__ == "__main__":
    sys.exit(main())
