"""Fuzz saved models: damaged ones are loaded, and used in every way if they load.

    python benchmarks/fuzz_models.py --seconds 60 --seed 0

Every example of a registered block is damaged in its values, types, nesting and text. What follows
must end, soon and in little memory, well or in an error that this package raises on purpose.
"""

from __future__ import annotations

import copy
import json
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import fuzzing
from mckibben import Block, check_block
from mckibben.blocks.base import run_many
from mckibben.blocks.compose import Series
from mckibben.blocks.laws import examples, trial_limits, wander
from mckibben.blocks.parameters import plain
from mckibben.blocks.saving import load
from mckibben.errors import MckibbenError
from mckibben.exporting.c.project import c_files
from mckibben.exporting.fmu.unit import fmu_files
from mckibben.recording import Recording
from mckibben.registry import load as load_plugin
from mckibben.registry import names

SAMPLE_TIME = 0.01

NUMBERS: tuple[Any, ...] = (
    0,
    -1,
    0.5,
    3,
    1e308,
    -1e308,
    1e154,
    5e-324,
    1e-300,
    1e16,
    2**63,
    10**400,
)
OTHERS: tuple[Any, ...] = (
    True,
    None,
    "",
    "1.0",
    "nan",
    "virgin",
    "\x00",
    "\ud800",
    [],
    {},
    [[]],
    [None],
)


def grounds() -> list[dict[str, Any]]:
    """Return what is damaged: examples of every block, the envelopes in one, and compositions."""
    blocks: list[Block] = list(examples().values())
    gpi, pi = load_plugin("blocks", "gpi").example(), load_plugin("blocks", "pi").example()
    for kind in names("envelopes"):
        rising, falling = load_plugin("envelopes", kind).examples()
        blocks.append(replace(gpi, rising=rising, falling=falling))
        blocks.append(blocks[-1].inverse())
    blocks.append(Series((pi, pi.inverse(), Series((pi, gpi)))))
    return [block.to_dict() for block in blocks]


GROUNDS = grounds()
PARTS = [{k: v for k, v in d.items() if k not in ("format", "version")} for d in GROUNDS]

Rng = np.random.Generator
Place = tuple[Any, Any]
"""A container and a key or index in it."""


def places(content: Any) -> Iterator[Place]:
    """Give every place in nested dicts and lists."""
    keys = content if isinstance(content, dict) else range(len(content))
    for key in list(keys):
        yield content, key
        if isinstance(content[key], dict | list):
            yield from places(content[key])


def is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _any(rng: Rng, content: Any, where: Callable[[Any], bool] = lambda _: True) -> Place | None:
    found = [place for place in places(content) if where(place[0][place[1]])]
    return found[rng.integers(len(found))] if found else None


def numbers(rng: Rng, content: Any) -> None:
    """Set a number to an odd one, or change it a little or much."""
    if place := _any(rng, content, is_number):
        inside, key = place
        value = float(inside[key]) if abs(inside[key]) < 1e300 else 1.0
        odd = NUMBERS[rng.integers(len(NUMBERS))]
        changed = (odd, value * float(10.0 ** rng.integers(-20, 20)), -value, value + rng.normal())
        inside[key] = changed[rng.integers(4)]


def lists(rng: Rng, content: Any) -> None:
    """Cut, repeat, turn, mix or scale a list."""
    if place := _any(rng, content, lambda v: isinstance(v, list)):
        inside, key = place
        values = inside[key]
        factor = float(10.0 ** rng.integers(-320, 300))
        inside[key] = (
            values[: rng.integers(len(values) + 1)],
            values * 2,
            values[::-1],
            [values[i] for i in rng.permutation(len(values))],
            [min(abs(v), 1e300) * factor if is_number(v) else v for v in values],
        )[rng.integers(5)]


def kinds(rng: Rng, content: Any) -> None:
    """Put anything in the place of something, or another block in the place of one; or take it out."""
    if place := _any(rng, content):
        inside, key = place
        if isinstance(inside[key], dict) and "kind" in inside[key]:
            inside[key] = copy.deepcopy(PARTS[rng.integers(len(PARTS))])
        elif rng.random() < 0.7:
            inside[key] = copy.deepcopy(OTHERS[rng.integers(len(OTHERS))])
        else:
            del inside[key]


def nesting(rng: Rng, content: Any) -> None:
    """Put the whole into compositions, once or many times."""
    own = {k: content.pop(k) for k in list(content) if k not in ("format", "version")}
    for _ in range(int(10 ** rng.uniform(0, 2.3))):
        own = {"kind": ["series", "parallel", "per-channel"][rng.integers(3)], "parts": [own]}
    content.update(own)


DAMAGES = (*(numbers,) * 5, lists, lists, lists, kinds, kinds, nesting)


def damaged(rng: Rng) -> str:
    """Return the text of a damaged model."""
    content = copy.deepcopy(GROUNDS[rng.integers(len(GROUNDS))])
    for _ in range(rng.choice([1, 1, 1, 2, 3])):
        DAMAGES[rng.integers(len(DAMAGES))](rng, content)
        if not content:
            break
    text = json.dumps(content)
    if rng.random() < 0.05:
        at = int(rng.integers(len(text)))
        text = text[:at] + str(rng.choice(["", "[", "}", "9", "e9", "\\u", '"'])) + text[at + 1 :]
    return text


def uses(block: Block, rng: Rng) -> Iterator[Callable[[], object]]:
    """Give everything that one can do with a model."""
    n = len(block.inputs)
    step = SAMPLE_TIME if block.sample_time is None else block.sample_time
    usual = rng.uniform(0.0, 5.0, (30, n))
    yield lambda: (block.n_states, block.n_scratch, block.parameter_names, block.rate_dependent)
    yield lambda: load_again(block)
    yield lambda: block.unpack(block.pack())
    yield block.reachable
    yield lambda: block.passes(np.zeros(n), np.ones(n))
    for initial in (None, "first_sample", "virgin", [0.0] * min(block.n_states, 1000)):
        yield partial(block.simulate, usual, sample_time=step, initial=initial)
    yield lambda: block.simulate(wander(*trial_limits(block), rng, 3, 8), sample_time=step)
    yield lambda: run_many([block, block], usual, sample_time=step)
    yield lambda: recorded(block, usual, step)
    yield lambda: streamed(block, usual, step, rng)
    yield lambda: inverted(block, usual, step)
    for single in (False, True):
        yield partial(c_files, block, sample_time=step, single=single)
    yield lambda: fmu_files(block, sample_time=step)
    if rng.random() < 0.2 and block.n_states < 1000:
        yield lambda: check_block(block, sample_time=step)


def load_again(block: Block) -> None:
    with tempfile.TemporaryDirectory() as place:
        block.save(Path(place) / "again.json")
        if load(Path(place) / "again.json") != block:
            raise AssertionError("a saved and loaded copy is another model")


def recorded(block: Block, inputs: Any, step: float) -> None:
    columns = {c.name: column for c, column in zip(block.inputs, inputs.T, strict=True)}
    units = {c.name: c.unit for c in block.inputs}
    recording = Recording(columns, step, units)
    block.final_state(recording)
    block.simulate(recording)


def streamed(block: Block, inputs: Any, step: float, rng: Rng) -> None:
    stream = block.stream(step)
    for row in inputs:
        if rng.random() < 0.2:
            row = row * rng.choice([np.nan, np.inf, 1e300, 5e-324, -1e100])
        if not np.isfinite(stream.step(row)).all():
            raise AssertionError("a step's outputs are not finite")


def inverted(block: Block, inputs: Any, step: float) -> None:
    inverse = block.inverse()
    outputs = block.simulate(inputs, sample_time=step)
    n = len(block.inputs) - len(block.scheduling)
    inverse.simulate(np.column_stack([outputs, inputs[:, n:]]), sample_time=step)
    inverse.reachable()
    plain(inverse)


SEED = [0]


def attempt(number: int) -> None:
    """Damage a model, load it, and use it if it loads."""
    rng = np.random.default_rng([SEED[0], number])
    text = damaged(rng)
    with tempfile.TemporaryDirectory() as place, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        path = Path(place) / "model.json"
        path.write_text(text, encoding="utf-8")
        try:
            block = load(path)
        except MckibbenError:
            return
        for use in uses(block, rng):
            try:
                use()
            except MckibbenError:
                continue


if __name__ == "__main__":
    sys.exit(
        fuzzing.main(attempt, __doc__.splitlines()[0], seed=lambda seed: SEED.__setitem__(0, seed))
    )
