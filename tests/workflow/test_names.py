"""Names that are guessed lead to names that there are."""

from __future__ import annotations

import re
from dataclasses import fields
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from docs.making import keywords

import mckibben
from mckibben import GPI, Fit, ModelError, Recording, fit, options
from mckibben.hints import BLOCK, KEYWORDS, MODULE, RECORDING, RESULT

U = 2.5 + 2.5 * np.sin(np.arange(400) / 20) * np.linspace(1.0, 0.3, 400)
RUN = Recording({"pressure": U, "displacement": 3.0 * U}, 0.05)

THINGS: list[tuple[Any, dict[str, str]]] = [
    (mckibben, MODULE),
    (RUN, RECORDING),
    (GPI.example(), BLOCK),
]


@pytest.mark.parametrize(("thing", "hints"), THINGS)
def test_hints_name_what_there_is(thing: Any, hints: dict[str, str]) -> None:
    for guess, hint in hints.items():
        if isinstance(getattr(thing, guess, None), ModuleType):
            continue  # a package that something has imported
        assert not hasattr(thing, guess), guess
        with pytest.raises(AttributeError, match=re.escape(hint)):
            getattr(thing, guess)
        for name in re.findall(r"(?:mckibben|run)\.([a-z_]+)", hint):
            owner = RUN if f"run.{name}" in hint else mckibben
            assert hasattr(owner, name), (guess, hint)
    first = [re.split(r"\W", hint)[0] for hint in hints.values()]
    known = {"run", "recording", "model", "mckibben", "a", "len", "list", "print", "1"}
    assert all(name in known or hasattr(thing, name) for name in first)


def test_what_a_fit_has_not_leads_to_what_it_has() -> None:
    found: Fit = fit("pi", RUN)
    for guess in RESULT:
        if not hasattr(found, guess):
            with pytest.raises(AttributeError, match="Use "):
                getattr(found, guess)


def test_hints_of_keywords_are_options() -> None:
    every = {one.name for kind in vars(options).values() if hasattr(kind, "__dataclass_fields__")
             and isinstance(kind, type) for one in fields(kind)}  # fmt: skip
    assert set(KEYWORDS.values()) <= every | {"model", "out", "force", "progress"}
    given: Any = {"fs": 20.0}
    with pytest.raises(ModelError) as caught:
        fit("pi", RUN, **given)
    assert "rate" in caught.value.remedy


def test_types_of_keywords_are_those_of_the_options() -> None:
    """Made again by ``python -m docs.making.keywords`` where the options changed."""
    assert keywords.PLACE.read_text(encoding="utf-8") == keywords.text()
