"""Models on offer: each has a place, is undone as is said, and takes the settings that are its own."""

from __future__ import annotations

import sys
import types
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

import mckibben
from mckibben import ModelError, Recording, registry
from mckibben.blocks.force.feedforward import compensator
from mckibben.channels import channels_of
from mckibben.comparison.leaderboard import inverse_of
from mckibben.comparison.planning import Candidate, objections
from mckibben.errors import MckibbenError
from mckibben.estimators.catalogue import (
    declared,
    full_name,
    needs,
    settings_of,
    settings_of_all,
    summary,
)
from mckibben.estimators.core.estimator import Estimator, Purpose
from mckibben.estimators.hysteresis.pi import PIEstimator
from mckibben.parsers import setting
from tests.refusals import refused

FITTED = Path(__file__).parents[2] / "docs" / "models" / "fitted"
MODELS = registry.names("estimators")


def test_every_model_is_for_one_thing_and_has_a_name_of_its_own() -> None:
    assert sorted(model for need in needs() for model in need.models) == sorted(MODELS)
    assert len({full_name(model) for model in MODELS}) == len(MODELS)
    for need in needs():
        quick = [declared(model).quick for model in need.models]
        assert quick[0]
        assert quick == sorted(quick, reverse=True)


@pytest.mark.parametrize("model", MODELS)
def test_a_model_declares_what_it_is(model: str) -> None:
    estimator = declared(model)
    assert estimator.purpose in get_args(Purpose)
    assert estimator.cannot
    assert estimator.param_grid.keys() <= estimator().get_params().keys()


def test_a_plug_in_that_declares_nothing_is_listed_under_its_name(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    silent = types.new_class("Silent", (PIEstimator,), {})
    for name in ("title", "purpose", "can", "quick", "makes"):
        setattr(silent, name, getattr(Estimator, name))
    silent.__doc__ = "A model of mine."
    outside = types.ModuleType("outside")
    outside.silent = silent  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "outside", outside)
    entries = [
        EntryPoint(name, f"outside:{name}", "mckibben.estimators") for name in ("silent", "no")
    ]
    monkeypatch.setattr(registry, "entry_points", lambda group: entries)
    registry._locations.cache_clear()
    try:
        assert set(needs()[-1].models) == {"no", "silent"}
        assert summary("silent") == "silent. A model of mine."
    finally:
        registry._locations.cache_clear()


@pytest.mark.parametrize("model", MODELS)
def test_models_are_undone_as_said(model: str) -> None:
    block = mckibben.load(FITTED / f"{model}.json")
    try:
        found = inverse_of(compensator(block))
    except MckibbenError:
        found = "none"
    assert declared(model).inverse_kind.removesuffix(" where stable") == found


def test_a_load_that_some_recordings_lack_is_an_objection_of_those_that_are_told_it() -> None:
    wave = np.sin(np.arange(200) / 10)
    channels = dict.fromkeys(("pressure", "displacement", "force"), wave)
    known = Recording(channels, 0.1, meta={"name": "a"})
    runs = [known, known.select(["pressure", "displacement"]).with_meta(name="b")]
    found = objections({name: Candidate(name) for name in MODELS}, runs, channels_of(runs))
    assert {"pi", "balance"}.isdisjoint(found)
    assert "force" in found["coupled-memory"]


def test_settings_of_another_model_are_refused() -> None:
    for name in ("gpi", "pii"):
        with refused(ModelError, parameter=f"{name}.seed"):
            settings_of("pi", {f"{name}.seed": 3})


def test_settings_are_of_one_model_or_nested() -> None:
    given = {"n_operators": 7, "nonnegative": False, "initial": "virgin", "pi.seed": 3}
    read = {"n_operators": 7, "nonnegative": False, "initial": "virgin", "seed": 3}
    assert settings_of("pi", given) == read
    assert settings_of("pi", {"pi": read}) == read
    assert setting("thresholds=[0,0.5]") == ("thresholds", (0, 0.5))
    with pytest.raises(ValueError):
        setting("n_operators")


def test_a_bare_setting_goes_to_the_models_that_have_it() -> None:
    other = registry.load("estimators", "bouc-wen")
    both = {"pi": PIEstimator, "bouc-wen": other}
    found = settings_of_all(both, {"n_operators": 7, "bouc-wen.seed": 3})
    assert found == {"pi": {"n_operators": 7}, "bouc-wen": {"seed": 3}}
    with refused(ModelError, parameter="n_operators"):
        settings_of_all({"bouc-wen": other}, {"n_operators": 7})
