"""Every block: batch, stream, starts, many at once, inverse, reachable range, saved JSON."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

import mckibben
from mckibben import GPI, Block, ModelError, Recording
from mckibben.registry import load, names
from tests.golden.case import Case, Tree
from tests.golden.models import all_models, inputs_of
from tests.golden.running import (
    SAMPLE_TIME,
    Array,
    inverted,
    refused,
    same,
    scheduling_of,
    simulated,
    stored,
    streamed,
)

EVERY, SELDOM = 3, 6
"""Of a run, every so many samples are stored, and the sum of all; fewer of what is much like another."""

models = cache(all_models)


def recorded(model: Block, inputs: Array) -> Recording | None:
    """Return inputs as a recording, which cannot hold what is absent."""
    if not np.isfinite(inputs).all():
        return None
    return Recording(
        {c.name: column for c, column in zip(model.inputs, inputs.T, strict=True)},
        SAMPLE_TIME,
        units={c.name: c.unit for c in model.inputs},
    )


def halves(model: Block, inputs: Array, outputs: Array) -> bool | None:
    """Tell whether a run in two parts, the second from the state after the first, is one run."""
    half = len(inputs) // 2
    before = recorded(model, inputs[:half])
    if before is None:
        return None
    state = model.final_state(before).tolist()
    return same(simulated(model, inputs[half:], state), outputs[half:])


def other_starts(model: Block, inputs: Array) -> Tree:
    if not model.n_states:
        return "no memory"
    try:
        return simulated(model, inputs, "virgin")[::SELDOM]
    except ModelError as error:
        return refused(error)


def many(model: Block, inputs: Array) -> Tree:
    """Return runs of two parameter sets at once; of one, where the other makes no model."""
    own = model.pack()
    sets = [own, own * 1.01]
    for rows in (sets, sets[:1]):
        try:
            outputs = model.simulate_many(rows, inputs, sample_time=SAMPLE_TIME)
        except ModelError:
            continue
        return outputs.reshape(len(rows), len(inputs), -1)[:, ::SELDOM]
    return "none"


def reference(model: Block, inputs: Array, name: str) -> Array:
    """Return what an inverse is to follow: all that is reachable, or what the model once did."""
    wanted = simulated(model, inputs_of(name, model, seed=10))
    low, high = model.reachable()
    if len(low) == 1 and not model.rate_dependent and np.isfinite([*low, *high]).all():
        span = np.ptp(wanted, axis=0)
        shape = (wanted - wanted.min(axis=0)) / np.where(span > 0, span, 1.0)
        wanted = low + (0.02 + 0.96 * shape) * (high - low)
    return np.column_stack([wanted, scheduling_of(model, inputs)])


def answers(name: str, folder: Path) -> Tree:
    """Return all that a model answers."""
    model = models()[name]
    inputs = inputs_of(name, model)
    outputs = simulated(model, inputs)
    model.save(folder / "model.json")
    low, high = model.reachable()
    channels: dict[str, Any] = {
        "inputs": [f"{c.name} [{c.unit}]" for c in model.inputs],
        "outputs": [f"{c.name} [{c.unit}]" for c in model.outputs],
        "scheduling": list(model.scheduling),
    }
    return channels | {
        "json": json.dumps(model.to_dict()),
        "saved": same(simulated(mckibben.load(folder / "model.json"), inputs), outputs),
        "simulated": stored(outputs, EVERY),
        "stream is batch": same(streamed(model, inputs), outputs),
        "halves are one run": halves(model, inputs, outputs),
        "virgin": other_starts(model, inputs),
        "many": many(model, inputs),
        "reachable": np.array([low, high]),
        "inverse": inverted(model, reference(model, inputs, name), EVERY),
    }


def resumed(folder: Path) -> Tree:
    """Return for every model whether its final state, an array, is taken as the next start."""
    del folder
    taken: dict[str, Tree] = {}
    for name, model in models().items():
        inputs = inputs_of(name, model)
        before = recorded(model, inputs)
        if before is not None and model.n_states:
            state = model.final_state(before)
            try:
                outputs = simulated(model, inputs, state)
            except ValueError as error:  # NumPy's
                taken[name] = refused(error)
            else:
                taken[name] = same(outputs, simulated(model, inputs, state.tolist()))
    return taken


def envelope(kind: str, folder: Path) -> Tree:
    """Return both envelopes of a kind over their inputs, and the way back, as one operator has them."""
    del folder
    rising, falling = load("envelopes", kind).examples()
    model = GPI((0.0,), (1.0,), input_range=(0.0, 5.0), rising=rising, falling=falling)
    up = np.linspace(0.0, 5.0, 41)
    outputs = simulated(model, np.concatenate([up, up[::-1]])[:, np.newaxis])
    return {
        "json": json.dumps(model.to_dict()),
        "outputs": outputs,
        "back": simulated(model.inverse(), outputs),
        "reachable": np.array(model.reachable()),
    }


def cases() -> Iterator[Case]:
    """Yield a case for every model, and for each envelope, and one on the starts of all."""
    yield Case("blocks/resumed", "simulate(inputs, initial=final_state(recording))", resumed)
    for kind in names("envelopes"):
        yield Case(f"blocks/envelope-{kind}", f"GPI with {kind} alone", partial(envelope, kind))
    for name in models():
        yield Case(
            f"blocks/{name.replace(',', '').replace(' ', '-').lower()}",
            f"{name}: simulate, stream, simulate_many, inverse, reachable, save, load",
            partial(answers, name),
        )
