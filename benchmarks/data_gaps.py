"""Data gaps named in recordings of virtual plants that lack one kind of excitation, and in complete ones.

    python benchmarks/data_gaps.py [--seeds N] [PLANT ...]

Every plant of tests/plants is recorded once with all kinds of excitation (random motion of all inputs
and loads at several speeds, holds, and one run twice) and once without each kind. A table says in how
many the gap is named that was made, and what else is named.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

from tests.plants import PLANTS, Plant, motions

from mckibben import Recording
from mckibben.arrays import Array
from mckibben.diagnosis.data_gaps import data_gaps

Runs = list[Recording]
Motion = Callable[[float, float], Array]
"""From seconds and speed to samples from 0 to 1 of one channel."""


class Bench:
    """Records a plant under commands from 0 to 1 of each pressure and load."""

    def __init__(self, name: str, seed: int) -> None:
        self.plant: Plant = PLANTS[name](seed)
        self.rng = np.random.default_rng(1000 + seed)
        self.bench = self.plant.bench
        # a wall is there or not, and no model is told
        self.loads = [one for one in self.bench.loads if one in ("force", "torque")]
        ends = (np.concatenate([run[one] for run in self.plant.train]) for one in self.loads)
        self.ends = [(0.05 * self.bench.high, 0.95 * self.bench.high)] * len(self.bench.pressures)
        self.ends += [(float(x.min()), float(x.max())) for x in ends]

    @property
    def width(self) -> int:
        """Number of pressures and loads."""
        return len(self.ends)

    def record(self, shares: Array) -> Recording:
        """Record what comes of shares of the range, shape (n, width)."""
        low, high = np.transpose(self.ends)
        given, k = low + (high - low) * shares, len(self.bench.pressures)
        loads = given[:, k:] if self.loads else np.zeros((len(given), len(self.bench.loads)))
        moved = self.plant.respond(given[:, :k], loads)
        seen, shown = (
            x + noise * self.rng.standard_normal(x.shape)
            for x, noise in zip((given[:, :k], moved), self.bench.noise, strict=True)
        )
        names = (*self.bench.pressures, *self.loads, *self.bench.outputs)
        columns = np.column_stack([seen, given[:, k:], shown]).T
        return Recording(dict(zip(names, columns, strict=True)), self.bench.sample_time)

    def all(self, motion: Motion, seconds: float, speed: float = 1.0) -> Array:
        """Move every pressure and load by its own motion."""
        return np.column_stack([motion(seconds, speed) for _ in range(self.width)])

    def random(self, seconds: float, speed: float) -> Array:
        """Move at random, in one of three ways."""
        step, rng = self.bench.sample_time, self.rng
        if (kind := rng.integers(3)) == 0:
            strokes = (1.0 / speed, 4.0 / speed)
            return motions.wander(rng, seconds, step, 0.0, 1.0, strokes)
        if kind == 1:
            return motions.waves(rng, seconds, step, 0.0, 1.0, (0.05 * speed, 0.4 * speed))
        return motions.ramps(rng, seconds, step, 0.0, 1.0, (0.3 * speed, 0.6 * speed), 0.5)

    def one_speed(self, seconds: float, speed: float) -> Array:
        """Move between random levels at one speed."""
        rates = (0.4 * speed, 0.4 * speed)
        return motions.ramps(self.rng, seconds, self.bench.sample_time, 0.0, 1.0, rates, 0.1)

    def cycles(self, seconds: float, speed: float) -> Array:
        """Cycle over the whole range, with a period and a phase of its own."""
        period = self.rng.uniform(4.0, 7.0) / speed
        time = self.bench.sample_time * np.arange(round(seconds / self.bench.sample_time))
        return 0.5 - 0.5 * np.cos(2 * np.pi * (time / period + self.rng.uniform()))

    def holds(self, seconds: float = 15.0, count: int = 3) -> Array:
        """Hold all at random levels."""
        step, rng = self.bench.sample_time, self.rng
        levels = np.repeat(rng.uniform(0.1, 0.9, (count + 1, self.width)), 2, axis=0)
        times = np.append(0.0, np.cumsum(np.tile([seconds, 1.0], count + 1)))[:-1]
        time = np.arange(0.0, times[-1], step)
        return np.column_stack([np.interp(time, times, column) for column in levels.T])

    def shares(self, motion: Motion | None = None, *, speeds: tuple[float, ...] = (0.2, 2.0)) -> Array:
        """Move all at several speeds."""
        motion = motion or self.random
        return np.concatenate([self.all(motion, 45.0 if s < 1 else 25.0, s) for s in speeds])

    def repeated(self, shares: Array, *others: Array) -> Runs:
        """Record one motion twice, and others."""
        return [self.record(x) for x in (shares, shares, *others)]

    def complete(self) -> Runs:
        """Record all kinds of excitation."""
        return self.repeated(self.shares(), self.holds())


def planted(bench: Bench) -> Iterator[tuple[str, str, Runs, Runs]]:
    """Give kinds of excitation left out, the gap that this makes, the recordings, and tests."""
    k, n_loads = len(bench.bench.pressures), len(bench.loads)
    yield "nothing", "", bench.complete(), []
    yield "minor loops", "minor loops", bench.repeated(bench.shares(bench.cycles), bench.holds()), []
    slow = bench.all(bench.one_speed, 60.0)
    yield "other speeds", "rate", bench.repeated(slow, bench.holds()), []
    yield "holds", "creep", bench.repeated(bench.shares()), []
    yield "repeats", "repeats", [bench.record(bench.shares()), bench.record(bench.holds())], []
    once = np.repeat(bench.all(bench.cycles, 5.0)[:, :1], bench.width, axis=1)
    yield "all but one cycle", "repeats", [bench.record(once)], []
    yield "turning back", "hysteresis", [bench.record(np.sort(bench.shares(), axis=0))], []
    half = bench.repeated(0.5 * bench.shares(), 0.5 * bench.holds())
    yield "the upper half", "range", half, [bench.record(bench.all(bench.random, 40.0))]
    every = round(0.7 / bench.bench.sample_time)
    names = bench.record(bench.holds()).channels
    thinned = [
        Recording({name: run[name][::every] for name in names}, every * bench.bench.sample_time)
        for run in bench.complete()
    ]
    yield "most samples", "sampling", thinned, []
    yield "time", "time", [Recording(dict(r.channels), None) for r in bench.complete()], []
    name = bench.bench.outputs[0]
    runs = bench.complete()
    step = max(float(np.ptp(run[name])) for run in runs) / 25
    coarse = [run.with_channels(**{name: step * np.round(run[name] / step)}) for run in runs]
    yield "resolution", "resolution", coarse, []
    if bench.width > 1:
        tied = [np.repeat(x[:, :1], bench.width, axis=1) for x in (bench.shares(), bench.holds())]
        yield "independent motion", "coupling", bench.repeated(*tied), []
    if k > 1:
        turn = [np.roll(bench.shares() * np.eye(bench.width)[0], m, axis=1) for m in range(k)]
        if n_loads:
            for x in turn:
                x[:, k:] = bench.random(len(x) * bench.bench.sample_time, 0.5)[: len(x), None]
        alone = bench.holds() * np.append(1.0, np.zeros(bench.width - 1))
        yield "motion together", "together", bench.repeated(np.concatenate(turn), alone), []
        still = (np.arange(bench.width) != k - 1).astype(float)
        yield "one muscle", "resting", bench.repeated(still * bench.shares(), still * bench.holds()), []
    if n_loads:
        held = [np.column_stack([x[:, :k], np.full(len(x), 0.4)]) for x in (bench.shares(), bench.holds())]
        yield "other loads", "load", bench.repeated(*held), []


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("plants", nargs="*", default=list(PLANTS))
    parser.add_argument("--seeds", type=int, default=3)
    given = parser.parse_args()
    cases, named, others = Counter[str](), Counter[str](), dict[str, Counter[str]]()
    for plant in given.plants:
        for seed in range(given.seeds):
            for lacking, gap, runs, tests in planted(bench := Bench(plant, seed)):
                channels = (bench.bench.pressures, bench.bench.outputs)
                found = [one.what for one in data_gaps(runs, *channels, tests=tests)]
                cases[lacking] += 1
                named[lacking] += gap in found if gap else not found
                others.setdefault(lacking, Counter()).update(set(found) - {gap})
                if (gap not in found) if gap else found:
                    print("!", plant, seed, lacking, found)
    for lacking, count in cases.items():
        also = ", ".join(f"{what} {n}" for what, n in others[lacking].most_common())
        print(f"{lacking:20} {named[lacking]:3} of {count:3}   also: {also or '-'}")
    made = [lacking for lacking in cases if lacking != "nothing"]
    print(f"{sum(named[x] for x in made)} of {sum(cases[x] for x in made)} gaps are named")


if __name__ == "__main__":
    main()
