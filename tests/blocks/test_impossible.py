"""Saved models that cannot be computed with are refused as models: nesting, ranges, sizes, kinds."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from mckibben import Block, Channel, ModelError, Parallel, Series
from mckibben.blocks.compose import PerChannel
from mckibben.blocks.core import saving
from mckibben.blocks.core.composition import DEEPEST, MOST_BLOCKS
from mckibben.blocks.core.fields import MOST_COEFFICIENTS, MOST_NUMBERS
from mckibben.blocks.laws.trial import input_limits, wander
from mckibben.export.c.project import c_files
from mckibben.registry import load

SAMPLE_TIME = 0.01


def described(block: str, **changed: Any) -> dict[str, Any]:
    """Return an example as it is saved, some of its fields changed."""
    return {**load("blocks", block).example().to_dict(), **changed}


def refused(content: dict[str, Any], use: Callable[[Block], object] = lambda _: None) -> None:
    """Demand that a model is refused, by its name, when it is loaded or when it is used."""
    with pytest.raises(ModelError, match="Remedy:"):
        use(saving.from_dict(content))


def nested(depth: int, kind: str = "series", twice: bool = False) -> dict[str, Any]:
    """Return a model in so many compositions."""
    part = saving.part_to_dict(load("blocks", "pi").example())
    for _ in range(depth):
        part = {"kind": kind, "parts": [part, part] if twice else [part]}
    return {"format": saving.FORMAT, "version": saving.VERSION, **part}


def test_nesting_and_blocks_are_limited() -> None:
    for depth in (DEEPEST + 1, 100, 5000):
        refused(nested(depth))
    refused(nested(15, "parallel", twice=True))
    refused(nested(1, "series") | {"parts": [nested(0)] * MOST_BLOCKS})
    assert saving.from_dict(nested(8, "parallel", twice=True)).simulate([1.0]).shape == (1,)
    pi = load("blocks", "pi").example()
    block: Block = pi
    for _ in range(DEEPEST):
        block = Series((block,))
    with pytest.raises(ModelError, match=str(DEEPEST + 1)):
        Parallel((block,))


def test_scheduled_parts_deep_in_a_series_are_found() -> None:
    """What is kept of a composition's channels is what they are."""
    law = load("blocks", "chou-hannaford").example()
    block: Block = Series((load("blocks", "polynomial").example(), law))
    assert [channel.name for channel in block.inputs][1:] == ["pressure"]
    assert block.scheduling == ("pressure",)
    both = PerChannel(
        tuple(
            load("blocks", "pi")((0.0,), (1.0,), input=Channel(a, "bar"), output=Channel(b, "mm"))
            for a, b in (("p", "x"), ("q", "y"))
        )
    )
    assert [channel.name for channel in Series((both,)).inputs] == ["p", "q"]


RANGES = ((0.0, 5e-324), (0.0, 1e-300), (1.0, 1.0 + 2e-16), (-1e308, 1e308))
RANGED = sorted(
    {"bouc-wen", "duhem", "eupi", "generalized-bouc-wen", "gpi", "maxwell-slip", "pi", "polynomial"}
)


@pytest.mark.parametrize("kind", RANGED)
def test_ranges_too_narrow_or_wide_to_walk_through_are_refused(kind: str) -> None:
    for low, high in RANGES:
        refused(described(kind, input_range=[low, high]))


@pytest.mark.parametrize("kind", ["preisach", "krasnoselskii-pokrovskii"])
def test_levels_in_no_range_are_refused(kind: str) -> None:
    refused(described(kind, levels=[0.0, 5e-324], weights=[1.0]))


BEYOND: dict[str, tuple[dict[str, Any], Callable[[Block], object]]] = {
    "lags whose squares overflow": (
        described("process-model", time_constants=[1e200]),
        lambda block: block.simulate([1.0], sample_time=SAMPLE_TIME),
    ),
    "turns whose squares vanish": (
        described("chou-hannaford", turns=1e-300),
        lambda block: block.simulate([[1.0, 1.0]]),
    ),
    "terms that are no lists": (described("narx-polynomial", terms=[1.0, 2.0]), lambda _: None),
    "terms of terms": (described("narx-polynomial", terms=[[[1]]], weights=[1.0]), lambda _: None),
    "a term of a thousand factors": (
        described("narx-polynomial", terms=[[0] * 1000], weights=[1.0]),
        lambda _: None,
    ),
    "a polynomial of thousands": (
        described("polynomial", polynomial=[1.0] * (MOST_COEFFICIENTS + 1)),
        lambda _: None,
    ),
    "a filter of thousands": (
        described("transfer-function", denominator=[0.0] * (MOST_COEFFICIENTS + 1)),
        lambda _: None,
    ),
    "a million thresholds and more": (
        described("pi", thresholds=[0.0] * (MOST_NUMBERS + 1), weights=[0.0] * (MOST_NUMBERS + 1)),
        lambda _: None,
    ),
    "names of no kind": ({**described("pi"), 1: 2, None: 3}, lambda _: None),  # type: ignore[dict-item]
    "another group's kind in a part": (nested(1) | {"parts": [{"kind": "tanh"}]}, lambda _: None),
    "a time between steps of ages": (
        described("transfer-function", sample_time=1e49),
        lambda block: c_files(block),
    ),
    "a kind in other letters": (described("pi", kind="ＰＩ"), lambda _: None),
    "a kind with a mark": (described("pi", kind="pi\u200b"), lambda _: None),
}


@pytest.mark.parametrize("what", BEYOND)
def test_what_cannot_be_computed_with_is_refused_as_a_model(what: str) -> None:
    content, use = BEYOND[what]
    with np.errstate(all="ignore"):
        refused(content, use)


def test_a_start_hard_to_find_is_found() -> None:
    """A root near nothing in a wide range takes more steps than usual, and no error."""
    content = described("eupi", input_range=[-1000.0, 1e20], polynomial=[1.0, 1.0, 1.0])
    forward = saving.from_dict(content)
    target = float(forward.simulate([1.0])[0])
    assert np.isfinite(forward.inverse().simulate([target])).all()


def test_inputs_to_try_a_model_on_are_those_of_a_range_that_is_one() -> None:
    """The outputs of its forward block reach from end to end of all numbers."""
    forward = {"polynomial": [12.0, 1.7e308, 3.0, -4.0], "centre": 5.0, "input_range": [0.0, 10.0]}
    block = saving.from_dict(described("polynomial", scale=5.0, **forward)).inverse()
    low, high = input_limits(block)
    assert np.isfinite(high - low).all()
    assert np.isfinite(wander(low, high, np.random.default_rng(0), 3)).all()
