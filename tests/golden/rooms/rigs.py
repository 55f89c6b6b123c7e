"""Virtual rigs: what they record by seed, their parameters, and the environments made of them."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from mckibben import Recording, Rig, load_rig, rigs
from tests.golden.case import Case, Tree
from tests.golden.models import path
from tests.golden.running import same, stored

DURATION = 3.0
N_STORED = 40

CHANGED: dict[str, dict[str, Any]] = {
    "antagonistic-joint": {"payload": 1.0, "muscle_2.c10": 0.2},
    "mas10-test-stand": {"muscle.c10": 0.2},
    "mas20-hanging": {"payload": 10.0},
    "mckibben-530": {"muscle.c10": 0.2},
    "rail": {"payload": 3.0},
    "soft-arm": {"payload": 0.5, "contact": 0.2},
    "two-section-arm": {"payload": 0.5, "proximal.contact": 0.2, "distal.muscle.c10": 0.3},
}
"""Parameters that are changed, of each."""


def commands(rig: Rig, seed: int = 0) -> Recording:
    """Return commands over the range of every input, one of them beyond it for a while."""
    n = round(DURATION / rig.sample_time)
    instants = np.linspace(0.0, 149.0, n)
    channels = {}
    for place, name in enumerate(rig.inputs):
        limits = rig.limits(name)
        shape = np.interp(instants, np.arange(150), path(seed + place, 150))
        channels[name] = limits.low + (limits.high - limits.low) * (1.04 * shape)
    return Recording(channels, rig.sample_time, meta={"note": "commands"})


def traces(recording: Recording) -> dict[str, Tree]:
    """Return every channel, and its unit."""
    every = max(len(recording) // N_STORED, 1)
    return {
        f"{name} [{recording.units[name]}]": stored(recording[name][:, np.newaxis], every)
        for name in recording.channels
    }


def stepped(rig: Rig, seed: int) -> Tree:
    """Return measurements of a rig that is driven step by step, by arrays and by names."""
    given = commands(rig)
    every = max(len(given) // 100, 1)
    rows = given.matrix(rig.inputs)[::every]
    found = [rig.reset(seed)]
    found += [rig.step(row) for row in rows[:60]]
    found += [rig.step({rig.inputs[0]: row[0]}) for row in rows[60:]]
    return stored(np.array(found), 4) | {"saturated": dict(rig.saturated)}


def plain(value: Any) -> Tree:
    """Return what a file holds as a tree."""
    if isinstance(value, Mapping):
        return {key: plain(part) for key, part in value.items() if key not in ("title", "source")}
    return [plain(part) for part in value] if isinstance(value, list) else value


def described(rig: Rig) -> Tree:
    """Return the parameters in a rig's file."""
    return plain(tomllib.loads(rigs.describe(rig)))


def meta(recording: Recording) -> Tree:
    return plain({key: value for key, value in recording.meta.items() if key != "note"})


def answers(name: str, folder: Path) -> Tree:
    """Return what a rig records, one way and another."""
    rig = load_rig(name)
    rigs.save_rig(rig, folder / "rig.toml")
    given = commands(rig)
    first, other = rig.run(given, seed=1), rig.run(given, seed=2)
    measured = [n for n in first.channels if n in rig.outputs]
    return {
        "parameters": described(rig),
        "file is rig": load_rig(folder / "rig.toml") == rig,
        "seed 1": traces(first),
        "meta": meta(first),
        "again": all(same(first[n], rig.run(given, seed=1)[n]) for n in first.channels),
        "another seed differs": [n for n in measured if not np.array_equal(first[n], other[n])],
        "ideal": traces(rig.run(given, ideal=True)),
        "held": traces(rig.run(given, seed=1, held=True)),
        "steps": stepped(rig, 3),
        "changed": traces(rig.changed(CHANGED[name]).run(given, seed=1)),
        "aged": traces(rig.aged({"stiffness": 1.1, "friction": 1.3}).run(given, seed=1)),
    }


def protocol_run(folder: Path) -> Tree:
    """Return a run of a printed protocol on another rig than its own."""
    del folder
    rig = load_rig("mas20-hanging").changed({"payload": 5.0})
    [(run, recording)] = rigs.record("field-models", rig, runs=["irregular-triangle"], seed=5)
    return {"run": run.name, "meta": meta(recording), "recorded": traces(recording)}


def environment(folder: Path) -> Tree:
    """Return an episode of the environments of a rig and of a changed one."""
    del folder
    import gymnasium

    import mckibben.environments  # registers them

    made = {
        "mas20-hanging": gymnasium.make("mckibben/mas20-hanging-v2"),
        "preview": mckibben.environments.Tracking("mas20-hanging", duration=2.0, preview=2),
    }
    found: dict[str, Tree] = {}
    for name, env in made.items():
        first, _ = env.reset(seed=4)
        rows, rewards = [first], []
        for action in 2 * path(0, 20) - 1:
            row, reward, *_ = env.step(np.array([action], dtype=np.float32))
            rows.append(row)
            rewards.append(float(reward))
        found[name] = {"observations": np.array(rows)[::4], "rewards": np.array(rewards)}
    return found


def cases() -> Iterator[Case]:
    """Yield a case for every published rig, and for rigs made of them."""
    for name in rigs.rig_names():
        yield Case(f"rigs/{name}", f"{name}: run, step, changed, aged", partial(answers, name))
    yield Case("rigs/protocol", "record('field-models', rig, runs=..., seed=5)", protocol_run)
    yield Case("rigs/environments", "gymnasium.make(...), reset, step", environment)
