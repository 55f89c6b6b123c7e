"""Saved models that cannot be computed with are refused as models: nesting, ranges, sizes, kinds."""

from __future__ import annotations

from typing import Any

import pytest

from mckibben import ModelError
from mckibben.blocks import saving
from mckibben.blocks.base import FORMAT, VERSION
from mckibben.blocks.fields import MOST_COEFFICIENTS, MOST_NUMBERS
from mckibben.blocks.parameters import plain
from mckibben.registry import load


def described(block: str, **changed: Any) -> dict[str, Any]:
    """Return an example as it is saved, some of its fields changed."""
    return {**load("blocks", block).example().to_dict(), **changed}


def refused(content: dict[str, Any]) -> None:
    with pytest.raises(ModelError):
        saving.from_dict(content)


def nested(depth: int, kind: str = "series", twice: bool = False) -> dict[str, Any]:
    """Return a model in so many compositions."""
    part = plain(load("blocks", "pi").example())
    for _ in range(depth):
        part = {"kind": kind, "parts": [part, part] if twice else [part]}
    return {"format": FORMAT, "version": VERSION, **part}


def test_nesting_too_deep_is_refused() -> None:
    refused(nested(5000))
    assert saving.from_dict(nested(8, "parallel", twice=True)).simulate([1.0]).shape == (1,)


RANGES = ((0.0, 5e-324), (0.0, 1e-300), (1.0, 1.0 + 2e-16), (-1e308, 1e308))
RANGED = sorted(
    {"bouc-wen", "duhem", "eupi", "generalized-bouc-wen", "gpi", "maxwell-slip", "pi", "polynomial"}
)


@pytest.mark.parametrize("kind", RANGED)
def test_ranges_too_narrow_or_wide_to_walk_through_are_refused(kind: str) -> None:
    for low, high in RANGES:
        refused(described(kind, input_range=[low, high]))


TOO_MANY = [0.0] * (MOST_NUMBERS + 1)
BEYOND: dict[str, dict[str, Any]] = {
    "terms that are no lists": described("narx-polynomial", terms=[1.0, 2.0]),
    "terms of terms": described("narx-polynomial", terms=[[[1]]], weights=[1.0]),
    "a term of a thousand factors": described("narx-polynomial", terms=[[0] * 1000], weights=[1.0]),
    "a long polynomial": described("polynomial", polynomial=[1.0] * (MOST_COEFFICIENTS + 1)),
    "a long filter": described("transfer-function", denominator=[0.0] * (MOST_COEFFICIENTS + 1)),
    "a million thresholds and more": described("pi", thresholds=TOO_MANY, weights=TOO_MANY),
    "levels in no range": described("preisach", levels=[0.0, 5e-324], weights=[1.0]),
    "another group's kind in a part": nested(1) | {"parts": [{"kind": "tanh"}]},
    "a kind in other letters": described("pi", kind="ＰＩ"),
    "a kind with a mark": described("pi", kind="pi\u200b"),
}


@pytest.mark.parametrize("what", BEYOND)
def test_what_cannot_be_computed_with_is_refused_as_a_model(what: str) -> None:
    refused(BEYOND[what])
