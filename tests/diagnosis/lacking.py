"""Recordings of virtual plants that lack one kind of excitation, and complete ones."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from mckibben import Recording
from mckibben.arrays import Array
from tests.plants import PLANTS, motions

LOADS = ("force", "torque")
"""Loads that models are told: a wall is there or not."""

Motion = Callable[[float, float], Array]
"""From seconds and a speed to samples from 0 to 1 of one channel."""

Case = tuple[str, str, list[Recording], list[Recording]]
"""What is left out, the gap that this makes (empty for none), recordings, and tests."""


class Recorder:
    """Records a plant under motion of each pressure and load, told from 0 to 1."""

    def __init__(self, plant: str, seed: int) -> None:
        self.plant, self.rng = PLANTS[plant](seed), np.random.default_rng(1000 + seed)
        bench = self.plant.bench
        self.step, self.pressures, self.outputs = bench.sample_time, bench.pressures, bench.outputs
        self.loads = [name for name in bench.loads if name in LOADS]
        self.width = len(self.pressures) + len(self.loads)
        self.ends = [(0.05 * bench.high, 0.95 * bench.high)] * len(self.pressures)
        for name in self.loads:
            recorded = np.concatenate([run[name] for run in self.plant.train])
            self.ends.append((float(recorded.min()), float(recorded.max())))

    def record(self, shares: Array) -> Recording:
        """Record motion, shape (n, width)."""
        low, high = np.transpose(self.ends)
        given, k = low + (high - low) * shares, len(self.pressures)
        bench = self.plant.bench
        loads = given[:, k:] if self.loads else np.zeros((len(given), len(bench.loads)))
        moved = self.plant.respond(given[:, :k], loads)
        seen, shown = (
            x + noise * self.rng.standard_normal(x.shape)
            for x, noise in zip((given[:, :k], moved), bench.noise, strict=True)
        )
        names = (*self.pressures, *self.loads, *self.outputs)
        columns = np.column_stack([seen, given[:, k:], shown]).T
        return Recording(dict(zip(names, columns, strict=True)), self.step)

    def random(self, seconds: float, speed: float) -> Array:
        """Move at random, in one of three ways."""
        kind = self.rng.integers(3)
        given = (self.rng, seconds, self.step, 0.0, 1.0)
        if kind == 0:
            return motions.wander(*given, (1.0 / speed, 4.0 / speed))
        if kind == 1:
            return motions.waves(*given, (0.05 * speed, 0.4 * speed))
        return motions.ramps(*given, (0.3 * speed, 0.6 * speed), 0.5)

    def at_one_speed(self, seconds: float, speed: float) -> Array:
        """Move between random levels at one speed."""
        return motions.ramps(self.rng, seconds, self.step, 0.0, 1.0, (0.4 * speed,) * 2, 0.1)

    def cycles(self, seconds: float, speed: float) -> Array:
        """Cycle over the whole range, with a period and a phase of its own."""
        time = self.step * np.arange(round(seconds / self.step))
        cycles = time * speed / self.rng.uniform(4.0, 7.0) + self.rng.uniform()
        return np.asarray(0.5 - 0.5 * np.cos(2 * np.pi * cycles))

    def moving(self, motion: Motion | None = None) -> Array:
        """Move everything slowly, and then fast."""
        parts = [
            [(motion or self.random)(seconds, speed) for _ in range(self.width)]
            for seconds, speed in ((45.0, 0.2), (25.0, 2.0))
        ]
        return np.concatenate([np.column_stack(part) for part in parts])

    def held(self, seconds: float = 15.0, count: int = 4) -> Array:
        """Hold everything at random levels."""
        levels = np.repeat(self.rng.uniform(0.1, 0.9, (count, self.width)), 2, axis=0)
        times = np.append(0.0, np.cumsum(np.tile([seconds, 1.0], count)))[:-1]
        time = np.arange(0.0, times[-1], self.step)
        return np.column_stack([np.interp(time, times, column) for column in levels.T])

    def complete(self, change: Callable[[Array], Array] = lambda shares: shares) -> list[Recording]:
        """Record motion at two speeds, the same again, and holds, each changed in some way."""
        moving, held = self.moving(), self.held()
        return [self.record(change(shares)) for shares in (moving, moving, held)]


def lacking(plant: str, seed: int) -> Iterator[Case]:
    """Give recordings of a plant that lack one kind of excitation after another; first, none."""
    own = Recorder(plant, seed)
    k, one = len(own.pressures), np.arange(own.width) == 0

    def every(name: str, gap: str, *shares: Array) -> Case:
        return name, gap, [own.record(x) for x in shares], []

    yield "nothing", "", own.complete(), []
    cycling, moving, held = own.moving(own.cycles), own.moving(), own.held()
    yield every("minor loops", "minor loops", cycling, cycling, held)
    slow = np.column_stack([own.at_one_speed(60.0, 1.0) for _ in range(own.width)])
    yield every("other speeds", "rate", slow, slow, held)
    yield every("holds", "creep", moving, moving)
    yield every("turning back", "hysteresis", np.sort(moving, axis=0))
    yield "the upper half", "range", own.complete(lambda x: 0.5 * x), [own.record(moving)]
    runs = own.complete()
    yield "time", "time", [Recording(dict(run.channels), None) for run in runs], []
    if own.width > 1:
        tied = own.complete(lambda x: np.repeat(x[:, :1], own.width, axis=1))
        yield "independent motion", "coupling", tied, []
    if k > 1:
        turns = [np.roll(one, m) * moving for m in range(own.width)]
        yield every("motion together", "together", np.concatenate(turns), one * held)
        yield "one muscle", "resting", own.complete(lambda x: x * ~one), []
    if own.loads:
        load = np.arange(own.width) == k
        yield "other loads", "load", own.complete(lambda x: np.where(load, 0.4, x)), []
