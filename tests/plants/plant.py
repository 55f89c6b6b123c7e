"""What every virtual plant offers: recordings to fit, recordings to check, and its own true answer.

The plants are written from textbook physics alone and know no model of the package. They say in
``facts`` what is truly so, where all pressures are `Bench.middle` and the load is `Bench.load`:

================================  ================================================================
``identical_muscles``             bool
``friction_share``                share of the whole dry friction in every muscle
``friction``                      dry friction of every muscle that slides slowly [N], of what bends
                                  [N m]; the mean of both ways
``friction_ratio``                of friction on the way back to that there, where they differ
``friction_grows_with_pressure``  bool
``static_stiffness``              of the elastic parts, at every muscle's end [N/mm], of what bends
                                  [N m/rad]
``loop_width``                    of the first output where its own pressure moves slowly, by
                                  friction and stiffness alone
``relaxation_times``              of the rubber [s]; empty where it does not relax
``dead_zone``                     pressure below which a muscle does not pull [bar]
``lifts_from``                    pressure from which the output of an empty muscle moves [bar]
``line_lag``                      from the recorded pressure to the muscle, for small steps [s]
``one_session``                   whether all runs are stretches of one, told where it is so
================================  ================================================================
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any, NamedTuple, Protocol

import numpy as np

from mckibben import Recording
from mckibben.arrays import Array

Fact = float | bool | tuple[float, ...]


class Motion(NamedTuple):
    """A motion of a plant that happens as its outputs are taken, sample by sample, noise-free.

    ``commands`` are those of all samples, shape (n, n_pressures). Each may be written until the output
    of its sample is taken, so that a loop can be closed.
    """

    commands: Array
    outputs: Iterator[Any]

    def answered(self) -> Array:
        """Return all outputs, shape (n, n_outputs)."""
        return np.array(list(self.outputs), dtype=np.float64).reshape(len(self.commands), -1)


def after(lead: int, commands: Array, outputs: Iterator[Any]) -> Motion:
    """Return a motion whose lead is over."""
    for _ in range(lead):
        next(outputs)
    return Motion(commands[lead:], outputs)


Move = Callable[[Array, Array], Motion]
"""From pressures (n, n_muscles) [bar] and loads (n, n_loads) to a motion.

How muscles are found is the plant's to say: vented, or filled to the first pressure and left alone.
"""

Runs = tuple[tuple[Recording, ...], Mapping[str, tuple[Recording, ...]]]
"""To fit, and to check by kind of motion."""


class Record(Protocol):
    """Lets a plant move, and returns what sensors see of it; a load is one number or a column."""

    def __call__(self, name: str, pressures: Array, load: float | Array = 0.0) -> Recording: ...


@dataclass(frozen=True)
class Bench:
    """Channels that are recorded, and how often [s].

    `high` is the highest pressure that is commanded [bar]. `noise` is that of pressures and of
    outputs, each a standard deviation. `load` is what the facts are told at.
    """

    pressures: tuple[str, ...]
    loads: tuple[str, ...]
    outputs: tuple[str, ...]
    sample_time: float
    high: float
    noise: tuple[float, float]
    load: float = 0.0

    @property
    def middle(self) -> float:
        """Pressure at mid-range [bar]."""
        return 0.5 * self.high

    def allowed(self, commands: Array) -> Array:
        """Return what a regulator makes of commands: none below zero or far above the highest."""
        return np.ascontiguousarray(np.clip(commands, 0.0, 1.25 * self.high))


@dataclass(frozen=True)
class Plant:
    """One virtual plant: ``train`` to fit, ``test`` by kind of motion, ``move`` as the truth."""

    name: str
    title: str
    bench: Bench
    train: tuple[Recording, ...]
    test: Mapping[str, tuple[Recording, ...]]
    move: Move
    facts: Mapping[str, Fact]

    def respond(self, pressures: Array, loads: Array) -> Array:
        """Return the outputs, shape (n, n_outputs), of a motion."""
        return self.move(pressures, loads).answered()


def numbered(name: str, count: int) -> tuple[str, ...]:
    """Return the channels of several muscles."""
    return tuple(f"{name}_{number + 1}" for number in range(count))


def one_muscle(friction: float, stiffness: float, **others: Fact) -> dict[str, Fact]:
    """Return the facts of one muscle, of which most are usual if they are not told."""
    usual: dict[str, Fact] = {
        "identical_muscles": True,
        "friction_share": (1.0,),
        "friction": (friction,),
        "friction_grows_with_pressure": False,
        "static_stiffness": (stiffness,),
        "loop_width": 2 * friction / stiffness,
        "relaxation_times": (),
        "dead_zone": 0.0,
        "line_lag": 0.0,
    }
    return usual | others


def drawn(name: str, seed: int) -> Plant:
    """Return a plant of this folder with its runs, each drawn anew from ``seed``.

    Its module has ``BENCH``, ``move``, ``facts()`` and ``runs(rng, record)``.
    """
    module, rng = import_module(f"tests.plants.{name}"), np.random.default_rng(seed)
    bench: Bench = module.BENCH

    def record(name: str, pressures: Array, load: float | Array = 0.0) -> Recording:
        pressures = pressures.reshape(len(pressures), -1)
        loads = np.broadcast_to(np.reshape(load, (-1, 1)), (len(pressures), len(bench.loads)))
        outputs = module.move(pressures, loads).answered()
        seen, shown = (
            samples + noise * rng.standard_normal(samples.shape)
            for samples, noise in zip((pressures, outputs), bench.noise, strict=True)
        )
        names = bench.pressures + bench.loads + bench.outputs
        channels = dict(zip(names, np.column_stack([seen, loads, shown]).T, strict=True))
        return Recording(channels, bench.sample_time, meta={"name": name, "rig": "(virtual)"})

    train, test = module.runs(rng, record)
    title = (module.__doc__ or "").partition(".\n")[0]
    return Plant(name, title, bench, train, test, module.move, module.facts())
