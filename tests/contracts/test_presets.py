"""A preset is its class with settings chosen, whoever defines it."""

from __future__ import annotations

import sys
import types
from collections.abc import Iterator
from dataclasses import fields
from importlib.metadata import EntryPoint
from inspect import isabstract, unwrap
from typing import Any

import pytest
from sklearn.base import clone

import mckibben.registry
from mckibben import PIEstimator
from mckibben.estimators.core.estimator import Estimator
from mckibben.presets import Chosen, preset
from mckibben.registry import PLUGINS, load, names

PRESETS = [
    (group, name)
    for group in PLUGINS
    for name in PLUGINS[group]
    if isinstance(load(group, name), Chosen)
]


@pytest.mark.parametrize(("group", "name"), PRESETS)
def test_a_preset_makes_its_class_with_its_settings(group: str, name: str) -> None:
    chosen = load(group, name)
    made = chosen()
    assert type(made) is unwrap(chosen)
    assert {field.name: field.default for field in fields(chosen)} == made.get_params()
    assert clone(made).get_params() == made.get_params()
    assert chosen.settings.items() <= made.get_params().items()
    assert chosen(seed=3).get_params() == made.get_params() | {"seed": 3}


def test_settings_override_those_of_a_preset_and_others_are_refused_by_its_name() -> None:
    p2 = load("estimators", "p2")
    assert p2(structure="P3").structure == "P3"
    assert p2().structure == "P2"
    with pytest.raises(TypeError, match=r"'p2' has no setting 'poles'. Remedy: .*structure"):
        p2(poles=2)


def test_a_preset_answers_what_is_asked_of_its_class() -> None:
    p2, multistate = load("estimators", "p2"), load("estimators", "multistate")
    assert p2.__doc__.startswith("Two lags.")
    assert (p2.effort, multistate.effort) == (type(p2()).effort, 3.0)
    assert multistate.objection([], ["pressure"], ["displacement"]) == "it maps length to force"
    said = multistate.objection([], ["displacement"], ["force"])
    assert said.startswith(
        "it maps length to force, and a length is the rest length less the displa"
    )
    with pytest.raises(AttributeError):
        _ = p2.nothing_of_that_name


def test_class_methods_see_the_preset() -> None:
    class Asked(PIEstimator):
        @classmethod
        def operators(cls) -> int:
            return cls().n_operators

    module = types.ModuleType("asked")
    module.Asked = Asked  # type: ignore[attr-defined]
    sys.modules["asked"] = module
    try:
        assert Chosen("few", preset("asked:Asked", "A few.", n_operators=3)).operators() == 3
    finally:
        del sys.modules["asked"]


def test_another_package_gives_a_preset_by_an_entry_point(monkeypatch: pytest.MonkeyPatch) -> None:
    outside = types.ModuleType("outside")
    location = "mckibben.estimators.play_type.pi:PIEstimator"
    outside.few = preset(location, "A PI model of three operators.", n_operators=3)  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "outside", outside)
    entry = EntryPoint("pi-of-three", "outside:few", "mckibben.estimators")
    monkeypatch.setattr(mckibben.registry, "entry_points", lambda group: [entry])
    mckibben.registry._locations.cache_clear()
    try:
        assert "pi-of-three" in names("estimators")
        assert load("estimators", "pi-of-three")().n_operators == 3
    finally:
        mckibben.registry._locations.cache_clear()


def descendants(cls: type[Any]) -> Iterator[type[Any]]:
    children: list[type[Any]] = cls.__subclasses__()
    for child in children:
        yield child
        yield from descendants(child)


def test_estimators_are_abstract_or_final() -> None:
    for name in names("estimators"):
        load("estimators", name)
    ours = [cls for cls in descendants(Estimator) if cls.__module__.startswith("mckibben.")]
    assert ours
    for cls in ours:
        overridden = [base for base in cls.__mro__[1:] if base in ours and not isabstract(base)]
        assert not overridden, f"{cls} overrides {overridden[0]}: give that a setting instead"
