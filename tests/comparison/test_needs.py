"""Models by need: every model has a place, a full name, and is undone as it is said to be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import mckibben
from mckibben import Recording, registry
from mckibben.blocks.force.feedforward import compensator
from mckibben.comparison.channels import Channels
from mckibben.comparison.inverses import inverse_of
from mckibben.comparison.needs import full_name, inverse_kind, needs
from mckibben.comparison.offered import objections
from mckibben.errors import MckibbenError

FITTED = Path(__file__).parents[2] / "docs" / "models" / "fitted"


def test_every_model_is_for_one_thing() -> None:
    named = [model for need in needs() for model in need.models]
    assert sorted(named) == sorted(registry.names("estimators"))
    assert "Others" not in [need.title for need in needs()]


def test_full_names_are_unlike_and_longer() -> None:
    names = {full_name(model) for model in registry.names("estimators")}
    assert len(names) == len(registry.names("estimators"))
    assert all(full_name(model) != model for model in registry.names("estimators"))


def test_what_one_begins_with_is_among_its_kind() -> None:
    for need in needs():
        assert set(need.start) <= set(need.models)
        assert need.start


@pytest.mark.parametrize("model", registry.names("estimators"))
def test_models_are_undone_as_said(model: str) -> None:
    block = mckibben.load(FITTED / f"{model}.json")
    try:
        found = inverse_of(compensator(block))
    except MckibbenError:
        found = "none"
    assert inverse_kind(model) == found


def test_a_load_that_some_recordings_lack_is_an_objection_of_those_that_are_told_it() -> None:
    wave = np.sin(np.arange(200) / 10)
    known = Recording(
        {"pressure": wave, "displacement": wave, "force": wave}, 0.1, meta={"name": "a"}
    )
    runs = [known, known.select(["pressure", "displacement"]).with_meta(name="b")]
    found = objections(
        registry.names("estimators"), runs, Channels(("pressure",), ("displacement",))
    )
    assert {"pi", "balance"}.isdisjoint(found)
    assert found["coupled-memory"].startswith("it is told force, which b lacks")
