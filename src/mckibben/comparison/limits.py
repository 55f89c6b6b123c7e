"""What each model can and cannot represent, in words: ``limits.toml`` beside has an entry a model."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cache
from importlib.resources import files


@cache
def limits() -> Mapping[str, Mapping[str, str]]:
    """Return for every model what it can, what it cannot, and where there is one, a caution."""
    text = files("mckibben.comparison").joinpath("limits.toml").read_text("utf-8")
    return tomllib.loads(text)


def caution(model: str) -> str | None:
    """Return why a model is good only near what it was trained on, or None where nothing says so.

    A model that interpolates well may lead every ranking on motions like those of its training, and be
    far off elsewhere: that is told beside its errors.

    >>> caution("gpi") is None, caution("narx")
    (True, 'a polynomial of past values leaves all bounds beyond them')
    """
    return limits().get(model, {}).get("caution")
